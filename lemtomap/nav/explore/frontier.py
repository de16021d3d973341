"""Unexplored openings of the window: where a way leads from reachable, seen floor to a patch of unseen."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lemtomap.nav.explore.ground import Ground
from lemtomap.nav.kernels import explore as kernels
from lemtomap.nav.motion.metric import Reach

JOIN_CELLS = 2
"""Frontier cells this near to each other belong to one opening."""


@dataclass(frozen=True, slots=True)
class Opening:
    """One opening seen in the window now."""

    p_grid: tuple[float, float]
    """Metres: the frontier cell nearest to the middle of the opening."""
    yaw_grid_rad: float
    """Towards the unknown."""
    size_m: float


def find_openings(ground: Ground, least_size_m: float) -> list[Opening]:
    """Return the openings of the window onto large unseen patches."""
    reach, leads = ground.reach, ground.leads
    res = reach.costs.resolution_m
    mask = kernels.frontier_cells(reach.level, reach.costs.state, leads)
    label = np.zeros(mask.shape, dtype=np.int32)
    count = kernels.label_clusters(mask, label, JOIN_CELLS)
    rows, cols = np.nonzero(label)
    of = label[rows, cols]
    found = []
    for number in range(1, count + 1):
        members = of == number
        size_m = float(members.sum()) * res
        if size_m >= least_size_m:
            found.append(_opening(rows[members], cols[members], size_m, leads, reach))
    return found


def _opening(
    rows: NDArray[np.intp], cols: NDArray[np.intp], size_m: float, leads: NDArray[np.uint8], reach: Reach
) -> Opening:
    costs = reach.costs
    middle = np.argmin(np.hypot(rows - rows.mean(), cols - cols.mean()))
    row, col = int(rows[middle]), int(cols[middle])
    r0, c0 = max(0, row - 6), max(0, col - 6)
    dark_rows, dark_cols = np.nonzero(leads[r0 : row + 7, c0 : col + 7])
    dy, dx = (dark_rows + r0 - row).sum(), (dark_cols + c0 - col).sum()
    place = costs.to_grid(np.array([[row + 0.5, col + 0.5]]))[0]
    return Opening((float(place[0]), float(place[1])), float(np.arctan2(dy, dx)), size_m)
