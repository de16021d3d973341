"""Whatever a person gets wrong: one line that names it, exit code 2, and nothing half-written left behind."""

import gzip
import re
from pathlib import Path

import pytest

from robot.cli import main

FLASER = "FLASER 180 " + " ".join(["2.5"] * 180) + " 0 0 0 0 0 0 {stamp} host {stamp}\n"
SOUND = "".join(FLASER.format(stamp=stamp) for stamp in (1.0, 1.2, 1.4))
DAT = " ".join(["1000"] * 706) + "\n"


@pytest.fixture
def refused(capsys):
    """Run a command that must be refused; return the one line said."""

    def run(*arguments: object) -> str:
        code = main([str(argument) for argument in arguments])
        said = capsys.readouterr()
        assert (code, said.out) == (2, ""), said
        assert said.err.startswith("lemtomap: ")
        assert said.err.count("\n") == 1
        assert "Traceback" not in said.err
        return said.err.removeprefix("lemtomap: ").strip()

    return run


def write(path: Path, content: str | bytes) -> Path:
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


BAD_LOGS = {
    "empty.clf": ("", "empty"),
    "cut.clf": (SOUND[:-200], ":3: .*cut"),
    "nan.clf": (SOUND.replace("2.5", "nan", 1), ":1: 'nan' is not a finite number"),
    "text.clf": (SOUND.replace("2.5", "2.5m", 1), ":1: '2.5m' stands where a number belongs"),
    "foreign.clf": ("# a poem\nnothing of ours\n", "no FLASER line"),
    "cut.dat": (DAT + DAT[:-300], ":2: .*cut"),
    "text.dat": (DAT.replace("1000", "x", 1), ":1: 'x' stands where a number belongs"),
    "cut.clf.gz": (gzip.compress(SOUND.encode())[:-20], "not a whole .gz file"),
    "false.clf.xz": ("not packed at all", "xz"),
    "log.bin": (SOUND, "unknown kind of log"),
}


@pytest.mark.parametrize("name", BAD_LOGS)
def test_a_bad_log_is_named_with_line_and_reason(refused, tmp_path, name):
    content, reason = BAD_LOGS[name]
    log = write(tmp_path / name, content)
    said = refused("map", log, "--out", tmp_path / "deep" / "out")
    assert str(log) in said
    assert re.search(reason, said), said
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_a_missing_log_is_named(refused, tmp_path):
    said = refused("map", tmp_path / "none.clf", "--out", tmp_path / "out")
    assert said == f"{tmp_path / 'none.clf'}: no such file"
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (["--window", "8", "--max-range", "5.6"], "twice"),
        (["--max-range", "0"], "max range"),
        (["--window", "-3"], "window"),
        (["--particles", "0"], "particles"),
        (["--particles", "many"], "particles"),
        (["--slam", "magic"], "slam"),
        (["--colour", "red"], "--colour"),
    ],
)
def test_a_setting_that_cannot_work_is_refused(refused, tmp_path, options, reason):
    log = write(tmp_path / "sound.clf", SOUND)
    assert reason in refused("map", log, "--out", tmp_path / "out", *options)
    assert [path.name for path in tmp_path.iterdir()] == ["sound.clf"]


def test_an_out_folder_that_cannot_be_is_named(refused, tmp_path):
    log = write(tmp_path / "sound.clf", SOUND)
    assert str(log) in refused("map", log, "--out", log)
    assert str(log) in refused("map", log, "--out", log / "below")
    assert log.read_text() == SOUND


def test_no_recording_to_view_is_said(refused, tmp_path):
    assert "no such recording" in refused("view", tmp_path)
    assert "not a Rerun recording" in refused("view", write(tmp_path / "run.rrd", "text"))


def test_unknown_commands_and_missing_arguments_are_one_line(refused):
    assert "mapp" in refused("mapp")
    assert "LOG" in refused("map", "--out", "x")
    assert "--out" in refused("map", "x.clf")
