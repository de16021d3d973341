"""Whatever a person gets wrong: one line that names it, exit code 2, and nothing half-written left behind."""

import gzip
import os
import pty
import re
import threading
import tty
from pathlib import Path

import pytest
import serial

from lemtomap.robot.cli.main import main

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
        *news, verdict = said.err.splitlines()
        assert all(" s  " in line for line in news), said.err  # what a run that had begun told so far
        assert verdict.startswith("lemtomap: ")
        return verdict.removeprefix("lemtomap: ")

    return run


def write(path: Path, content: str | bytes) -> Path:
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


FIRST = SOUND.splitlines()[0]
BAD_LOGS = {
    "empty.clf": ("", "empty"),
    "cut.clf": (SOUND.splitlines()[-1][:-200], ":1: .*cut"),
    "nan.clf": (
        SOUND.splitlines()[0].replace(" 0 0 0 0 ", " 0 0 0 nan ", 1),
        ":1: 'nan' is not a finite number",
    ),
    "text.clf": (FIRST.replace("2.5", "2.5m", 1), ":1: '2.5m' stands where a number"),
    "foreign.clf": ("# a poem\nnothing of ours\n", "no FLASER, ROBOTLASER1 or RAWLASER1 line"),
    "cut.dat": (DAT[:-300], ":1: .*cut"),
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
        (["--max-range", "0"], "--max-range: slam.max_range_m: 0.0 must lie"),
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


@pytest.fixture
def terminals():
    """Two pseudo-terminals: (our end, path) each."""
    pairs = [pty.openpty() for _ in range(2)]
    for _, theirs in pairs:
        tty.setraw(theirs)
    yield [(ours, os.ttyname(theirs)) for ours, theirs in pairs]
    for pair in pairs:
        for end in pair:
            os.close(end)


def test_a_port_that_is_not_there_is_named(refused, tmp_path, terminals):
    (_, kobuki), _ = terminals
    said = refused("run", "--kobuki", kobuki, "--hokuyo", "/dev/no-such-laser", "--out", tmp_path / "out")
    assert "/dev/no-such-laser: no such port" in said
    assert not list(tmp_path.iterdir())


def test_a_port_that_another_program_holds_is_named(refused, tmp_path, terminals):
    (_, kobuki), (_, hokuyo) = terminals
    with serial.Serial(hokuyo, exclusive=True):
        said = refused("run", "--kobuki", kobuki, "--hokuyo", hokuyo, "--out", tmp_path / "out")
    assert hokuyo in said
    assert "another program" in said
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("end", "period_s", "wrong"),
    [(1, 0.02, "not a laser"), (1, 0.7, "not a laser"), (0, 0.7, "not a Kobuki base")],
    ids=["on the laser's port", "slowly on the laser's port", "slowly on the base's port"],
)
def test_another_device_on_the_port_is_named_by_what_it_sent(
    refused, tmp_path, terminals, monkeypatch, end, period_s, wrong
):
    monkeypatch.setattr("lemtomap.robot.runs.real.warm_up", lambda *_: None)
    (_, kobuki), (_, hokuyo) = terminals
    stranger, path = terminals[end]
    stop = threading.Event()

    def chat() -> None:
        while not stop.wait(period_s):
            os.write(stranger, b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n")

    gps = threading.Thread(target=chat)
    gps.start()
    try:
        said = refused("run", "--kobuki", kobuki, "--hokuyo", hokuyo, "--out", tmp_path / "out")
    finally:
        stop.set()
        gps.join()
    assert said.startswith(f"{path}: {wrong} but a device that speaks NMEA")
    assert "$GPGGA" in said
    assert not list(tmp_path.iterdir())


def test_one_port_for_both_devices_is_refused(refused, tmp_path):
    assert "both" in refused("run", "--kobuki", "/dev/x", "--hokuyo", "/dev/x", "--out", tmp_path / "out")


def test_a_foreign_map_is_refused_before_anything_is_opened(refused, tmp_path, terminals):
    (_, kobuki), (_, hokuyo) = terminals
    foreign = write(tmp_path / "office.lemto", "not a map")
    ports = ["--kobuki", kobuki, "--hokuyo", hokuyo]
    said = refused("run", *ports, "--map", foreign, "--out", tmp_path / "out")
    assert said == f"{foreign}: not a .lemto map file"
    assert foreign.read_text() == "not a map"


def test_an_older_map_in_the_folder_is_not_overwritten(refused, tmp_path, terminals):
    (_, kobuki), (_, hokuyo) = terminals
    write(tmp_path / "map.lemto", "precious")
    assert "--map" in refused("run", "--kobuki", kobuki, "--hokuyo", hokuyo, "--out", tmp_path)
    assert (tmp_path / "map.lemto").read_text() == "precious"


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (["--world", "nowhere"], "nowhere: no such world"),
        (["--mission", "dance"], "mission 'dance'"),
        (["--duration", "0"], "duration"),
    ],
)
def test_a_simulation_that_cannot_be_is_refused(refused, tmp_path, options, reason):
    assert reason in refused("sim", "--fast", "--out", tmp_path / "out", *options)
    assert not list(tmp_path.iterdir())


def test_ctrl_c_while_mapping_says_what_was_stopped_and_leaves_nothing(tmp_path, monkeypatch, capsys):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("lemtomap.robot.runs.map_log.draw", interrupted)
    log, out = write(tmp_path / "short.clf", SOUND), tmp_path / "out"
    assert main(["map", str(log), "--out", str(out)]) == 130
    (line,) = capsys.readouterr().err.splitlines()
    assert line == f"lemtomap: mapping of {log} interrupted; nothing was written to {out}"
    assert list(tmp_path.iterdir()) == [log]
