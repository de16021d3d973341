"""What is indoors on a plan: where walls stand all round."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

ALL_ROUND = 7  # of eight directions: one may lead out through a door or along a corridor


def walls_around(wall: NDArray[np.bool_], floor: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Return in how many of eight directions floor meets a wall before unknown ground or the plan's edge.

    Arrays (rows, cols); 0 where there is no floor. Outside a house it is four or five.
    """
    thick = ndimage.binary_dilation(wall)  # a diagonal line of cells would let diagonals through
    around = np.zeros(wall.shape, dtype=np.uint8)
    for flip in (slice(None), slice(None, None, -1)):
        for shift in (-1, 0, 1):
            around[flip] += _ends_at_wall(thick[flip], floor[flip], shift)
        around.T[flip] += _ends_at_wall(thick.T[flip], floor.T[flip], 0)
    return np.where(floor, around, 0).astype(np.uint8)


def _ends_at_wall(wall: NDArray[np.bool_], floor: NDArray[np.bool_], shift: int) -> NDArray[np.bool_]:
    """Return from which cells the way of growing rows, `shift` columns a row, leads over floor to a wall."""
    met = wall.copy()
    for row in range(len(wall) - 2, -1, -1):
        met[row] |= floor[row] & _shifted(met[row + 1], shift)
    return met


def _shifted(line: NDArray[np.bool_], shift: int) -> NDArray[np.bool_]:
    """Return a line whose cell i is cell i + shift of the old, False beyond its ends."""
    moved = np.zeros_like(line)
    if shift > 0:
        moved[:-shift] = line[shift:]
    elif shift < 0:
        moved[-shift:] = line[:shift]
    else:
        moved[:] = line
    return moved
