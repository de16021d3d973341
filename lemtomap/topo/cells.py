"""Points thinned out by the cells of a raster."""

import numpy as np
from numpy.typing import NDArray

from lemtomap.topo.kernels import cells as kernels

Points = NDArray[np.float64]
"""float64 (N, 2), metres."""
Cells = NDArray[np.int64]
"""int64 (N, 2), column and row of each point."""
ROW = 1 << 20  # cells of one row: no place is 100 km wide
MOST_CELLS = 1 << 20  # of a raster: points scattered more widely are sorted instead


def thinned(points: Points, cell_m: float) -> Points:
    """Return the first point of each cell, in their order."""
    cells = np.round(points / cell_m).astype(np.int64)
    return np.ascontiguousarray(points[first_of(cells)])


def averaged(points: Points, cell_m: float) -> Points:
    """Return the mean point of each cell."""
    cells = np.floor(points / cell_m).astype(np.int64)
    if (raster := _raster(cells)) is not None:
        return np.asarray(kernels.means_of_cells(points, *raster))
    _, cell, count = np.unique(cells[:, 0] * ROW + cells[:, 1], return_inverse=True, return_counts=True)
    sums = [np.bincount(cell, points[:, axis]) for axis in (0, 1)]
    return np.ascontiguousarray(np.column_stack(sums) / count[:, None])


def first_of(cells: Cells, *, by_cell: bool = False) -> NDArray[np.int64]:
    """Return which point is the first of each cell: in the order of the points, or of the cells.

    Cells are ordered by column, then row.
    """
    if (raster := _raster(cells)) is not None:
        return np.asarray(kernels.first_of_cells(*raster, int(by_cell)))
    _, first = np.unique(cells[:, 0] * ROW + cells[:, 1], return_index=True)
    return np.asarray(first if by_cell else np.sort(first))


def _raster(cells: Cells) -> tuple[NDArray[np.int64], NDArray[np.int64]] | None:
    """Return columns and rows from 0; None for points none or scattered so widely that sorting is better."""
    if len(cells) == 0:
        return None
    within = cells - cells.min(axis=0)
    cols, rows = (within.max(axis=0) + 1).tolist()
    return (within[:, 0], within[:, 1]) if cols * rows <= MOST_CELLS else None
