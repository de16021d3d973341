"""What can go wrong in the simulator.

SimError
├── BadWorld    a world file or map cannot be used: one line that names file, place and reason
└── Unplugged   the cable of an in-memory port is out (an OSError, as a real port would give)
"""

import errno


class SimError(Exception):
    """Root of the tree."""


class BadWorld(SimError):
    """A world cannot be built; the text is one line: file, place, reason."""


class Unplugged(SimError, OSError):
    """The cable is out: bytes flow in neither direction until it is replugged."""

    def __init__(self, port: str) -> None:
        super().__init__(errno.ENODEV, f"{port}: cable unplugged")
