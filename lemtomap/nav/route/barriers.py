"""What bars the route: edges whose far end the window shows but cannot reach; long ways round shut doors."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from lemtomap.kernels.lines import first_on_line
from lemtomap.nav.kernels import fields as kernels
from lemtomap.nav.motion.costmap import Costs
from lemtomap.nav.motion.metric import Reach, reach_from
from lemtomap.nav.route.planner import Route
from lemtomap.nav.route.sliding import BORDER_M, SNAP_M
from lemtomap.nav.types import Goal
from lemtomap.se2 import Pose

DETOUR_SHARE = 1.3  # ... and
DETOUR_M = 1.5
"""A way this much longer than the edges it follows leads round something."""
BESIDE_M = 0.75
"""What lets the robot pass this near to the edge is a post, or a ghost of the laser; a shut door does not."""


@dataclass(frozen=True, slots=True)
class Barrier:
    """An edge of the route whose far end the window shows but cannot reach."""

    index: int
    """Of the edge in the route."""
    edge_id: int
    p_near_grid: tuple[float, float]
    p_middle_grid: tuple[float, float]
    """Where something stands on its line; half-way between its ends if nothing does."""


def find_barrier(route: Route, T_grid_node: Mapping[int, Pose], reach: Reach, beyond: int) -> Barrier | None:
    """Return the first edge after route index `beyond` whose far end is in the window but out of reach.

    An end that only a way over unseen floor might lead to is out of reach when something stands on the edge
    and fills it from side to side.
    A goal beside its node that is out of reach says nothing about the edge to the node.
    """
    for index in range(beyond, len(route.nodes) - 1):
        near, far = (T_grid_node.get(route.nodes[end]) for end in (index, index + 1))
        if near is None or far is None or not reach.costs.holds(far, BORDER_M):
            return None
        found = reach.nearest(far, SNAP_M)
        if found is None or (found[2] == 2 and _is_filled(reach.costs, near, far)):
            return _barrier(route, index, near, far, reach.costs)
        if found[2] == 2:
            return None
    return None


def _is_filled(costs: Costs, p_a_grid: Pose, p_b_grid: Pose) -> bool:
    """Return True if something stands on the line from a to b and nothing beside it lets the robot by."""
    if cut_at(costs, p_a_grid, p_b_grid) is None:
        return False
    rows, cols = costs.state.shape
    (row0, col0), (row1, col1) = costs.cell(p_a_grid), costs.cell(p_b_grid)
    along = np.array([row1 - row0, col1 - col0])
    down, right = np.arange(rows)[:, None] + 0.5 - row0, np.arange(cols)[None, :] + 0.5 - col0
    share = np.clip((down * along[0] + right * along[1]) / max(float(along @ along), 1e-9), 0.0, 1.0)
    aside_m = np.hypot(down - share * along[0], right - share * along[1]) * costs.resolution_m
    beside = replace(costs, cost=np.where(aside_m <= BESIDE_M, costs.cost, np.float32(np.inf)))
    start = Reach(beside, np.isfinite(beside.cost).astype(np.uint8), (row0, col0)).nearest(p_a_grid, SNAP_M)
    if start is None:
        return True
    from_a = reach_from(beside, costs.to_grid(np.array([start[:2]]) + 0.5)[0])
    return from_a.nearest(p_b_grid, SNAP_M) is None


def cut_at(costs: Costs, p_a_grid: ArrayLike, p_b_grid: ArrayLike) -> tuple[float, float] | None:
    """Return where on the line from a to b, both in the window, the first obstacle stands, metres."""
    (row0, col0), (row1, col1) = costs.cell(p_a_grid), costs.cell(p_b_grid)
    share = first_on_line(costs.state, row0, col0, row1, col1, kernels.LETHAL, kernels.UNKNOWN)
    if math.isinf(share):
        return None
    stands = np.array([[row0 + (row1 - row0) * share, col0 + (col1 - col0) * share]])
    x, y = costs.to_grid(stands)[0]
    return float(x), float(y)


def find_detour(
    route: Route, goal: Goal, T_grid_node: Mapping[int, Pose], costs: Costs, upto: int, way_m: float
) -> Barrier | None:
    """Return the first edge before route index `upto` that something cuts, if that makes the way a detour.

    way_m: the way to the place at `upto` through the window. A chair in the corridor makes no detour; a shut
    door does, even where the window shows another way round.
    """
    route_m = sum(edge.length_m for edge in route.edges[:upto])
    if upto == len(route.nodes) - 1:
        route_m += math.hypot(*goal.p_node)
    if way_m < DETOUR_SHARE * route_m + DETOUR_M:
        return None
    for index in range(upto):
        near, far = (T_grid_node.get(route.nodes[end]) for end in (index, index + 1))
        if near is None or far is None or not (costs.holds(near) and costs.holds(far)):
            continue
        if not costs.fits_between(near, far):
            return _barrier(route, index, near, far, costs)
    return None


def _barrier(route: Route, index: int, near: Pose, far: Pose, costs: Costs) -> Barrier:
    middle = 0.5 * (near[:2] + far[:2])
    stands = cut_at(costs, near, far) or (float(middle[0]), float(middle[1]))
    return Barrier(index, route.edges[index].edge_id, (float(near[0]), float(near[1])), stands)
