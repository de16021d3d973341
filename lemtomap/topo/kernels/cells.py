"""Points by the cells of a raster."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Values = NDArray[np.float64]
Indices = NDArray[np.int64]


@njit(nogil=True, cache=True)
def first_of_cells(columns: Indices, rows: Indices, by_cell: int) -> Indices:
    """Return the first point of each cell, int64 (M,): in the order of the points, or of columns, then rows.

    columns, rows: int64 (N,), from 0. A raster instead of sorting: linear in points and cells.
    """
    count = columns.shape[0]
    height = rows.max() + 1 if count else 0
    width = columns.max() + 1 if count else 0
    at = np.full(width * height, -1, np.int32)
    out = np.empty(count, np.int64)
    found = 0
    for i in range(count):
        cell = columns[i] * height + rows[i]
        if at[cell] < 0:
            at[cell] = i
            out[found] = i
            found += 1
    if by_cell:
        found = 0
        for cell in range(width * height):
            if at[cell] >= 0:
                out[found] = at[cell]
                found += 1
    return out[:found]


@njit(nogil=True, cache=True)
def means_of_cells(points: Values, columns: Indices, rows: Indices) -> Values:
    """Return the mean point of each cell, float64 (M, 2), by columns, then rows; both int64 (N,), from 0."""
    first = first_of_cells(columns, rows, 1)
    height = rows.max() + 1 if rows.shape[0] else 0
    width = columns.max() + 1 if rows.shape[0] else 0
    slot = np.empty(width * height, np.int32)
    for k in range(first.shape[0]):
        slot[columns[first[k]] * height + rows[first[k]]] = k
    sums, counts = np.zeros((first.shape[0], 2)), np.zeros(first.shape[0])
    for i in range(points.shape[0]):
        k = slot[columns[i] * height + rows[i]]
        sums[k, 0] += points[i, 0]
        sums[k, 1] += points[i, 1]
        counts[k] += 1.0
    for k in range(first.shape[0]):
        sums[k, 0] /= counts[k]
        sums[k, 1] /= counts[k]
    return sums
