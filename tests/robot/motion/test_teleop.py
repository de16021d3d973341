"""A held key drives; a key let go of, or a lost terminal, soon means: stand."""

import os
import pty
import threading

import pytest

from lemtomap.errors import BadSetting
from lemtomap.robot.motion.teleop import (
    REST,
    KeyListener,
    Keys,
    TeleopConfig,
    driven_by_hand,
)
from lemtomap.types import Twist


def test_a_key_drives_as_long_as_it_repeats_and_then_the_robot_stands():
    keys = Keys()
    for step in range(10):
        keys.press("w", step * 0.5)
        assert keys.wish(step * 0.5 + 0.45).v_mps > 0
    assert keys.wish(4.51 + keys.config.hold_s) == REST


def test_the_last_key_wins_and_space_stops_at_once():
    keys = Keys()
    keys.press("w", 0.0)
    keys.press("\x1b[D", 0.1)
    assert keys.wish(0.2) == Twist(0.0, 0.9)
    keys.press("x", 0.25)
    assert keys.wish(0.3) == Twist(0.0, 0.9)
    keys.press(" ", 0.35)
    assert keys.wish(0.36) == REST


def test_nobody_drives_without_a_terminal(monkeypatch):
    monkeypatch.setattr("sys.stdin.isatty", lambda: False, raising=False)
    with (
        pytest.raises(BadSetting, match="terminal"),
        driven_by_hand(KeyListener(lambda *_: None, lambda _: None, lambda: None), lambda: 0.0),
    ):
        pass


def test_a_digit_tells_the_level_and_q_ends(monkeypatch):
    ours, theirs = pty.openpty()
    heard, wishes, ended = [], [], threading.Event()
    with os.fdopen(theirs, "r") as terminal:
        monkeypatch.setattr("sys.stdin", terminal)
        listener = KeyListener(lambda wish, _: wishes.append(wish), heard.append, ended.set)
        with driven_by_hand(listener, lambda: 0.0):
            os.write(ours, b"w2q")
            assert ended.wait(10.0)
    os.close(ours)
    assert heard == [2]
    assert set(wishes) <= {REST}  # nothing is driven any more once the end was asked for


def test_arrows_drive_even_when_their_characters_come_at_once(monkeypatch):
    ours, theirs = pty.openpty()
    driven = threading.Event()
    with os.fdopen(theirs, "r") as terminal:
        monkeypatch.setattr("sys.stdin", terminal)

        def offer(wish, _):
            if wish.v_mps > 0.0:
                driven.set()

        with driven_by_hand(KeyListener(offer, lambda _: None, lambda: None), lambda: 0.0):
            os.write(ours, b"\x1b[A")
            assert driven.wait(10.0)
    os.close(ours)


def test_speed_and_hold_are_the_settings():
    keys = Keys(TeleopConfig(forward_mps=0.2, backward_mps=0.05, turn_radps=0.4, hold_s=1.0))
    for key, wish in (("w", (0.2, 0.0)), ("\x1b[B", (-0.05, 0.0)), ("a", (0.0, 0.4)), ("d", (0.0, -0.4))):
        keys.press(key, 5.0)
        twist = keys.wish(5.99)
        assert (twist.v_mps, twist.w_radps) == wish
    assert keys.wish(6.01).w_radps == 0.0
