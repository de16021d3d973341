"""What can go wrong in the simulator.

SimError
├── BadWorld    a world file or map cannot be used: one line that names file, place and reason
├── NoPhysics   pybullet is not installed: tell the user how to get it
└── Unplugged   the cable of an in-memory port is out (an OSError, as a real port would give)
"""

import errno
import sys


class SimError(Exception):
    """Root of the tree."""


class BadWorld(SimError):
    """A world cannot be built; the text is one line: file, place, reason."""


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
