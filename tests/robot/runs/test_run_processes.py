"""The program as a person starts it, on the fake ports, in real time: what is done to it costs no results."""

import contextlib
import json
import os
import pty
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time

import psutil
import pytest

from lemtomap.drivers.kobuki.session import KobukiSession
from lemtomap.robot.cli.main import main
from lemtomap.robot.runs.sim_server import FakeHardware
from lemtomap.sim import worlds
from lemtomap.sim.serve import PtyServer
from lemtomap.sim.simulator import Simulator
from lemtomap.topo.file.store import TopoStore

pytestmark = pytest.mark.realtime
WHOLE = {"map.lemto", "trajectory.tum", "overview.png", "grid.pgm", "grid.yaml", "summary.json"}
# makes its terminal the one whose end is the end of its session
OWNER = """
import fcntl, sys, termios
from lemtomap.robot.cli.main import main
fcntl.ioctl(0, termios.TIOCSCTTY, 0)
sys.exit(main())
"""
STAND_IN = f"#!{sys.executable}\nimport os\nwhile os.read(0, 65536): pass\n"


def wait_for(what, patience_s=60.0):
    end_s = time.monotonic() + patience_s
    while time.monotonic() < end_s:
        if found := what():
            return found
        time.sleep(0.02)
    raise AssertionError("it did not come")


def is_whole(out):
    assert {path.name for path in out.iterdir()} >= WHOLE
    with TopoStore.view(out / "map.lemto") as store:
        assert sum(1 for _ in store.nodes()) > 0
    return json.loads((out / "summary.json").read_text())


@pytest.fixture
def with_window(tmp_path):
    """Return an environment with a display, in which a stand-in is Rerun's window."""
    program = tmp_path / "rerun-window"
    program.write_text(STAND_IN)
    program.chmod(0o755)
    return {**os.environ, "DISPLAY": ":97", "RERUN_CLI_PATH": str(program)}


@contextlib.contextmanager
def started(*words, program=("-m", "lemtomap"), env=None, **options):
    """Run `lemtomap` with these words; what it says is read on, so that it never waits for us."""
    said = []
    command = [sys.executable, *program, *map(str, words)]
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, **options}
    robot = subprocess.Popen(command, env=env, text=True, **streams)  # noqa: S603 - our own command
    reader = threading.Thread(target=lambda: said.extend(robot.stdout or ()), daemon=True)
    reader.start()
    try:
        yield robot, said
    finally:
        robot.kill()
        robot.wait()
        reader.join(5.0)
        if robot.stdout:
            robot.stdout.close()


def window_of(robot):
    """Return the process that stands in for the window, once it runs."""

    def find():
        children = psutil.Process(robot.pid).children(recursive=True)
        return [each for each in children if any("rerun-window" in word for word in each.cmdline()[:2])]

    return wait_for(find)[0]


def listening(robot):
    """Return the addresses on which the program, or one it started, waits for others."""
    tree = [psutil.Process(robot.pid), *psutil.Process(robot.pid).children(recursive=True)]
    held = [
        (each.net_connections if hasattr(each, "net_connections") else each.connections)() for each in tree
    ]
    return {one.laddr for each in held for one in each if one.status == psutil.CONN_LISTEN}


def mapping(said):
    return wait_for(lambda: any("openings to explore" in line for line in said))


def test_a_frozen_window_and_a_stranger_on_its_port_delay_neither_start_nor_ctrl_c(tmp_path, with_window):
    out = tmp_path / "out"
    with contextlib.ExitStack() as held, FakeHardware("office", 2) as hardware:
        stranger = held.enter_context(socket.socket())
        with contextlib.suppress(OSError):  # somebody is there already: a stranger as good as ours
            stranger.bind(("127.0.0.1", 9876))
            stranger.listen()
        ports = ["--kobuki", hardware.kobuki, "--hokuyo", hardware.hokuyo]
        robot, said = held.enter_context(started("run", *ports, "--out", out, env=with_window))
        window = window_of(robot)
        window.suspend()
        mapping(said)
        assert {address.ip for address in listening(robot)} <= {"127.0.0.1"}
        time.sleep(1.0)
        robot.send_signal(signal.SIGINT)
        assert robot.wait(30) == 130
        assert not window.is_running() or window.status() == psutil.STATUS_ZOMBIE
    assert is_whole(out)["interrupted"]
    assert any("lemtomap: interrupted" in line for line in said)


def test_a_killed_window_and_a_deleted_folder_cost_no_results(tmp_path, with_window):
    out = tmp_path / "out"
    with started("sim", "--mission", "explore", "--out", out, env=with_window) as (robot, said):
        window_of(robot).kill()
        mapping(said)
        shutil.rmtree(out)
        wait_for(lambda: any(f"{out} is gone" in line for line in said), 10.0)
        wait_for(lambda: any("live view was closed" in line for line in said), 10.0)
        robot.send_signal(signal.SIGTERM)
        assert robot.wait(30) == 130
    assert is_whole(out)["faults"] == []


def test_a_closed_terminal_ends_the_drive_with_a_stop_and_its_results(tmp_path):
    simulator = Simulator(worlds.load("office"), seed=1)
    server = PtyServer(simulator)
    heard, port = bytearray(), server._pairs[0][0]
    write = port.write

    def listen(data):
        heard.extend(data)
        write(data)

    port.write = listen
    stop = threading.Event()
    serving = threading.Thread(target=server.serve, args=(stop,))
    serving.start()
    ours, theirs = pty.openpty()
    ports = ["--kobuki", server.kobuki_path, "--hokuyo", server.hokuyo_path]
    streams = dict.fromkeys(("stdin", "stdout", "stderr"), theirs)
    try:
        words = ["run", *ports, "--out", tmp_path / "out"]
        with started(*words, program=("-c", OWNER), start_new_session=True, **streams) as (robot, _):
            os.close(theirs)
            shown = b""
            while b"openings to explore" not in shown:
                shown += os.read(ours, 4096)
            time.sleep(1.0)
            os.close(ours)
            assert robot.wait(30) == 130
        time.sleep(0.1)
        assert bytes(heard).endswith(KobukiSession().stop_bytes())
        assert is_whole(tmp_path / "out")["interrupted"]
    finally:
        stop.set()
        serving.join()
        server.close()
        simulator.close()


def test_a_run_on_silent_ports_fails_with_one_line_that_names_both(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("lemtomap.robot.runs.real.warm_up", lambda *_: None)
    pairs = [pty.openpty() for _ in range(2)]
    kobuki, hokuyo = (os.ttyname(theirs) for _, theirs in pairs)
    words = ["run", "--kobuki", kobuki, "--hokuyo", hokuyo, "--duration", "1", "--out", str(tmp_path / "out")]
    try:
        assert main(words) == 2
    finally:
        for end in [end for pair in pairs for end in pair]:
            os.close(end)
    last = capsys.readouterr().err.splitlines()[-1]
    assert last == f"lemtomap: the base on {kobuki} sent no packets, the laser on {hokuyo} sent no scans"
