"""The metric baseline's far look: a field over the whole saved grid, renewed every second (thesis, 2-4-1).

Everything nearer than that, the near look, the Dynamic Window Approach and the recoveries, is the same
navigator. The map is one grid, so its frame is the only node, and a goal is a point in it.
"""

from collections.abc import Sequence

import numpy as np

from lemtomap import se2
from lemtomap.errors import NoRoute
from lemtomap.nav.config import NavConfig
from lemtomap.nav.motion.costmap import Costs
from lemtomap.nav.motion.metric import (
    MetricPlan,
    Reach,
    plan_to,
    reach_from,
)
from lemtomap.nav.outlook import ReachableArea
from lemtomap.nav.route.planner import Route
from lemtomap.nav.route.sliding import Target
from lemtomap.nav.route.way import CycleInput
from lemtomap.nav.surroundings import Surroundings
from lemtomap.nav.types import Goal
from lemtomap.se2 import Pose
from lemtomap.types import GridView, MapView, RouteEdge

GRID_ID = 1
"""The node that stands for the grid's frame."""


class GridGraph:
    """A RouteGraph without any edge: within the one grid there is nothing to choose."""

    version = 1

    def has_node(self, node_id: int) -> bool:
        """Return True if this is the grid."""
        return node_id == GRID_ID

    def edges_of(self, node_id: int) -> Sequence[RouteEdge]:  # noqa: ARG002 - no node has any
        """Return none."""
        return ()

    def area_nodes(self, place: str) -> list[int]:  # noqa: ARG002 - a grid knows no areas
        """Return none."""
        return []

    def node_of(self, name: str) -> int | None:  # noqa: ARG002 - a grid knows no names
        """Return none."""
        return None

    def close(self) -> None:
        """Nothing is open."""


def view_of(grid: GridView, T_grid_odom: Pose, T_grid_base: Pose, now_s: float) -> MapView:
    """Return the saved grid and a pose in it as the navigator takes them."""
    return MapView(
        stamp_s=now_s,
        grid=grid,
        T_grid_odom=T_grid_odom,
        T_grid_base=T_grid_base,
        associated_id=GRID_ID,
        T_grid_node={GRID_ID: se2.pose(0.0, 0.0, 0.0)},
        edges=(),
        quality=1.0,
        diversity=1.0,
        lost=False,
    )


class WholeGridLook:
    """Plans over all of a saved grid.

    The costs of a map that never changes are worked out once; obstacles seen since are taken in when the way
    found over the old ones proves to be barred.
    """

    def __init__(self, surroundings: Surroundings, config: NavConfig) -> None:
        self._surroundings, self._config = surroundings, config
        self._looked_s = -np.inf
        self._goal: Goal | None = None
        self._reach: Reach | None = None

    def look(
        self,
        goal: Goal,
        route: Route,  # noqa: ARG002 - one node
        moment: CycleInput,
        tolerance_m: float,
        bound_for_grid: tuple[float, float] | None,  # noqa: ARG002 - one target
    ) -> ReachableArea:
        """Return the way to the goal over the whole grid. Raises NoRoute."""
        barred = self._goal == goal and moment.now_s - self._looked_s < 0.9 * self._config.look_period_s
        self._looked_s, self._goal = moment.now_s, goal
        reach = self._reach_at(moment, anew=barred)
        found = reach.nearest(goal.p_node, tolerance_m)
        plan = None if found is None else self._search(reach, moment.T_grid_base, found[:2])
        if found is None or plan is None:
            raise NoRoute(f"no way over the grid to {goal.p_node[0]:.1f}, {goal.p_node[1]:.1f}")
        target = Target(0, GRID_ID, found[:2], final=True, proven=found[2] == 1)
        return ReachableArea(moment.now_s, reach, target, plan, tight=False)

    def _search(self, reach: Reach, T_grid_base: Pose, cell: tuple[int, int]) -> MetricPlan | None:
        return plan_to(reach.costs, T_grid_base, cell)

    def _reach_at(self, moment: CycleInput, *, anew: bool) -> Reach:
        """Return what can be reached, searched again only where the old costs do not serve."""
        old = self._reach
        if old is not None and not anew and _stands(old.costs, moment.T_grid_base):
            return old
        costs = self._surroundings.costs(moment.map_view, moment.T_grid_base, moment.now_s)
        self._reach = reach_from(costs, moment.T_grid_base)
        return self._reach


def _stands(costs: Costs, T_grid_base: Pose) -> bool:
    """Return True if the robot's cell is one the body fits into."""
    row, col = costs.cell(T_grid_base)
    return costs.holds(T_grid_base) and bool(np.isfinite(costs.cost[int(row), int(col)]))
