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
from lemtomap.settings import within
from lemtomap.types import Twist

HELP = "arrow keys or w a s d drive, space stops, a digit: on that floor now, q ends"

KEY = re.compile(r"\x1b\[.|.", re.DOTALL)
DIGITS = "0123456789"

REST = Twist()


@dataclass(frozen=True, slots=True)
class TeleopConfig:
    """How fast a person drives by the keyboard."""

    forward_mps: float = within(0.3, 0.02, 0.65)  # a walking pace that a person can follow
    backward_mps: float = within(0.15, 0.02, 0.2)  # half as fast: nobody sees behind
    turn_radps: float = within(0.9, 0.1, 1.9)
    hold_s: float = within(0.6, 0.2, 2.0)
    """A held key repeats after up to half a second; then the robot stops by itself."""
    repeat_s: float = within(0.1, 0.02, 0.3)  # between two wishes, well within the mux's 0.5 s


def wishes_of(config: TeleopConfig) -> dict[str, Twist]:
    """Return what each key asks for."""
    forward, back = Twist(config.forward_mps, 0.0), Twist(-config.backward_mps, 0.0)
    left, right = Twist(0.0, config.turn_radps), Twist(0.0, -config.turn_radps)
    letters = {"w": forward, "s": back, "a": left, "d": right, " ": REST}
    return letters | {"\x1b[A": forward, "\x1b[B": back, "\x1b[D": left, "\x1b[C": right}


class Keys:
    """Turns key presses into wishes: the last key holds for a moment, then the wish is to stand."""

    def __init__(self, config: TeleopConfig | None = None) -> None:
        self.config = config or TeleopConfig()
        self._wishes = wishes_of(self.config)
        self._wish = REST
        self._pressed_s = -self.config.hold_s

    def press(self, key: str, now_s: float) -> None:
        """Take a key; unknown ones mean nothing."""
        if key in self._wishes:
            self._wish, self._pressed_s = self._wishes[key], now_s

    def wish(self, now_s: float) -> Twist:
        """Return what the person wants now."""
        return self._wish if now_s - self._pressed_s < self.config.hold_s else REST


@dataclass(frozen=True, slots=True)
class KeyListener:
    """Who hears what the person at the keyboard wants."""

    offer: Callable[[Twist, float], None]
    """Takes a wished velocity and the time, s."""
    change_level: Callable[[int], None]
    """Takes the level on which the robot is now."""
    end: Callable[[], None]


@contextmanager
def driven_by_hand(
    listener: KeyListener, now_s: Callable[[], float], config: TeleopConfig | None = None
) -> Iterator[None]:
    """Pass on what the terminal says while the body runs. Raises BadSetting without a terminal."""
    if not sys.stdin.isatty():
        raise BadSetting("teleop: needs a terminal to read keys from")
    terminal = sys.stdin.fileno()
    before = termios.tcgetattr(terminal)
    stop = threading.Event()

    def read() -> None:
        keys = Keys(config)
        while not stop.is_set():
            for key in _keys_pressed(terminal, keys.config.repeat_s):
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
