"""Unexplored openings of the window: where reachable, seen floor borders on a patch of unseen floor."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lemtomap.nav.costmap import Costs
from lemtomap.nav.explore import kernels
from lemtomap.nav.metric import Reach

JOIN_CELLS = 2
"""Frontier cells this near to each other belong to one opening."""
NEAR_CELLS = 4
"""Remembered ground is drawn this much too large; new ground begins beyond."""
JUDGED_M = 0.5
"""Nearer to the window's border than this nothing is said about an opening."""


@dataclass(frozen=True, slots=True)
class Opening:
    """One opening seen in the window now."""

    p_grid: tuple[float, float]
    """Metres: the frontier cell nearest to the middle of the opening."""
    yaw_grid_rad: float
    """Towards the unknown."""
    size_m: float


def unseen_patches(seen: NDArray[np.uint8], resolution_m: float, least_depth_m: float) -> NDArray[np.uint8]:
    """Return uint8 (rows, cols), 1 on unseen ground that holds a square of twice least_depth_m.

    seen: uint8 (rows, cols), 1 where the ground is known or was known once.
    """
    return np.asarray(kernels.large_unknown(seen, max(1, round(least_depth_m / resolution_m))))


def still_open(costs: Costs, large: NDArray[np.uint8], p_grid: ArrayLike) -> bool:
    """Tell whether an opening at a place of the window still may lead to unseen ground."""
    if not costs.holds(p_grid, JUDGED_M):
        return True
    return bool(kernels.dark_in_sight(costs.state, large, *costs.cell(p_grid), NEAR_CELLS + 2.0))


def find_openings(reach: Reach, large: NDArray[np.uint8], least_size_m: float) -> list[Opening]:
    """Return the openings of the window onto large unseen patches."""
    res = reach.costs.resolution_m
    mask = kernels.frontier_cells(reach.level, reach.costs.state, large, NEAR_CELLS)
    label = np.zeros(mask.shape, dtype=np.int32)
    count = kernels.label_clusters(mask, label, JOIN_CELLS)
    rows, cols = np.nonzero(label)
    of = label[rows, cols]
    found = []
    for number in range(1, count + 1):
        members = of == number
        size_m = float(members.sum()) * res
        if size_m >= least_size_m:
            found.append(_opening(rows[members], cols[members], size_m, large, reach))
    return found


def _opening(
    rows: NDArray[np.intp], cols: NDArray[np.intp], size_m: float, large: NDArray[np.uint8], reach: Reach
) -> Opening:
    costs = reach.costs
    middle = np.argmin(np.hypot(rows - rows.mean(), cols - cols.mean()))
    row, col = int(rows[middle]), int(cols[middle])
    r0, c0 = max(0, row - 6), max(0, col - 6)
    dark_rows, dark_cols = np.nonzero(large[r0 : row + 7, c0 : col + 7])
    dy, dx = (dark_rows + r0 - row).sum(), (dark_cols + c0 - col).sum()
    place = costs.to_grid(np.array([[row + 0.5, col + 0.5]]))[0]
    return Opening((float(place[0]), float(place[1])), float(np.arctan2(dy, dx)), size_m)
