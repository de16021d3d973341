"""Averaged laser hits around the robot, finer than the window's cells: what places are made of.

A ring of cells with a fixed size, like the window itself: memory is flat, and what the robot left behind is
overwritten by what it meets next.
"""

import math

import numpy as np
from numpy.typing import NDArray

from lemtomap.se2 import Pose
from lemtomap.topo.kernels import gathering
from lemtomap.types import GridView

CELL_M = 0.05  # half a cell of the coded place
LEAST_HITS = 2.0  # one hit alone may be a mixed pixel at an edge
EVERY_M = 0.1  # a scan taken from nearly the same place tells nothing new
EVERY_RAD = 0.1
RECENT_M = 10.0  # of way: so far a window SLAM hardly drifts, and older hits may stand beside newer ones


class HitMap:
    """Mean hit of each cell, in the grid frame."""

    def __init__(self, size_m: float = 24.0, recent_m: float = RECENT_M) -> None:
        cells = 8 * math.ceil(size_m / (8.0 * CELL_M) - 1e-9)
        self._owner = np.full((cells, cells, 2), np.iinfo(np.int32).min, np.int32)
        self._taken = np.zeros((cells, cells), np.int8)
        self._sums = np.zeros((cells, cells, 6))
        self._recent_m = recent_m
        self._way_m = 0.0
        self._last: Pose | None = None

    def add(self, T_grid_base: Pose, points_base: NDArray[np.floating]) -> None:
        """Take in a scan's hits, float (N, 2), metres, base frame, when the robot has moved a little."""
        if self._last is not None:
            dx, dy, turn = (T_grid_base - self._last).tolist()
            step_m = math.hypot(dx, dy)
            if step_m < EVERY_M and 1.0 - math.cos(turn) < 0.5 * EVERY_RAD**2:
                return
            self._way_m += step_m
        self._last = np.array(T_grid_base)
        gathering.add_hits(
            points_base,
            self._last,
            CELL_M,
            self._owner,
            self._taken,
            self._sums,
            self._way_m,
            self._recent_m,
        )

    def around(
        self, centre_m: tuple[float, float], radius_m: float, grid: GridView, occupied_from: int
    ) -> NDArray[np.float64]:
        """Return the hits in a square that the window still believes, float64 (N, 2), grid frame."""
        return self.faces_around(centre_m, radius_m, grid, occupied_from)[:, :2]

    def faces_around(
        self, centre_m: tuple[float, float], radius_m: float, grid: GridView, occupied_from: int
    ) -> NDArray[np.float64]:
        """Return the same hits and from where they were seen, float64 (N, 4): x, y, mean unit vector thither.

        Without any hits (no scan points were given) the boundary cells of the window stand in for them.
        """
        window = (grid.resolution_m, *grid.origin_m)
        if self._last is None:
            return gathering.boundary_cells(grid.occupancy, *window, *centre_m, radius_m, occupied_from)
        return gathering.collect_hits(
            self._owner,
            self._taken,
            self._sums,
            CELL_M,
            *centre_m,
            radius_m,
            LEAST_HITS,
            self._way_m - self._recent_m,
            grid.occupancy,
            *window,
            occupied_from,
        )
