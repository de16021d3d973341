"""What is recorded comes back, byte for byte and nanosecond for nanosecond."""

import numpy as np
import pytest

from lemtomap.errors import BadLog
from robot.clock import stamp_ns
from robot.recording import Call, Entry, Recorder, find_recording, read_derived, read_entries


def entries(count=2000):
    rng = np.random.default_rng(3)
    made, now = [], 0
    for _ in range(count):
        now += int(rng.integers(1, 20_000_000))
        device = ("kobuki", "hokuyo")[int(rng.integers(2))]
        call = list(Call)[int(rng.integers(4))]
        data = b"" if call is Call.TICK else rng.bytes(int(rng.integers(1, 90)))
        made.append(Entry(device, call, now, data))
    return made


def record(path, made):
    recorder = Recorder(path, {"world": "test"})
    for entry in made:
        recorder.raw(entry)
        recorder.derived("/odom", entry.now_s, {"x": 1.5})
    recorder.close()
    recorder.close()


def test_every_call_comes_back_in_order(tmp_path):
    made = entries()
    record(tmp_path / "run.mcap", made)
    assert list(read_entries(find_recording(tmp_path))) == made
    assert len(list(read_derived(tmp_path / "run.mcap", "/odom"))) == len(made)


def test_a_recorded_time_is_the_very_same_float():
    rng = np.random.default_rng(5)
    for ns in rng.integers(0, 20 * 86_400 * 10**9, 10_000):
        assert stamp_ns(int(ns) * 1e-9) == ns


def test_a_file_cut_short_gives_what_was_written(tmp_path):
    made = entries(20_000)
    record(tmp_path / "run.mcap", made)
    data = (tmp_path / "run.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[: len(data) * 2 // 3])
    got = list(read_entries(tmp_path / "cut.mcap"))
    assert len(got) > len(made) // 2
    assert got == made[: len(got)]


def test_foreign_empty_and_missing_files_are_refused_by_name(tmp_path):
    (tmp_path / "text.mcap").write_text("hello, this is no recording at all")
    (tmp_path / "empty.mcap").touch()
    Recorder(tmp_path / "bare.mcap").close()
    for name in ("text", "empty", "bare"):
        with pytest.raises(BadLog, match=f"{name}.mcap"):
            list(read_entries(tmp_path / f"{name}.mcap"))
    with pytest.raises(BadLog, match="no such recording"):
        find_recording(tmp_path)
