"""The run's clock: whole nanoseconds of the machine's monotonic clock since the run began.

Whole nanoseconds, so that a recorded time gives back the very same float in a replay.
"""

import time
from typing import Protocol


class Clock(Protocol):
    """What tells the time."""

    def now_s(self) -> float:
        """Return seconds since the run began."""
        ...


class MonotonicClock:
    """The real one."""

    def __init__(self) -> None:
        self._start_ns = time.monotonic_ns()

    def now_s(self) -> float:
        """Return seconds since the run began."""
        return (time.monotonic_ns() - self._start_ns) * 1e-9


def stamp_ns(now_s: float) -> int:
    """Return the whole nanoseconds that gave `now_s`. Holds: stamp_ns(n * 1e-9) == n below 20 days."""
    return round(now_s * 1e9)
