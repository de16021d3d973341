"""What can go wrong in the simulator.

SimError
├── BadWorld    a world file or map cannot be used: one line that names file, place and reason
│   └── BadStart    only the place to start in cannot be used
├── NoPhysics   pybullet is not installed: tell the user how to get it
└── Unplugged   the cable of an in-memory port is out (an OSError, as a real port would give)
"""

import errno
import sys

LONGEST = 400  # characters of a message; what a damaged file holds may be a megabyte


class SimError(Exception):
    """Root of the tree."""


class BadWorld(SimError):
    """A world cannot be built; the text is one line of plain characters: file, place, reason."""

    def __init__(self, text: str) -> None:
        super().__init__(one_line(text))


class BadStart(BadWorld):
    """The pose to start at overlaps a wall or furniture, or lies outside."""


class NoPhysics(SimError):
    """The physics engine is missing; the text is its cure."""

    def __init__(self) -> None:
        wheels = f" (made for Python 3.11; this is {sys.version_info[0]}.{sys.version_info[1]})"
        super().__init__(
            f"the simulator needs pybullet{wheels if sys.version_info >= (3, 12) else ''}: "
            "pip install 'lemtomap[sim]', or in a checkout: pip install '.[sim]'"
        )


class Unplugged(SimError, OSError):
    """The cable is out: bytes flow in neither direction until it is replugged."""

    def __init__(self, port: str) -> None:
        super().__init__(errno.ENODEV, f"{port}: cable unplugged")


def one_line(text: str) -> str:
    """Return a text without line ends and control characters, not longer than a person reads."""
    plain = "".join(c if c.isprintable() else " " if c.isspace() else repr(c)[1:-1] for c in text)
    return plain if len(plain) <= LONGEST else f"{plain[: LONGEST - 4]} ..."


def shown(value: object) -> str:
    """Return a value as text for a message; a number may have too many digits to be written."""
    try:
        return repr(value)
    except ValueError:
        return "a number of thousands of digits"
