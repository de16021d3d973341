"""The metric planner: what of the window the robot can reach, and the cost-to-go to a target in it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lemtomap.nav import kernels
from lemtomap.nav.costmap import TIGHT_COST, Costs
from lemtomap.nav.types import Points

FIELD_MARGIN_M = 1.5
"""The field is also known this much cost beyond the robot, for trajectories that start by leading away."""


@dataclass(frozen=True, slots=True)
class Reach:
    """Which cells the robot can come to."""

    costs: Costs
    level: NDArray[np.uint8]
    """uint8 (rows, cols): 0 no, 1 over seen floor, 2 only over unseen floor."""

    def area_m2(self) -> float:
        """Return how much floor can be reached."""
        return float(np.count_nonzero(self.level)) * self.costs.resolution_m**2

    def nearest(self, p_grid: ArrayLike, within_m: float) -> tuple[int, int, int] | None:
        """Return (row, col, level) of the best reachable cell within a distance of a point, or None.

        A cell over seen floor beats one over unseen floor; then the nearer one wins.
        """
        row, col = self.costs.cell(p_grid)
        rows, cols = self.level.shape
        radius = max(1.0, within_m / self.costs.resolution_m)
        r0, r1 = max(0, int(row - radius)), min(rows, int(row + radius) + 2)
        c0, c1 = max(0, int(col - radius)), min(cols, int(col + radius) + 2)
        if r0 >= r1 or c0 >= c1:
            return None
        patch = self.level[r0:r1, c0:c1]
        dr = np.arange(r0, r1)[:, None] + 0.5 - row
        dc = np.arange(c0, c1)[None, :] + 0.5 - col
        away = np.sqrt(dr * dr + dc * dc)
        price = np.where((patch > 0) & (away <= radius), away + 1e3 * (patch == 2), np.inf)
        best = int(np.argmin(price))
        r, c = divmod(best, price.shape[1])
        if not np.isfinite(price[r, c]):
            return None
        return r0 + r, c0 + c, int(patch[r, c])


@dataclass(frozen=True, slots=True)
class MetricPlan:
    """The way to one target inside the window."""

    costs: Costs
    field: NDArray[np.float32]
    """Cost-to-go in cells; inf where not worked out."""
    path_grid: Points
    """float64 (N, 2), metres, from the robot to the target."""
    length_m: float
    p_target_grid: tuple[float, float]


def reach_from(costs: Costs, p_grid: ArrayLike) -> Reach:
    """Flood the window from the robot's place."""
    row, col = costs.cell(p_grid)
    queue = np.empty(costs.state.size, dtype=np.int32)
    return Reach(costs, kernels.flood(costs.cost, costs.state, int(np.floor(row)), int(np.floor(col)), queue))


def plan_to(costs: Costs, p_robot_grid: ArrayLike, target_cell: tuple[int, int]) -> MetricPlan | None:
    """Return the way from the robot to a cell, or None if there is none. The field is that of the target."""
    row, col = costs.cell(p_robot_grid)
    cols = costs.state.shape[1]
    stop = int(np.floor(row)) * cols + int(np.floor(col))
    seeds = np.array([target_cell[0] * cols + target_cell[1]], dtype=np.int64)
    margin = FIELD_MARGIN_M / costs.resolution_m
    top = top_cost(costs)
    field = kernels.march(costs.cost, seeds, np.zeros(1), stop, margin, top)
    if not np.isfinite(field[int(np.floor(row)), int(np.floor(col))]):
        return None
    path = costs.to_grid(kernels.descend(field, row, col, 1.0, 2 * sum(costs.state.shape)))
    length = float(np.hypot(*np.diff(path, axis=0).T).sum()) if len(path) > 1 else 0.0
    target = costs.to_grid(np.array([[target_cell[0] + 0.5, target_cell[1] + 0.5]]))[0]
    return MetricPlan(costs, field, path, length, (float(target[0]), float(target[1])))


def top_cost(costs: Costs) -> float:
    """Return the largest finite price of a cell."""
    finite = costs.cost[np.isfinite(costs.cost)]
    return float(max(TIGHT_COST, finite.max() if finite.size else 1.0))
