"""Driving by hand from the keyboard, through the same velocity chain and safety gate as everything else."""

import os
import re
import select
import sys
import termios
import threading
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass

from lemtomap.errors import BadSetting
from lemtomap.types import Twist

FORWARD_MPS, TURN_RADPS = 0.3, 0.9  # a walking pace that a person can follow
HOLD_S = 0.6  # a held key repeats after up to half a second; then the robot stops by itself
REPEAT_S = 0.1
HELP = "arrow keys or w a s d drive, space stops, a digit: on that floor now, q ends"

KEY = re.compile(r"\x1b\[.|.", re.DOTALL)
DIGITS = "0123456789"

REST = Twist()
WISHES = {
    "w": Twist(FORWARD_MPS, 0.0),
    "s": Twist(-FORWARD_MPS / 2, 0.0),
    "a": Twist(0.0, TURN_RADPS),
    "d": Twist(0.0, -TURN_RADPS),
    "\x1b[A": Twist(FORWARD_MPS, 0.0),
    "\x1b[B": Twist(-FORWARD_MPS / 2, 0.0),
    "\x1b[D": Twist(0.0, TURN_RADPS),
    "\x1b[C": Twist(0.0, -TURN_RADPS),
    " ": REST,
}


class Keys:
    """Turns key presses into wishes: the last key holds for a moment, then the wish is to stand."""

    def __init__(self) -> None:
        self._wish = REST
        self._pressed_s = -HOLD_S

    def press(self, key: str, now_s: float) -> None:
        """Take a key; unknown ones mean nothing."""
        if key in WISHES:
            self._wish, self._pressed_s = WISHES[key], now_s

    def wish(self, now_s: float) -> Twist:
        """Return what the person wants now."""
        return self._wish if now_s - self._pressed_s < HOLD_S else REST


@dataclass(frozen=True, slots=True)
class KeyListener:
    """Who hears what the person at the keyboard wants."""

    offer: Callable[[Twist, float], None]
    """Takes a wished velocity and the time, s."""
    change_level: Callable[[int], None]
    """Takes the level on which the robot is now."""
    end: Callable[[], None]


@contextmanager
def driven_by_hand(listener: KeyListener, now_s: Callable[[], float]) -> Iterator[None]:
    """Pass on what the terminal says while the body runs. Raises BadSetting without a terminal."""
    if not sys.stdin.isatty():
        raise BadSetting("teleop: needs a terminal to read keys from")
    terminal = sys.stdin.fileno()
    before = termios.tcgetattr(terminal)
    stop = threading.Event()

    def read() -> None:
        keys = Keys()
        while not stop.is_set():
            for key in _keys_pressed(terminal, REPEAT_S):
                if key == "q":
                    listener.end()
                    return
                if key in DIGITS:
                    listener.change_level(int(key))
                keys.press(key, now_s())
            listener.offer(keys.wish(now_s()), now_s())

    reader = threading.Thread(target=read, name="keys", daemon=True)
    tty.setcbreak(terminal)
    reader.start()
    try:
        yield
    finally:
        stop.set()
        reader.join(1.0)
        with suppress(termios.error):  # the terminal is gone
            termios.tcsetattr(terminal, termios.TCSADRAIN, before)


def _keys_pressed(terminal: int, timeout_s: float) -> list[str]:
    """Return the keys pressed, an arrow's three characters as one; empty when none was in time, `q` when the
    terminal is gone.

    Read past Python's buffer, which would keep from `select` what it holds.
    """
    if not select.select([terminal], [], [], timeout_s)[0]:
        return []
    try:
        pressed = os.read(terminal, 256)
    except OSError:
        pressed = b""
    return KEY.findall(pressed.decode(errors="replace")) or ["q"]
