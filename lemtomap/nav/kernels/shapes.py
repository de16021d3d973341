"""Shapes of masks: what of them a square fits into, what stays when their edge goes."""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Mask = NDArray[Any]
U1 = NDArray[np.uint8]


@njit(nogil=True, cache=True)
def opened(mask: Mask, side: int) -> Mask:
    """Return bool (rows, cols): what squares of side x side cells, wholly in the mask, cover of it."""
    rows, cols = mask.shape
    corner = np.zeros((rows, cols), np.bool_)  # lower right one of such a square
    wide = np.zeros(cols, np.int32)  # rows in a row, up to this one, with `side` cells left of here
    for r in range(rows):
        length = 0
        for c in range(cols):
            length = length + 1 if mask[r, c] else 0
            wide[c] = wide[c] + 1 if length >= side else 0
            corner[r, c] = wide[c] >= side
    left_up = np.zeros(cols, np.int32)  # rows that the last corner below still covers
    for r in range(rows - 1, -1, -1):
        left = 0
        for c in range(cols - 1, -1, -1):
            if corner[r, c]:
                left_up[c] = side
            if left_up[c] > 0:
                left_up[c] -= 1
                left = side
            corner[r, c] = left > 0
            left -= 1
    return corner


@njit(nogil=True, cache=True)
def eroded(bits: U1, cells: int) -> U1:
    """Return uint8 (rows, cols): 1 where all of `bits` within so many cells, rows and columns, are 1.

    Beyond the border all is 0.
    """
    rows, cols = bits.shape
    out = np.zeros((rows, cols), np.uint8)
    side = 2 * cells + 1
    wide = np.zeros(cols, np.int32)
    for r in range(rows):
        length = 0
        for c in range(cols):
            length = length + 1 if bits[r, c] else 0
            wide[c] = wide[c] + 1 if length >= side else 0
            if wide[c] >= side:
                out[r - cells, c - cells] = 1
    return out
