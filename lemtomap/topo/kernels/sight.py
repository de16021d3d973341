"""Straight lines over a window: may the robot drive along one, is it seen along one."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

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
    lies within `radius` of it.
    """
    rows, cols = occupancy.shape
    length = math.hypot(x1 - x0, y1 - y0)
    steps = max(1, math.ceil(2.0 * length / resolution))
    reach = math.ceil(radius / resolution)
    reach_sq = (radius / resolution) ** 2
    last_row, last_col = -1, -1
    for k in range(steps + 1):
        col = math.floor((x0 + (x1 - x0) * k / steps) / resolution)
        row = math.floor((y0 + (y1 - y0) * k / steps) / resolution)
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
    rows, cols = occupancy.shape
    steps = max(1, math.ceil(2.0 * math.hypot(x1 - x0, y1 - y0) / resolution))
    for k in range(steps + 1):
        col = math.floor((x0 + (x1 - x0) * k / steps) / resolution)
        row = math.floor((y0 + (y1 - y0) * k / steps) / resolution)
        if 0 <= row < rows and 0 <= col < cols and occupancy[row, col] >= occupied_from:
            return False
    return True
