"""A door leaf that slides along its wall, by a timetable or at random, and opens for a robot in its way."""

import math
from dataclasses import dataclass

import numpy as np

from lemtomap.sim.world import Box, Motion, Pose2, Surface

SLIDE_MPS = 0.5
THICK_M = 0.04
IN_THE_WAY_M = 0.30  # robot's middle to the leaf's line: its radius, half the leaf and a hand


@dataclass(frozen=True, slots=True)
class SlidingDoor:
    """A leaf between two jambs; open, it stands beside the second one."""

    ends: tuple[tuple[float, float], tuple[float, float]]
    """The jambs, metres."""
    open_during: tuple[tuple[float, float], ...] = ()
    """Seconds from and to which it is open; without any it changes at random."""
    mean_s: float = 60.0
    """Time between two changes at random, on average."""

    @property
    def width_m(self) -> float:
        """Clear width."""
        return math.dist(*self.ends)

    @property
    def parts(self) -> tuple[Box, ...]:
        """Return the leaf, the first jamb at the origin, along x."""
        half = self.width_m / 2
        return (Box((half, 0.0, 1.0), (half - 0.01, THICK_M / 2, 1.0), surface=Surface.WALL),)

    def begin(self, seed: int) -> Motion:
        """Start shut, or as the timetable says."""
        return _Sliding(self, np.random.default_rng(seed))


class _Sliding:
    def __init__(self, door: SlidingDoor, rng: np.random.Generator) -> None:
        self._door, self._rng = door, rng
        (x0, y0), (x1, y1) = door.ends
        self._ux, self._uy = (x1 - x0) / door.width_m, (y1 - y0) / door.width_m
        self._random_open = bool(rng.integers(2))
        self._change_s = float(rng.exponential(door.mean_s))
        self._open_m = door.width_m if self._is_open(0.0) else 0.0

    def _is_open(self, now_s: float) -> bool:
        if self._door.open_during:
            return any(begin <= now_s < end for begin, end in self._door.open_during)
        while now_s >= self._change_s:
            self._random_open = not self._random_open
            self._change_s += float(self._rng.exponential(self._door.mean_s))
        return self._random_open

    def step(self, now_s: float, dt_s: float, robot: Pose2) -> Pose2:
        opens = self._is_open(now_s) or self._is_in_the_way(robot)
        change = (1.0 if opens else -1.0) * SLIDE_MPS * dt_s
        self._open_m = min(max(self._open_m + change, 0.0), self._door.width_m)
        x, y = self._door.ends[0]
        return x + self._ux * self._open_m, y + self._uy * self._open_m, math.atan2(self._uy, self._ux)

    def _is_in_the_way(self, robot: Pose2) -> bool:
        """Return True if the robot stands in the doorway, where a shutting leaf would press on it."""
        dx, dy = robot[0] - self._door.ends[0][0], robot[1] - self._door.ends[0][1]
        along, off = dx * self._ux + dy * self._uy, abs(dx * self._uy - dy * self._ux)
        return off < IN_THE_WAY_M and -IN_THE_WAY_M < along < self._door.width_m + IN_THE_WAY_M
