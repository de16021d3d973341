"""What is recorded comes back, byte for byte and nanosecond for nanosecond, as far as the file is sound."""

import random
import struct
import zlib

import numpy as np
import pytest

from lemtomap.errors import BadLog
from lemtomap.robot.clock import stamp_ns
from lemtomap.robot.devices.mcap_file import McapFile
from lemtomap.robot.devices.parts import PARTS, parts_of
from lemtomap.robot.devices.recorded import Gap, Recording
from lemtomap.robot.devices.recording import (
    HOKUYO,
    KOBUKI,
    OPENED,
    UP,
    Call,
    RecordedCall,
    Recorder,
)
from tools.checks.mcap_damage import (
    CHUNK,
    MAGIC_BYTES,
    chunk_content,
    chunk_payload,
    mcap_bytes,
    mcap_records,
)

SMALL_LIMIT = 400_000
OPENING = [
    RecordedCall(HOKUYO, Call.PORT, 1, OPENED),
    RecordedCall(HOKUYO, Call.TICK, 2),
    RecordedCall(HOKUYO, Call.RECEIVE, 3, b"VV"),
    RecordedCall(HOKUYO, Call.PORT, 4, UP),
]


def entries(count=2000):
    rng = np.random.default_rng(3)
    made, now = list(OPENING), 1000
    for _ in range(count):
        now += int(rng.integers(1, 20_000_000))
        device = (KOBUKI, HOKUYO)[int(rng.integers(2))]
        call = (Call.RECEIVE, Call.SEND, Call.TICK)[int(rng.integers(3))]
        data = b"" if call is Call.TICK else rng.bytes(int(rng.integers(1, 90)))
        made.append(RecordedCall(device, call, now, data))
    return made


def record(path, made, **options):
    recorder = Recorder(path, {"title": "test"}, **options)
    for entry in made:
        recorder.raw(entry)
        recorder.derived("/odom", entry.now_s, {"x": 1.5})
    recorder.close()
    recorder.close()
    return recorder


def calls(path):
    return [entry for entry in Recording.open(path).entries() if isinstance(entry, RecordedCall)]


def chunks_of(path):
    """Return (offset of the content, content) of each chunk of a file."""
    at, found = MAGIC_BYTES, []
    for opcode, content in mcap_records(path.read_bytes()[MAGIC_BYTES:]):
        found += [(at + 9, content)] if opcode == CHUNK else []
        at += 9 + len(content)
    return found


def damage(path, offset, data):
    with path.open("r+b") as file:
        file.seek(offset)
        file.write(data)


def stretch(content):
    """Return the first and last time in a chunk by its own words, s."""
    start_ns, end_ns = struct.unpack_from("<QQ", content)
    return start_ns * 1e-9, end_ns * 1e-9


@pytest.fixture
def whole(tmp_path):
    """Return a sound recording of several chunks and the calls in it."""
    made = entries()
    record(tmp_path / "run.mcap", made)
    return tmp_path / "run.mcap", made


def test_every_call_comes_back_in_order(whole):
    path, made = whole
    recording = Recording.open(path.parent)
    assert list(recording.entries()) == made
    assert len(list(recording.derived("/odom"))) == len(made)
    assert (recording.whole, recording.told_gaps()) == (True, "")
    assert (recording.begins_s, recording.ends_s) == (made[0].now_s, made[-1].now_s)
    assert recording.about["title"] == "test"


def test_a_recorded_time_is_the_very_same_float():
    rng = np.random.default_rng(5)
    for ns in rng.integers(0, 20 * 86_400 * 10**9, 10_000):
        assert stamp_ns(int(ns) * 1e-9) == ns


def test_a_damaged_chunk_is_lost_alone_and_the_gap_is_told(whole):
    path, made = whole
    chunks = chunks_of(path)
    assert len(chunks) > 4
    offset, content = chunks[2]
    damage(path, offset + len(content) // 2, b"\x55" * 20)
    recording = Recording.open(path)
    from_s, until_s = stretch(content)
    kept = [entry for entry in made if not from_s <= entry.now_s <= until_s]
    assert abs(len([e for e in recording.entries() if isinstance(e, RecordedCall)]) - len(kept)) <= 1
    (gap,) = recording.gaps
    assert gap.from_s == pytest.approx(from_s, abs=0.05)
    assert gap.until_s == pytest.approx(until_s, abs=0.05)
    assert f"bytes are missing from {gap.from_s:.1f} to {gap.until_s:.1f} s" in recording.told_gaps()
    assert [type(entry) for entry in recording.entries()].index(Gap) > 100


def test_the_calls_after_a_chunk_whose_own_length_is_damaged_are_found_again(whole):
    path, made = whole
    offset, _ = chunks_of(path)[1]
    damage(path, offset - 8, struct.pack("<Q", 2**40))
    assert calls(path)[-1] == made[-1]
    assert len(Recording.open(path).gaps) == 1


def test_the_calls_after_a_message_index_that_leads_astray_are_found_again(whole):
    path, made = whole
    records = mcap_records(path.read_bytes()[MAGIC_BYTES:])
    offset, content = chunks_of(path)[1]
    index_at = offset + len(content)
    assert path.read_bytes()[index_at] == 7
    damage(path, index_at + 1, struct.pack("<Q", sum(len(data) for _, data in records) // 2))
    assert calls(path) == made


def test_channels_are_known_even_when_the_first_chunk_and_the_end_are_lost(whole):
    path, made = whole
    offset, content = chunks_of(path)[0]
    last, _ = chunks_of(path)[-1]
    damage(path, offset + len(content) - 30, b"\x00" * 30)
    path.write_bytes(path.read_bytes()[:last])
    got = calls(path)
    assert len(got) > len(made) // 2
    assert set(got) <= set(made)


def test_a_file_cut_anywhere_gives_what_was_written_and_says_where_it_ends(whole):
    path, made = whole
    data = path.read_bytes()
    first = chunks_of(path)[0]
    rng = random.Random(2)
    for cut in sorted(rng.sample(range(first[0] + len(first[1]), len(data)), 25)):
        path.write_bytes(data[:cut])
        recording = Recording.open(path)
        got = [entry for entry in recording.entries() if isinstance(entry, RecordedCall)]
        assert got == made[: len(got)]
        if len(got) < len(made):
            assert f"it ends at {got[-1].now_s:.1f} s" in recording.told_gaps()
            assert not recording.whole


def test_a_chunk_that_stands_twice_is_read_once(whole):
    path, made = whole
    data = path.read_bytes()
    offset, content = chunks_of(path)[1]
    end = offset + len(content)
    path.write_bytes(data[:end] + data[offset - 9 : end] + data[end:])
    assert calls(path) == made


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda old: chunk_content(old, chunk_payload(old), crc=1), "checksum"),
        (lambda old: chunk_content(old, chunk_payload(old), compression=b"lz4"), "'lz4'"),
        (lambda old: old[:16] + struct.pack("<Q", 2**40) + old[24:], "bytes"),
        (lambda old: old[:16] + struct.pack("<Q", 5) + old[24:], "unpack"),
        (lambda old: chunk_content(old, chunk_payload(old)[:-3]), "middle of a record"),
    ],
    ids=["checksum", "compression", "huge", "size", "cut inside"],
)
def test_each_kind_of_bad_chunk_is_left_out_and_named(whole, change, reason):
    path, made = whole
    records = mcap_records(path.read_bytes()[MAGIC_BYTES:])
    second = [index for index, (opcode, _) in enumerate(records) if opcode == CHUNK][1]
    records[second] = (CHUNK, change(records[second][1]))
    path.write_bytes(path.read_bytes()[:MAGIC_BYTES] + mcap_bytes(records))
    assert reason in Recording.open(path).told_gaps()
    assert calls(path)[-1] == made[-1]


def test_a_frame_that_promises_more_than_its_chunk_is_not_unpacked(whole):
    path, _ = whole
    zstandard = pytest.importorskip("zstandard")
    records = mcap_records(path.read_bytes()[MAGIC_BYTES:])
    second = [index for index, (opcode, _) in enumerate(records) if opcode == CHUNK][1]
    old = records[second][1]
    frame = zstandard.compress(b"\x00" * 10_000_000)
    head = old[:16] + struct.pack("<QII", 70_000, zlib.crc32(b""), 4) + b"zstd"
    records[second] = (CHUNK, head + struct.pack("<Q", len(frame)) + frame)
    path.write_bytes(path.read_bytes()[:MAGIC_BYTES] + mcap_bytes(records))
    assert "does not unpack" in Recording.open(path).told_gaps()


def test_foreign_empty_and_missing_files_are_refused_by_name(tmp_path):
    (tmp_path / "text.mcap").write_text("hello, this is no recording at all")
    (tmp_path / "empty.mcap").touch()
    Recorder(tmp_path / "bare.mcap").close()
    (tmp_path / "head.mcap").write_bytes((tmp_path / "bare.mcap").read_bytes()[:20])
    for name in ("text", "empty", "bare", "head"):
        with pytest.raises(BadLog, match=f"{name}.mcap"):
            Recording.open(tmp_path / f"{name}.mcap")
    with pytest.raises(BadLog, match="no such recording"):
        Recording.open(tmp_path)


def test_a_long_recording_goes_on_in_parts_and_its_oldest_go(tmp_path):
    made = entries(9000)
    recorder = record(tmp_path / "run.mcap", made, limit_bytes=SMALL_LIMIT)
    parts = parts_of(tmp_path / "run.mcap")
    assert len(parts) == PARTS
    assert tmp_path / "run.mcap" not in parts
    held = sum(part.stat().st_size for part in parts)
    assert 0.7 * SMALL_LIMIT < held < 2.0 * SMALL_LIMIT  # a part may end a chunk and its index too late
    assert recorder.parts.dropped == recorder.parts.number - PARTS
    assert recorder.parts.written_bytes > held
    recording = Recording.open(tmp_path)
    got = calls(tmp_path)[1 + len(OPENING) :]
    assert got == made[-len(got) :]
    assert recording.told_gaps() == f"it begins at {recording.begins_s:.1f} s: older parts are gone"
    assert not recording.whole


def test_parts_that_are_all_there_are_one_whole_recording(tmp_path):
    made = entries(3000)
    record(tmp_path / "run.mcap", made, limit_bytes=SMALL_LIMIT)
    assert len(parts_of(tmp_path / "run.mcap")) > 2
    assert calls(tmp_path) == made
    assert Recording.open(tmp_path / "run.mcap").whole


def test_a_part_that_somebody_removed_is_a_gap(tmp_path):
    record(tmp_path / "run.mcap", entries(3000), limit_bytes=SMALL_LIMIT)
    parts_of(tmp_path / "run.mcap")[1].unlink()
    (gap,) = Recording.open(tmp_path).gaps
    assert gap.until_s > gap.from_s
    assert "a part is gone" in gap.reason


def test_every_later_part_begins_with_what_the_laser_said_when_it_connected(tmp_path):
    recorder = Recorder(tmp_path / "run.mcap", limit_bytes=SMALL_LIMIT)
    for entry in entries(5000):
        recorder.raw(entry)
    recorder._file.flush()  # killed: what closing writes is not there
    (tmp_path / "run.mcap").unlink()
    assert calls(tmp_path)[1 : 1 + len(OPENING)] == OPENING
    recorder.close()


def test_a_lost_beginning_is_made_good_by_the_conversation_at_the_end(tmp_path):
    record(tmp_path / "run.mcap", entries())
    offset, content = chunks_of(tmp_path / "run.mcap")[0]
    damage(tmp_path / "run.mcap", offset + len(content) // 2, b"\x55" * 20)
    assert calls(tmp_path)[1 : 1 + len(OPENING)] == OPENING


def test_a_closed_file_says_so_and_a_killed_recorder_s_does_not(tmp_path):
    record(tmp_path / "run.mcap", entries(1000))
    assert McapFile(tmp_path / "run.mcap").finished
    recorder = Recorder(tmp_path / "killed.mcap")
    for entry in entries(1000):
        recorder.raw(entry)
    recorder._file.flush()
    killed = Recording.open(tmp_path / "killed.mcap")
    assert not killed.whole
    assert "it was not closed" in killed.told_gaps()
    recorder.close()
