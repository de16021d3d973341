"""The sliding goal: the furthest place of the route that lies in the window and is proved reachable in it.

The goal slides along the route while the robot drives; nothing is cancelled and started again, so there is no
stammer between nodes (thesis, 5-2-2 and Figure 5-13).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from lemtomap import se2
from lemtomap.nav.motion.costmap import Costs
from lemtomap.nav.motion.metric import Reach
from lemtomap.nav.route.planner import Route
from lemtomap.nav.types import Goal
from lemtomap.se2 import Pose

BORDER_M = 0.4
"""A node this near to the window's border has its surroundings cut off."""
STEP_M = 0.25
"""Places on an edge are tried this far apart."""
WORTH_M = 1.0
"""This much seen way along the next edge is better than a node over unseen floor."""
HERE_M = 0.5
"""A robot this near to a place is there: the velocity planner, which looks ahead, would stop short."""
SAME_NODE_M, SAME_GOAL_M = 0.4, 1.5
"""How far a node strays in the window between two looks, and how far whoever explores moves a goal."""
ROUND_SHARE, ROUND_M = 2.0, 3.0
"""A goal beside a node is this much of its distance from it away, and a bit, and not further."""
SNAP_M = 0.30
"""A node's pose in the window may be off by this much; its place is looked for this near."""


@dataclass(frozen=True, slots=True)
class Target:
    """Where in the window to steer, and which part of the route that covers."""

    index: int
    """Into the route's nodes."""
    node_id: int
    cell: tuple[int, int]
    final: bool
    """True: this is the goal itself."""
    proven: bool
    """True: over seen floor all the way."""
    beyond_m: float = 0.0
    """How far along the edge behind that node the place lies: nobody slows down at a node to be passed."""


def place_of(route: Route, index: int, goal: Goal, T_grid_node: Mapping[int, Pose]) -> Pose | None:
    """Return the pose in the grid frame of the route's index-th node, or of the goal at its end."""
    T_grid_here = T_grid_node.get(route.nodes[index])
    if T_grid_here is None:
        return None
    if index < len(route.nodes) - 1:
        return T_grid_here
    return se2.compose(T_grid_here, [goal.p_node[0], goal.p_node[1], goal.yaw_node_rad or 0.0])


def choose_target(
    route: Route,
    goal: Goal,
    T_grid_node: Mapping[int, Pose],
    reach: Reach,
    goal_tolerance_m: float,
    bound_for_grid: tuple[float, float] | None = None,
    *,
    goal_seen: bool = False,
) -> Target | None:
    """Return the furthest reachable place of the route, or None if not even the next node can be reached.

    bound_for_grid: the place over unseen floor the robot is on its way to. It stays the target while nothing
    further along the route is seen to be open: how much seen way there is on the edges depends on the node
    the route starts from, and would send the robot back and forth where the two ways part.
    goal_seen: a goal beside its node that only unseen floor leads to gives way to the node.
    """
    last = len(route.nodes) - 1
    unproven: Target | None = None
    for index in range(last, -1, -1):
        target = _target_at(index, route, goal, T_grid_node, reach, goal_tolerance_m, goal_seen=goal_seen)
        if target is None:
            continue
        if not target.proven:
            if index > 0 or last == 0:
                unproven = target
                if _is_bound_for(target, bound_for_grid, reach.costs):
                    return target
            continue
        further = target if target.final else _along_edge(target, route, T_grid_node, reach)
        leads_on = (index > 0 or further.beyond_m > WORTH_M) and not _is_here(further, reach)
        if unproven is None or leads_on:
            return further
    return unproven


def is_roundabout(route: Route, goal: Goal, target: Target, way_m: float) -> bool:
    """Return True if a way over unseen floor to the goal is far too long: it leads through gaps in walls.

    way_m: the way to the target. A robot on either way finds the same the further it gets along it.
    """
    if not target.final or target.proven:
        return False
    return way_m > route.length_m + ROUND_SHARE * math.hypot(*goal.p_node) + ROUND_M


def _is_here(target: Target, reach: Reach) -> bool:
    """Return True if the robot stands where a target is: then only unseen floor leads on."""
    away = math.dist((target.cell[0] + 0.5, target.cell[1] + 0.5), reach.start)
    return away * reach.costs.resolution_m <= HERE_M


def _is_bound_for(target: Target, p_grid: tuple[float, float] | None, costs: Costs) -> bool:
    """Return True if a target over unseen floor is the place the robot is on its way to."""
    if p_grid is None:
        return False
    row, col = costs.cell(p_grid)
    away_m = math.dist((target.cell[0] + 0.5, target.cell[1] + 0.5), (row, col)) * costs.resolution_m
    return away_m <= (SAME_GOAL_M if target.final else SAME_NODE_M)


def _along_edge(target: Target, route: Route, T_grid_node: Mapping[int, Pose], reach: Reach) -> Target:
    """Return the furthest place over seen floor on the edge behind a node; the node if there is none."""
    if target.index + 1 >= len(route.nodes):
        return target
    near, far = (T_grid_node.get(route.nodes[target.index + step]) for step in (0, 1))
    if near is None or far is None:
        return target
    length_m = math.dist(near[:2], far[:2])
    for step in range(int(length_m / STEP_M), 0, -1):
        place = near[:2] + (far[:2] - near[:2]) * (step * STEP_M / length_m)
        found = reach.nearest(place, SNAP_M) if reach.costs.holds(place, BORDER_M) else None
        if found is not None and found[2] == 1:
            return replace(target, cell=found[:2], beyond_m=step * STEP_M)
    return target


def _target_at(
    index: int,
    route: Route,
    goal: Goal,
    T_grid_node: Mapping[int, Pose],
    reach: Reach,
    goal_tolerance_m: float,
    *,
    goal_seen: bool,
) -> Target | None:
    place = place_of(route, index, goal, T_grid_node)
    if place is None:
        return None
    final = index == len(route.nodes) - 1
    found = None
    if reach.costs.holds(place, 0.0 if final else BORDER_M):
        found = reach.nearest(place, max(SNAP_M, goal_tolerance_m))
    T_grid_node_here = T_grid_node[route.nodes[index]]
    shut = found is None or (goal_seen and found[2] == 2)
    if shut and final and goal.p_node != (0.0, 0.0) and reach.costs.holds(T_grid_node_here):
        final = False  # go to its node and look from there
        found = reach.nearest(T_grid_node_here, SNAP_M)
    if found is None:
        return None
    return Target(index, route.nodes[index], found[:2], final, found[2] == 1)
