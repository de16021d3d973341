"""Stored places as pictures: what stands where, to hold what the robot sees against one or two of them."""

from dataclasses import dataclass

import numpy as np

from lemtomap.se2 import Pose, inverse
from lemtomap.topo.kernels import fitting
from lemtomap.topo.loops.config import SearchConfig
from lemtomap.topo.loops.matcher import Points, Reference
from lemtomap.topo.loops.places import RASTER_M, LocalSubmap
from lemtomap.types import GridView

BORDER_CELLS = 4  # so that a point beside a place falls off its walls


@dataclass(frozen=True, slots=True)
class Placed:
    """A picture, and where its node stands in the window."""

    picture: Reference
    T_grid_node: Pose


def picture_of(company: LocalSubmap, config: SearchConfig) -> Reference:
    """Return a stored place as the fixed side of a search: walls, and nothing known of the rest."""
    cells = np.floor(company.points_node / RASTER_M).astype(np.int64)
    low = cells.min(axis=0) - BORDER_CELLS
    cols, rows = cells.max(axis=0) - low + BORDER_CELLS + 1
    occupancy = np.full((rows, cols), -1, dtype=np.int8)
    occupancy[cells[:, 1] - low[1], cells[:, 0] - low[0]] = 100
    origin_m = (float(low[0]) * RASTER_M, float(low[1]) * RASTER_M)
    return Reference(GridView(0.0, occupancy, RASTER_M, origin_m), company.points_node, config)


def told_apart(points_grid: Points, one: Placed, other: Placed) -> tuple[int, int]:
    """Count the points of the window that only one of two placed pictures explains: (the one, the other)."""
    sides = []
    for placed in (one, other):
        picture = placed.picture
        frame = np.array([*picture.grid.origin_m, picture.cell_m])
        sides.append((inverse(placed.T_grid_node), picture.field, frame))
    own, alien = fitting.told_apart(np.ascontiguousarray(points_grid), *sides[0], *sides[1])
    return int(own), int(alien)
