"""How far each cell of a window is from the nearest obstacle, and which obstacle that is."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Cells = NDArray[np.int8]
FAR = 1 << 14  # cells; further than any window is wide


@njit(nogil=True, cache=True)
def nearest_obstacles(
    occupancy: Cells, occupied_from: int
) -> tuple[NDArray[np.int16], NDArray[np.int16], NDArray[np.float32]]:
    """Return the steps to each cell's nearest obstacle, in rows and columns, and their length, in cells.

    Two sweeps over the vectors (Danielsson 1980), right to a part of a cell. FAR where there is no obstacle.
    """
    rows, cols = occupancy.shape
    dr = np.full((rows, cols), FAR, dtype=np.int16)
    dc = np.full((rows, cols), FAR, dtype=np.int16)
    square = np.full((rows, cols), 2 * FAR * FAR, dtype=np.int64)
    for r in range(rows):
        for c in range(cols):
            if occupancy[r, c] >= occupied_from:
                dr[r, c] = dc[r, c] = square[r, c] = 0
    for sweep in range(2):
        sign = 1 if sweep == 0 else -1
        for i in range(rows):
            r = i if sweep == 0 else rows - 1 - i
            near = r - sign
            if 0 <= near < rows:
                for c in range(cols):
                    for side in range(-1, 2):
                        k = c + side
                        if k < 0 or k >= cols or square[near, k] >= FAR * FAR:
                            continue
                        a, b = int(dr[near, k]) - sign, int(dc[near, k]) + side
                        if a * a + b * b < square[r, c]:
                            dr[r, c], dc[r, c], square[r, c] = a, b, a * a + b * b
            for c in range(1, cols):
                if square[r, c - 1] < FAR * FAR:
                    a, b = int(dr[r, c - 1]), int(dc[r, c - 1]) - 1
                    if a * a + b * b < square[r, c]:
                        dr[r, c], dc[r, c], square[r, c] = a, b, a * a + b * b
            for c in range(cols - 2, -1, -1):
                if square[r, c + 1] < FAR * FAR:
                    a, b = int(dr[r, c + 1]), int(dc[r, c + 1]) + 1
                    if a * a + b * b < square[r, c]:
                        dr[r, c], dc[r, c], square[r, c] = a, b, a * a + b * b
    return dr, dc, np.sqrt(square.astype(np.float64)).astype(np.float32)
