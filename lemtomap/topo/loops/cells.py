"""Points thinned out by the cells of a raster."""

import numpy as np
from numpy.typing import NDArray

from lemtomap.topo.loops.descriptor import ROW

Points = NDArray[np.float64]
"""float64 (N, 2), metres."""


def thinned(points: Points, cell_m: float) -> Points:
    """Return the first point of each cell, in their order."""
    cells = np.round(points / cell_m).astype(np.int64)
    _, first = np.unique(cells[:, 0] * ROW + cells[:, 1], return_index=True)
    return np.ascontiguousarray(points[np.sort(first)])


def averaged(points: Points, cell_m: float) -> Points:
    """Return the mean point of each cell."""
    cells = np.floor(points / cell_m).astype(np.int64)
    _, cell, count = np.unique(cells[:, 0] * ROW + cells[:, 1], return_inverse=True, return_counts=True)
    sums = [np.bincount(cell, points[:, axis]) for axis in (0, 1)]
    return np.ascontiguousarray(np.column_stack(sums) / count[:, None])
