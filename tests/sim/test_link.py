"""A cable and its two ends, without a world."""

import numpy as np

from sim.faults import LinkFaults
from sim.link import Frame, Link


def cable(now_s: list[float]) -> Link:
    return Link("hokuyo", LinkFaults(), np.random.default_rng(0), lambda: now_s[0])


def test_what_is_under_way_when_the_port_is_closed_reaches_no_later_client():
    now_s = [0.0]
    link = cable(now_s)
    link.deliver(b"old", 0.1, answer=True)
    link.host.hang_up()
    link.deliver(b"new", 0.2)
    now_s[0] = 1.0
    assert link.read_frames() == [Frame(b"new", answer=False)]


def test_the_device_learns_between_which_commands_the_port_was_closed():
    link = cable([0.0])
    link.host.write(b"GD")
    link.host.hang_up()
    link.host.write(b"VV")
    assert link.collect() == [b"GD", None, b"VV"]
    assert link.collect() == []


def test_closing_the_port_makes_room_for_the_next_client():
    now_s = [0.0]
    link = cable(now_s)
    while not link.dropped_bytes:
        link.deliver(bytes(4096), 0.0)
    link.host.hang_up()
    link.deliver(b"new", 0.0)
    assert link.host.read() == b"new"
