"""Straight lines over a window, in metres: may the robot drive along one, is it seen along one."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lemtomap.kernels.lines import cell_on, first_on_line, looks

Cells = NDArray[np.int8]


@njit(nogil=True, cache=True)
def line_is_navigable(
    occupancy: Cells,
    resolution: float,
    x0: float,
    y0: float,
    x1: float,
    y1: float,
    radius: float,
    occupied_from: int,
) -> bool:
    """Return True if a disc can go straight from (x0, y0) to (x1, y1); metres from the corner of cell [0, 0].

    Same as a line over the inflated map: every cell under the line is known and free, and no occupied cell
    lies within `radius` of it. A few lines a node are asked for, so that this looks round each rather than
    inflate the window for lines.first_on_line.
    """
    rows, cols = occupancy.shape
    row0, col0, row1, col1 = y0 / resolution, x0 / resolution, y1 / resolution, x1 / resolution
    steps = looks(row0, col0, row1, col1)
    reach = math.ceil(radius / resolution)
    reach_sq = (radius / resolution) ** 2
    last_row, last_col = -1, -1
    for k in range(steps + 1):
        row, col = cell_on(row0, col0, row1, col1, k / steps)
        if row == last_row and col == last_col:
            continue
        last_row, last_col = row, col
        if row < 0 or col < 0 or row >= rows or col >= cols:
            return False
        if occupancy[row, col] < 0:
            return False
        for dr in range(-reach, reach + 1):
            r = row + dr
            if r < 0 or r >= rows:
                continue
            for dc in range(-reach, reach + 1):
                c = col + dc
                if c < 0 or c >= cols or dr * dr + dc * dc > reach_sq:
                    continue
                if occupancy[r, c] >= occupied_from:
                    return False
    return True


@njit(nogil=True, cache=True)
def line_is_clear(
    occupancy: Cells, resolution: float, x0: float, y0: float, x1: float, y1: float, occupied_from: int
) -> bool:
    """Return True if no occupied cell is on the line; unknown cells and those outside do not block sight."""
    line = (y0 / resolution, x0 / resolution, y1 / resolution, x1 / resolution)
    return math.isinf(first_on_line(occupancy, *line, float(occupied_from), -1.0))
