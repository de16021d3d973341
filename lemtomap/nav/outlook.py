"""Two looks at the surroundings: far over the window, now and then, and near around the robot, often.

The far look tells how far along the route the robot can come, and the cost-to-go from everywhere to there.
The near look works the way out anew where it matters, with what the sensors see now: over a few metres, at
whose border the far look's cost-to-go still holds. So the window is searched once a second, not at each turn.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from lemtomap.nav.config import NavConfig
from lemtomap.nav.motion.costmap import Costs
from lemtomap.nav.motion.metric import (
    MetricPlan,
    Reach,
    plan_near,
    plan_to,
    reach_from,
)
from lemtomap.nav.route.barriers import find_barrier
from lemtomap.nav.route.planner import Route
from lemtomap.nav.route.sliding import Target, choose_target, is_roundabout
from lemtomap.nav.route.way import CycleInput
from lemtomap.nav.surroundings import Surroundings
from lemtomap.nav.types import CostmapView, Goal
from lemtomap.types import RouteEdge

NEAR_HALF_M = 2.5
"""Twice what a trajectory covers, so that the way round a person or a chair lies inside."""
CLOSE_M = 2.5
"""Nearer to a node to be passed than this, the next one is looked for at every turn."""
DETOUR_M = 0.8
"""When what is seen now makes the way this much longer, another one may be shorter."""


@dataclass(frozen=True, slots=True)
class ReachableArea:
    """What one far look found."""

    stamp_s: float
    reach: Reach
    target: Target | None
    """None: nothing of the route can be reached."""
    plan: MetricPlan | None
    tight: bool
    """True: the target is in reach only without the body's margin."""

    def index_in(self, route: Route) -> int | None:
        """Return where in the route the target is now; None when it lies behind or on another route."""
        if self.target is None or self.target.node_id not in route.nodes:
            return None
        return route.nodes.index(self.target.node_id)


class FarLook(Protocol):
    """Finds the way as far ahead as it knows the building."""

    def look(
        self,
        goal: Goal,
        route: Route,
        moment: CycleInput,
        tolerance_m: float,
        bound_for_grid: tuple[float, float] | None,
    ) -> ReachableArea:
        """Return the furthest place of the route that can be reached, and the way to it.

        bound_for_grid: the place over unseen floor the robot is on its way to, metres; None: to none.
        """
        ...


class WindowLook:
    """Looks as far as the rolling window goes."""

    def __init__(self, surroundings: Surroundings) -> None:
        self._surroundings = surroundings

    def look(
        self,
        goal: Goal,
        route: Route,
        moment: CycleInput,
        tolerance_m: float,
        bound_for_grid: tuple[float, float] | None,
    ) -> ReachableArea:
        """Look with the body's margin, and without it where that leads further."""
        reach, target = self._reach(goal, route, moment, tolerance_m, bound_for_grid, tight=False)
        beyond, tight = (0 if target is None else target.index), False
        if target is None or find_barrier(route, moment.map_view.T_grid_node, reach, beyond) is not None:
            narrow, further = self._reach(goal, route, moment, tolerance_m, bound_for_grid, tight=True)
            if further is not None and (target is None or further.index > beyond):
                reach, target, tight = narrow, further, True
        plan = None if target is None else plan_to(reach.costs, moment.T_grid_base, target.cell)
        if target is not None and plan is not None and is_roundabout(route, goal, target, plan.length_m):
            places = moment.map_view.T_grid_node
            target = choose_target(route, goal, places, reach, tolerance_m, goal_seen=True) or target
            plan = plan_to(reach.costs, moment.T_grid_base, target.cell)
        return ReachableArea(moment.now_s, reach, target, plan, tight)

    def _reach(
        self,
        goal: Goal,
        route: Route,
        moment: CycleInput,
        tolerance_m: float,
        bound_for_grid: tuple[float, float] | None,
        *,
        tight: bool,
    ) -> tuple[Reach, Target | None]:
        view = moment.map_view
        costs = self._surroundings.costs(view, moment.T_grid_base, moment.now_s, tight=tight)
        reach = reach_from(costs, moment.T_grid_base)
        return reach, choose_target(route, goal, view.T_grid_node, reach, tolerance_m, bound_for_grid)


class Lookout:
    """Keeps both looks fresh: what the robot knows of its way now."""

    def __init__(self, surroundings: Surroundings, far: FarLook, config: NavConfig) -> None:
        self.far = far
        self.outlook: ReachableArea | None = None
        """What the last far look found; None: look anew."""
        self.plan: MetricPlan | None = None
        """The way to the target as last seen near by."""
        self.picture: CostmapView | None = None
        """The newest costmap of the far look, for viewers."""
        self._bound_for_grid: tuple[float, float] | None = None
        self._surroundings, self._config = surroundings, config
        self._looked_s = -np.inf

    @property
    def target(self) -> Target | None:
        """Where to steer; None when nothing of the route can be reached."""
        return None if self.outlook is None else self.outlook.target

    @property
    def costs(self) -> Costs | None:
        """The newest costs around the robot."""
        if self.plan is not None:
            return self.plan.costs
        return None if self.outlook is None else self.outlook.reach.costs

    def forget(self) -> None:
        """The way is another one now."""
        self.plan = self.outlook = self._bound_for_grid = None

    def restart(self) -> None:
        """There is a new goal: look at once. It may be the old one moved a little: the way stays."""
        self.plan = self.outlook = None
        self._looked_s = -np.inf

    def is_due(self, now_s: float) -> bool:
        """Tell, once each period, that it is time to look at what is near."""
        if now_s - self._looked_s < self._config.plan_period_s - 1e-6:
            return False
        self._looked_s = now_s
        return True

    def renew(
        self, goal: Goal, route: Route, moment: CycleInput, tolerance_m: float, *, far: bool
    ) -> ReachableArea | None:
        """Look near by, and far if asked to or due; return what a far look found, None without one."""
        near = None if self.outlook is None else look_near(self._surroundings, self.outlook, moment)
        found = None
        if self.outlook is None or far or outdated(self.outlook, near, route, moment, self._config):
            found = self.outlook = self.far.look(goal, route, moment, tolerance_m, self._bound_for_grid)
            self._bound_for_grid = _unproven_place(found)
            self.picture = found.reach.costs.view()
            near = look_near(self._surroundings, found, moment)
        self.plan = self.outlook.plan if near is None else near
        return found

    def remaining_m(self, route: Route) -> float:
        """Return the way to the target and along the edges behind it.

        Just after the route changed the old target may not lie on it: then the route is all that is known.
        """
        plan, target = self.plan, self.target
        if plan is None or target is None or target.node_id not in route.nodes:
            return max(route.length_m, 0.0 if plan is None else plan.length_m)
        return plan.length_m - target.beyond_m + sum(edge.length_m for edge in self.edges_beyond(route))

    def edges_beyond(self, route: Route) -> Sequence[RouteEdge]:
        """Return the edges of the route behind the target."""
        at = None if self.outlook is None else self.outlook.index_in(route)
        return () if at is None else route.edges[at:]


def _unproven_place(outlook: ReachableArea) -> tuple[float, float] | None:
    """Return where over unseen floor the outlook leads, metres, grid frame; None over seen floor."""
    target, plan = outlook.target, outlook.plan
    return None if target is None or plan is None or target.proven else plan.p_target_grid


def look_near(surroundings: Surroundings, outlook: ReachableArea, moment: CycleInput) -> MetricPlan | None:
    """Return the way to the outlook's target as the sensors show it now; None when none is left."""
    if outlook.plan is None:
        return None
    costs = surroundings.costs(
        moment.map_view, moment.T_grid_base, moment.now_s, tight=outlook.tight, half_m=NEAR_HALF_M
    )
    return plan_near(costs, outlook.plan, moment.T_grid_base)


def outdated(
    outlook: ReachableArea, near: MetricPlan | None, route: Route, moment: CycleInput, config: NavConfig
) -> bool:
    """Return True if it is time for another far look."""
    age_s = moment.now_s - outlook.stamp_s
    if age_s < config.plan_period_s - 1e-6:
        return False
    if age_s >= config.look_period_s - 1e-6 or near is None or outlook.plan is None:
        return True
    target = outlook.target
    if target is None or outlook.index_in(route) is None:
        return True
    if not target.final and near.length_m < CLOSE_M:
        return True
    row, col = outlook.plan.costs.cell(moment.T_grid_base)
    field, here = outlook.plan.field, (int(np.floor(row)), int(np.floor(col)))
    if not (0 <= here[0] < field.shape[0] and 0 <= here[1] < field.shape[1]):
        return True
    near_row, near_col = near.costs.cell(moment.T_grid_base)
    grown = near.field[int(near_row), int(near_col)] - field[here]
    return bool(grown * near.costs.resolution_m > DETOUR_M)
