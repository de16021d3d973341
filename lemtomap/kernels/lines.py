"""Straight lines over a window of cells. Whoever asks whether one is free asks here.

Rows and columns are real numbers: cell [r, c] covers r to r + 1 and c to c + 1. A line is looked at twice in
the length of a cell, and at both ends.
"""

import math
from typing import Any

from numba import njit
from numpy.typing import NDArray

Array = NDArray[Any]


@njit(nogil=True, cache=True)
def looks(row0: float, col0: float, row1: float, col1: float) -> int:
    """Return in how many equal steps a line is looked at, at least one."""
    return max(1, math.ceil(2.0 * math.hypot(row1 - row0, col1 - col0)))


@njit(nogil=True, cache=True)
def cell_on(row0: float, col0: float, row1: float, col1: float, share: float) -> tuple[int, int]:
    """Return the cell [row, col] under a line at a share of its length; it may lie outside the window."""
    return math.floor(row0 + (row1 - row0) * share), math.floor(col0 + (col1 - col0) * share)


@njit(nogil=True, cache=True)
def first_on_line(
    layer: Array, row0: float, col0: float, row1: float, col1: float, least: float, outside: float
) -> float:
    """Return the share of a line, 0 to 1, at which the layer first is at least `least`; inf where it is free.

    outside: what is beyond the border of the layer.
    """
    rows, cols = layer.shape
    steps = looks(row0, col0, row1, col1)
    for k in range(steps + 1):
        r, c = cell_on(row0, col0, row1, col1, k / steps)
        here = 1.0 * layer[r, c] if 0 <= r < rows and 0 <= c < cols else outside
        if here >= least:
            return k / steps
    return math.inf
