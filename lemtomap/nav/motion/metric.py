"""The metric planner: what of the window the robot can reach, and the cost-to-go to a target in it.

Far plans cover the window and are made now and then. Near plans cover a few metres around the robot and are
made often: what lies beyond their border is worth what the last far plan says.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lemtomap.nav.kernels import fields as kernels
from lemtomap.nav.motion.costmap import Costs
from lemtomap.nav.types import Points

USUAL_TOP = 25.0  # price of a cell that few windows go beyond: the kernel lays out buckets for it at least
FIELD_MARGIN_M = 1.5
"""The field is also known this much cost beyond the robot, for trajectories that start by leading away."""


@dataclass(frozen=True, slots=True)
class Reach:
    """Which cells the robot can come to."""

    costs: Costs
    level: NDArray[np.uint8]
    """uint8 (rows, cols): 0 no, 1 over seen floor, 2 only over unseen floor."""
    start: tuple[float, float]
    """(row, col) as real numbers of the robot."""

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
    level = kernels.flood(costs.cost, costs.state, int(np.floor(row)), int(np.floor(col)), queue)
    return Reach(costs, level, (row, col))


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


def plan_near(near: Costs, far: MetricPlan, p_robot_grid: ArrayLike) -> MetricPlan | None:
    """Return the way to the far plan's target through newer costs around the robot, or None if there is none.

    near: a part of the window on the cells of the far plan's, with the robot inside.
    """
    seeds, values = _border(near, far)
    if not seeds.size:
        return None
    row, col = near.cell(p_robot_grid)
    stop = int(np.floor(row)) * near.state.shape[1] + int(np.floor(col))
    margin = FIELD_MARGIN_M / near.resolution_m
    field = kernels.march(near.cost, seeds, values, stop, margin, top_cost(near))
    if not np.isfinite(field[int(np.floor(row)), int(np.floor(col))]):
        return None
    path = near.to_grid(kernels.descend(field, row, col, 1.0, 2 * sum(near.state.shape)))
    beyond = kernels.descend(far.field, *far.costs.cell(path[-1]), 1.0, 2 * sum(far.field.shape))
    path = np.vstack([path, far.costs.to_grid(beyond[1:])])
    length = float(np.hypot(*np.diff(path, axis=0).T).sum()) if len(path) > 1 else 0.0
    return MetricPlan(near, field, path, length, far.p_target_grid)


def _border(near: Costs, far: MetricPlan) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the cells where a near plan joins the far one, flat indices (N,), and their cost-to-go (N,).

    These are the border of the near part, and the target if it lies inside.
    """
    rows, cols = near.state.shape
    edge = np.zeros((rows, cols), dtype=bool)
    edge[[0, -1], :] = edge[:, [0, -1]] = True
    r, c = np.nonzero(edge & np.isfinite(near.cost))
    if near.holds(far.p_target_grid):
        row, col = near.cell(far.p_target_grid)
        r, c = np.append(r, int(row)), np.append(c, int(col))
    row0, col0 = (round(v) for v in far.costs.cell(near.origin_m))
    inside = (r + row0 >= 0) & (r + row0 < far.field.shape[0])
    inside &= (c + col0 >= 0) & (c + col0 < far.field.shape[1])
    r, c = r[inside], c[inside]
    value = far.field[r + row0, c + col0].astype(np.float64)
    known = np.isfinite(value)
    return (r * cols + c)[known], value[known]


def top_cost(costs: Costs) -> float:
    """Return the largest finite price of a cell."""
    finite = costs.cost[np.isfinite(costs.cost)]
    return float(max(USUAL_TOP, finite.max() if finite.size else 1.0))
