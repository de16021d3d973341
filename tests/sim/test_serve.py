"""The fake hardware on real pseudo-terminals, in real time."""

import json
import os
import select
import signal
import subprocess
import sys
import termios
import time

import pytest

from lemtomap.sim.pty_port import FULL_BYTES, PtyPort


def read_for(fd: int, seconds: float) -> bytes:
    data, end = b"", time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0:
        if select.select([fd], [], [], left)[0]:
            data += os.read(fd, 65536)
    return data


@pytest.mark.realtime
def test_served_ports_speak_both_protocols_survive_a_close_and_end_cleanly():
    server = subprocess.Popen(
        [sys.executable, "-m", "lemtomap.sim.serve", "--world", "office"], stdout=subprocess.PIPE, text=True
    )
    try:
        ports = json.loads(server.stdout.readline())
        base = os.open(ports["kobuki"], os.O_RDWR | os.O_NOCTTY)
        assert read_for(base, 0.5).count(b"\xaa\x55\x4d\x01\x0f") > 10
        os.close(base)
        for _ in range(2):  # the second client finds the port alive after the first has closed it
            laser = os.open(ports["hokuyo"], os.O_RDWR | os.O_NOCTTY)
            os.write(laser, b"QT\nMD0044072501000\n")
            data = read_for(laser, 0.6)
            assert b"QT\n00P\n\n" in data
            assert data.count(b"99b\n") >= 3
            os.close(laser)
        base = os.open(ports["kobuki"], os.O_RDWR | os.O_NOCTTY)
        termios.tcflush(base, termios.TCIFLUSH)
        os.write(base, bytes.fromhex("AA550601046400000067"))
        read_for(base, 0.5)
        os.close(base)
        server.send_signal(signal.SIGTERM)
        truth = json.loads(server.communicate(timeout=10)[0])
        assert server.returncode == 0
        assert truth["path_m"] > 0.01
    finally:
        server.kill()
        server.wait()


def test_unread_port_drops_whole_frames_and_keeps_little_backlog():
    port = PtyPort()
    client = os.open(port.path, os.O_RDWR | os.O_NOCTTY)
    frame = b"\xaa\x55" + bytes(77) + b"\x01\x02"
    for _ in range(200):
        port.write(frame)
        time.sleep(0.005)  # the kernel counts unread bytes a moment later
    backlog = b""
    while select.select([client], [], [], 0.05)[0]:
        backlog += os.read(client, 65536)
    assert port.dropped_frames > 100
    assert len(backlog) <= FULL_BYTES + len(frame)
    assert backlog == frame * (len(backlog) // len(frame))
    port.write(frame)
    assert os.read(client, 4096) == frame
    os.close(client)
    port.close()


def test_unknown_world_is_one_line_and_exit_code_2():
    done = subprocess.run(
        [sys.executable, "-m", "lemtomap.sim.serve", "--world", "atlantis"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert "atlantis" in done.stderr
