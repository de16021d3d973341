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


def opened(port: PtyPort) -> int:
    return os.open(port.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)


def read_all(port: PtyPort, client: int) -> bytes:
    """Read as a client does, while the device pushes on what it owes."""
    data = b""
    while select.select([client], [], [], 0.05)[0]:
        data += os.read(client, 65536)
        port.push()
    return data


@pytest.mark.parametrize("at_once", [True, False])
def test_bytes_left_unread_by_one_client_do_not_reach_the_next(at_once):
    port = PtyPort()
    client = opened(port)
    port.write(b"owed to the first, " * 400, answer=True)
    select.select([client], [], [], 1.0)
    os.close(client)
    if at_once:  # before the device has seen that anybody went
        client = opened(port)
        assert port.heard() == [None, b""]
    else:
        assert port.heard() == [b"", None]
        port.write(b"to nobody")
        client = opened(port)
    port.write(b"to the second")
    assert read_all(port, client) == b"to the second"
    os.close(client)
    port.close()


def test_a_second_opening_beside_a_client_takes_nothing_from_it():
    port = PtyPort()
    client = opened(port)
    port.write(b"scan")
    os.close(opened(port))  # stty, fuser
    assert port.heard() == []
    assert read_all(port, client) == b"scan"
    os.close(client)
    port.close()


def test_commands_of_a_client_that_closed_at_once_are_heard_before_its_going():
    port = PtyPort()
    client = opened(port)
    os.write(client, b"BM\n")
    os.close(client)
    assert port.heard() == [b"BM\n", None]
    assert port.heard() == []
    port.close()


def test_answers_larger_than_the_room_of_the_port_come_whole_without_another_command():
    port = PtyPort()
    client = opened(port)
    answers = [bytes([65 + k]) * 2134 for k in range(20)]
    for answer in answers:
        port.write(answer, answer=True)
    assert read_all(port, client) == b"".join(answers)
    assert port.dropped_frames == 0
    os.close(client)
    port.close()


def test_a_client_that_never_reads_is_owed_a_bounded_number_of_answers():
    port = PtyPort()
    client = opened(port)
    for _ in range(100):
        port.write(bytes(4096), answer=True)
    assert port.dropped_frames >= 80
    assert len(read_all(port, client)) % 4096 == 0
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
