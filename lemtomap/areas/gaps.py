"""Gaps in the walls around the robot, as one look at the window shows them."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lemtomap.areas.config import AreaConfig
from lemtomap.areas.kernels import gaps as kernels
from lemtomap.areas.kernels.clearance import nearest_obstacles
from lemtomap.se2 import Pose
from lemtomap.types import GridView

MOST_GAPS = 64
SKEWED_RAD = (0.25, 1.1)
"""Two gaps with one end in common and this angle between them: the wider is the narrower one, seen askew."""
SHARED_END_M = 0.3  # the thickness of a wall, and the noise of its ends


@dataclass(frozen=True, slots=True)
class WallGap:
    """Free floor between two obstacles, wider on both sides."""

    ends_grid: NDArray[np.float64]
    """float64 (2, 2), metres, grid frame."""
    width_m: float
    """From face to face."""
    opens: float
    """How many times the clearance grows, on the side where it grows less."""
    wall_m: float
    """How far the wall goes on from the gap, at the end where it is shorter."""

    @property
    def T_grid_gap(self) -> Pose:  # noqa: N802 - a frame's name
        """Pose of the middle, x along the normal, float64 (3,)."""
        (x0, y0), (x1, y1) = self.ends_grid.tolist()
        yaw_rad = math.atan2(y1 - y0, x1 - x0) - 0.5 * math.pi
        return np.array([0.5 * (x0 + x1), 0.5 * (y0 + y1), math.remainder(yaw_rad, 2.0 * math.pi)])

    def is_door(self, config: AreaConfig) -> bool:
        """Return True if its width is a door's."""
        return config.door_least_m <= self.width_m <= config.door_most_m

    def parts(self, config: AreaConfig) -> bool:
        """Return True if it parts two areas: its ends are walls, and what is no door opens the more."""
        is_walled = self.wall_m >= config.wall_least_m
        return is_walled and (self.is_door(config) or self.opens >= config.narrow_opens)


def gaps_around(grid: GridView, T_grid_base: Pose, occupied_from: int, config: AreaConfig) -> list[WallGap]:
    """Return the doors and narrow places around the robot, narrowest first."""
    rows, cols = grid.occupancy.shape
    step, (left, low) = grid.resolution_m, grid.origin_m
    reach = round(config.look_radius_m / step)
    col, row = int((T_grid_base[0] - left) / step), int((T_grid_base[1] - low) / step)
    first_row, first_col = max(0, row - reach), max(0, col - reach)
    cells = grid.occupancy[first_row : min(rows, row + reach), first_col : min(cols, col + reach)]
    if min(cells.shape) < 3:
        return []
    cells = np.ascontiguousarray(cells)
    found = np.zeros((MOST_GAPS, kernels.FIELDS))
    count = kernels.find_gaps(
        cells,
        *nearest_obstacles(cells, occupied_from),
        step,
        occupied_from,
        config.door_least_m,
        config.narrow_most_m,
        config.depth_m,
        config.opens,
        found,
    )
    corner = np.array([left + (first_col + 0.5) * step, low + (first_row + 0.5) * step])
    gaps = [_gap(row, corner, step) for row in found[:count]]
    kept: list[WallGap] = []
    for gap in sorted(gaps, key=lambda gap: gap.width_m):
        if gap.parts(config) and not any(_is_askew(gap, other) for other in kept):
            kept.append(gap)
    return kept


def _gap(row: NDArray[np.float64], corner: NDArray[np.float64], step: float) -> WallGap:
    ends = corner + step * row[:4].reshape(2, 2)[:, ::-1]
    return WallGap(ends, float(row[4] * step), float(min(row[5], row[6])), float(min(row[7], row[8]) * step))


def _is_askew(gap: WallGap, other: WallGap) -> bool:
    apart = np.linalg.norm(gap.ends_grid[:, None] - other.ends_grid[None], axis=2)
    turn = abs(math.remainder(gap.T_grid_gap[2] - other.T_grid_gap[2], math.pi))
    return bool(apart.min() < SHARED_END_M) and SKEWED_RAD[0] < turn < SKEWED_RAD[1]
