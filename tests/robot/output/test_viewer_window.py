"""The live view is never waited for, and goes with the run. A stand-in takes the place of Rerun's window."""

import os
import signal
import socket
import stat
import subprocess
import sys
import time

import psutil
import pytest

from lemtomap.robot.cli.main import main
from lemtomap.robot.output.progress import LeftColumn, ShareColumn, progress_bar
from lemtomap.robot.output.view import free_ports, where_to_look
from lemtomap.robot.output.viewer_command import start_viewer
from lemtomap.robot.output.viewer_window import ViewerWindow

STAND_IN = f"""#!{sys.executable}
import os, pathlib, sys, time
pathlib.Path(os.environ["STAND_IN_LOG"]).write_text(f"{{os.getpid()}} {{' '.join(sys.argv[1:])}}\\n")
while os.environ.get("STAND_IN") != "deaf" and os.read(0, 65536):
    if os.environ.get("STAND_IN", "").isdigit():
        sys.exit(int(os.environ["STAND_IN"]))
time.sleep(60)
"""


@pytest.fixture
def stand_in(tmp_path, monkeypatch):
    """Return the file in which the stand-in writes its process number and options."""
    program = tmp_path / "rerun"
    program.write_text(STAND_IN)
    program.chmod(program.stat().st_mode | stat.S_IEXEC)
    monkeypatch.setenv("RERUN_CLI_PATH", str(program))
    monkeypatch.setenv("STAND_IN_LOG", str(tmp_path / "log"))
    return tmp_path / "log"


def wait_for(what, patience_s=10.0):
    end_s = time.monotonic() + patience_s
    while time.monotonic() < end_s:
        if found := what():
            return found
        time.sleep(0.02)
    raise AssertionError("it did not come")


def started(log):
    return wait_for(lambda: log.exists() and log.read_text().endswith("\n") and log.read_text().split())


def alive(pid):
    return psutil.pid_exists(pid) and psutil.Process(pid).status() != psutil.STATUS_ZOMBIE


def test_a_window_gets_all_bytes_hears_this_machine_alone_and_goes_with_the_run(stand_in):
    said = []
    window = ViewerWindow(said.append)
    pid, *options = started(stand_in)
    assert options[:4] == ["--bind", "127.0.0.1", "--port", "auto"]
    window.put(b"x" * 200_000)
    wait_for(lambda: window.put(b"") or not window._waiting)
    window.close()
    window.close()
    wait_for(lambda: not alive(int(pid)))
    assert said == []


def test_a_frozen_window_is_given_up_without_waiting_and_ended(stand_in, monkeypatch):
    monkeypatch.setenv("STAND_IN", "deaf")
    said = []
    window = ViewerWindow(said.append, backlog_bytes=1_000_000)
    pid = int(started(stand_in)[0])
    os.kill(pid, signal.SIGSTOP)
    for _ in range(30):
        window.put(b"x" * 65_536)
    assert said == ["the live view takes nothing any more and is closed; the run goes on"]
    wait_for(lambda: not alive(pid))


@pytest.mark.parametrize(("code", "how"), [(0, "was closed"), (3, "ended with code 3")])
def test_a_window_that_goes_is_told_once(stand_in, monkeypatch, code, how):
    monkeypatch.setenv("STAND_IN", str(code))
    said = []
    window = ViewerWindow(said.append)
    window.put(b"x")
    wait_for(lambda: window._process.poll() is not None)
    window.put(b"x")
    window.put(b"x")
    assert said == [f"the live view {how}; the run goes on"]


def test_a_viewer_that_fails_ends_the_command_with_its_code(tmp_path, stand_in, monkeypatch, capsys):
    monkeypatch.setenv("STAND_IN", "3")
    monkeypatch.setenv("DISPLAY", ":97")
    (tmp_path / "run.rrd").write_bytes(b"RRF2")
    monkeypatch.setattr("lemtomap.robot.output.view.start_viewer", with_input)
    assert main(["view", str(tmp_path)]) == 2
    assert "the Rerun viewer ended with code 3" in capsys.readouterr().err


def with_input(*options, **_):
    """Start the stand-in with a byte to read."""
    viewer = start_viewer(*options, stdin=subprocess.PIPE)
    viewer.stdin.write(b"x")
    viewer.stdin.close()
    return viewer


def test_ports_that_somebody_has_are_left_alone_and_the_link_names_those_that_are_served():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        page, data = free_ports((port, 0))
        assert port not in {page, data}
        assert page != data
    link, tunnel, _ = where_to_look(page, data).splitlines()
    assert link == f"open http://127.0.0.1:{page}/?url=rerun%2Bhttp%3A%2F%2F127.0.0.1%3A{data}%2Fproxy"
    assert f"-L {page}:127.0.0.1:{page} -L {data}:127.0.0.1:{data} " in tunnel


def listening(process):
    """Return the addresses on which a process, or one it started, waits for others."""
    found = set()
    for each in [process, *process.children(recursive=True)]:
        held = each.net_connections() if hasattr(each, "net_connections") else each.connections()
        found |= {connection.laddr for connection in held if connection.status == psutil.CONN_LISTEN}
    return found


@pytest.mark.realtime
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_recording_is_served_to_this_machine_alone_and_its_ports_end_with_the_command(tmp_path, number):
    import rerun as rr  # noqa: PLC0415 - only here

    stream = rr.RecordingStream("lemtomap", make_default=False)
    stream.save(tmp_path / "run.rrd")
    stream.log("a", rr.TextLog("text"))
    stream.disconnect()
    command = [sys.executable, "-m", "lemtomap", "view", str(tmp_path), "--web"]
    without = {**os.environ, "DISPLAY": ""}
    viewer = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=without)  # noqa: S603 - our own
    try:
        link = viewer.stdout.readline().split()[1]
        process = psutil.Process(viewer.pid)
        ports = wait_for(lambda: len(listening(process)) == 2 and listening(process), 20.0)
        assert {address.ip for address in ports} == {"127.0.0.1"}
        assert all(
            f"127.0.0.1%3A{port.port}%2F" in link or f"127.0.0.1:{port.port}/" in link for port in ports
        )
        children = process.children(recursive=True)
        viewer.send_signal(number)
        assert viewer.wait(10) == 130
        assert not any(alive(child.pid) for child in children)
    finally:
        viewer.kill()
        viewer.wait()
        viewer.stdout.close()


def test_the_progress_of_endless_work_shows_the_time_not_a_share():
    with progress_bar("run") as bar:
        task = bar._progress.tasks[bar._task]
        bar.show(0.25)
        assert str(ShareColumn().render(task)) == " 25 %"
        task.start_time -= 3725.0
        bar.show(None)
        assert str(ShareColumn().render(task)) == "1:02:05"
        assert str(LeftColumn(compact=True).render(task)) == ""
