"""A log is read line by line, whatever packs or encodes it; what can be no log is refused early."""

import gzip
import lzma
import os

import pytest

from lemtomap.errors import BadLog
from lemtomap.robot.cli.main import main
from lemtomap.robot.logs import open_log, text
from tests.robot.logs.carmen_lines import flaser

LINES = "".join(flaser([1.0] * 180, stamp=f"{k}.000000") + "\n" for k in range(5))


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32", "latin-1"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_no_scan_is_lost_to_an_encoding(tmp_path, encoding, end):
    (tmp_path / "a.log").write_bytes(LINES.replace("\n", end).encode(encoding))
    log = open_log(tmp_path / "a.log")
    assert len(log) == 5
    assert log.remarks == []


@pytest.mark.parametrize("lead", [" ", "\t", "\ufeff"])
def test_blanks_before_a_message_do_not_hide_it(tmp_path, lead):
    path = tmp_path / "a.clf"
    path.write_text("".join(f"{lead}{line}\n" for line in LINES.splitlines()), encoding="utf-8")
    assert len(open_log(path)) == 5


@pytest.mark.parametrize("name", ["A.LOG", "a.Clf", "a.clf.GZ", "a.LOG.XZ", "A.CLF.gz"])
def test_suffixes_are_read_in_any_case(tmp_path, name):
    pack = {".gz": gzip.compress, ".xz": lzma.compress}.get(name[-3:].lower(), bytes)
    (tmp_path / name).write_bytes(pack(LINES.encode()))
    assert len(open_log(tmp_path / name)) == 5


def bomb(path, unit, size):
    """Write a packed file of a few bytes that unpacks to `size` bytes of a unit."""
    pack = {".gz": gzip.compress, ".xz": lzma.compress}[path.suffix]
    path.write_bytes(pack((unit * (size // len(unit) + 1))[:size]))
    return path


@pytest.mark.parametrize("suffix", [".gz", ".xz"])
@pytest.mark.parametrize("unit", [b"\n", LINES.encode()])
def test_a_bomb_is_refused_after_its_first_megabytes(tmp_path, monkeypatch, suffix, unit):
    monkeypatch.setattr(text, "FREE_BYTES", 300_000)
    monkeypatch.setattr(text, "MOST_PACKED", 10)
    path = bomb(tmp_path / f"bomb.clf{suffix}", unit, 3_000_000)
    head = {".gz": gzip.compress, ".xz": lzma.compress}[suffix](os.urandom(200_000).hex().encode() + b"\n")
    path.write_bytes(head + path.read_bytes())  # what is honest at the beginning does not pay for the rest
    unpacked = 0
    with pytest.raises(BadLog, match=r"bomb.*times its size") as caught:  # noqa: PT012 - the loop is the reader
        for _, line in text.lines(path):
            unpacked += len(line)
    assert str(path) in str(caught.value)
    assert unpacked < 400_000 + 1_000_000


def test_what_packs_well_because_the_robot_stood_is_no_bomb(tmp_path):
    path = bomb(tmp_path / "still.clf.xz", LINES.encode(), 40 * len(LINES))
    assert len(open_log(path)) == 200


def test_a_line_without_end_is_refused_at_a_megabyte(tmp_path):
    path = tmp_path / "long.clf"
    path.write_bytes(LINES.encode() + b"FLASER 180 " + b"1.00 " * 1_000_000)
    with pytest.raises(BadLog, match="line 6 is longer than 1,000,000 characters"):
        open_log(path)


def test_a_plain_file_of_gigabytes_is_refused_at_once(tmp_path):
    path = tmp_path / "huge.clf"
    with path.open("wb") as file:
        file.truncate(4_000_000_000)
    with pytest.raises(BadLog, match="more than 1 GB of text"):
        open_log(path)


def test_packed_text_beyond_a_gigabyte_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(text, "MOST_BYTES", 3_000)
    (tmp_path / "a.clf.gz").write_bytes(gzip.compress(LINES.encode()))
    with pytest.raises(BadLog, match="of text: cut it into parts"):
        open_log(tmp_path / "a.clf.gz")


def test_a_pipe_is_no_log_and_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe.clf")
    with pytest.raises(BadLog, match="is no file"):
        open_log(tmp_path / "pipe.clf")


def test_a_bomb_costs_one_line_and_exit_code_2(tmp_path, capsys):
    path = bomb(tmp_path / "bomb.log.gz", b"\0", 20_000_000)
    assert main(["map", str(path), "--out", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not (tmp_path / "out").exists()
