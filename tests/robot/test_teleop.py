"""A held key drives; a key let go of, or a lost terminal, soon means: stand."""

import pytest

from lemtomap.errors import BadSetting
from lemtomap.types import Twist
from robot.teleop import HOLD_S, REST, Keys, driven_by_hand


def test_a_key_drives_as_long_as_it_repeats_and_then_the_robot_stands():
    keys = Keys()
    for step in range(10):
        keys.press("w", step * 0.5)
        assert keys.wish(step * 0.5 + 0.45).v_mps > 0
    assert keys.wish(4.51 + HOLD_S) == REST


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
        driven_by_hand(lambda *_: None, lambda: 0.0, lambda: None),
    ):
        pass
