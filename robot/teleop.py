"""Driving by hand from the keyboard, through the same velocity chain and safety gate as everything else."""

import select
import sys
import termios
import threading
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from lemtomap.errors import BadSetting
from lemtomap.types import Twist

FORWARD_MPS, TURN_RADPS = 0.3, 0.9  # a walking pace that a person can follow
HOLD_S = 0.6  # a held key repeats after up to half a second; then the robot stops by itself
REPEAT_S = 0.1
HELP = "arrow keys or w a s d drive, space stops, q ends"

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


@contextmanager
def driven_by_hand(
    offer: Callable[[Twist, float], None], now_s: Callable[[], float], end: Callable[[], None]
) -> Iterator[None]:
    """Read the terminal while the body runs and offer the wishes. Raises BadSetting without a terminal."""
    if not sys.stdin.isatty():
        raise BadSetting("teleop: needs a terminal to read keys from")
    before = termios.tcgetattr(sys.stdin)
    stop = threading.Event()

    def read() -> None:
        keys = Keys()
        while not stop.is_set():
            key = _next_key(REPEAT_S)
            if key == "q":
                end()
                return
            keys.press(key, now_s())
            offer(keys.wish(now_s()), now_s())

    reader = threading.Thread(target=read, name="keys", daemon=True)
    tty.setcbreak(sys.stdin)
    reader.start()
    try:
        yield
    finally:
        stop.set()
        reader.join(1.0)
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)


def _next_key(timeout_s: float) -> str:
    """Return a key, an arrow's three characters as one; empty when none was pressed in time."""
    if not select.select([sys.stdin], [], [], timeout_s)[0]:
        return ""
    key = sys.stdin.read(1)
    if key == "\x1b" and select.select([sys.stdin], [], [], 0.02)[0]:
        key += sys.stdin.read(2)
    return key
