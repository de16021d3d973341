"""The metric baseline's global plan: a field over the whole saved grid, renewed every second (thesis, 2-4-1).

The way it finds is handed on as a chain of way points, and the window around the robot is cut out of the
saved grid, so that everything below the global plan is the same navigator for both.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lemtomap import se2
from lemtomap.errors import NoRoute
from lemtomap.nav.config import NavConfig
from lemtomap.nav.costmap import Costmap, Costs
from lemtomap.nav.metric import plan_to, reach_from
from lemtomap.se2 import Pose
from lemtomap.types import EdgeType, GridView, MapView, RouteEdge

GOAL_ID = 1
SPACING_M = 1.0  # as topological nodes lie
RENEW_S = 1.0  # planner_frequency of move_base in the thesis
WINDOW_M = 20.0
MOVE_WINDOW_M = 1.0


class WayPoints:
    """A RouteGraph of one chain."""

    def __init__(self) -> None:
        self.version = 0
        self.ids: list[int] = [GOAL_ID]
        self.places: dict[int, Pose] = {}

    def lay(self, path: NDArray[np.float64]) -> None:
        """Replace the chain by points along a path (N, 2) in metres; the last one is the goal."""
        way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
        marks = np.arange(0.0, max(way[-1] - 0.5 * SPACING_M, 0.1), SPACING_M)
        points = [path[int(np.searchsorted(way, mark))] for mark in marks] + [path[-1]]
        first = max(self.ids) + 1
        self.ids = [*range(first, first + len(points) - 1), GOAL_ID]
        places = [se2.pose(float(x), float(y), 0.0) for x, y in points]
        self.places = dict(zip(self.ids, places, strict=True))
        self.version += 1

    def has_node(self, node_id: int) -> bool:
        """Tell whether this is one of the chain's points."""
        return node_id in self.places

    def edges_of(self, node_id: int) -> Sequence[RouteEdge]:
        """Return the links to the points before and after."""
        if node_id not in self.places:
            return ()
        at = self.ids.index(node_id)
        return [self._edge(at, other) for other in (at - 1, at + 1) if 0 <= other < len(self.ids)]

    def links(self) -> list[tuple[int, int, int, EdgeType]]:
        """Return all links as a MapView shows them."""
        pairs = zip(self.ids, self.ids[1:], strict=False)
        return [(a, a, b, EdgeType.ODOMETRY) for a, b in pairs]

    def _edge(self, at: int, other: int) -> RouteEdge:
        here, there = self.ids[at], self.ids[other]
        length_m = float(np.hypot(*(self.places[here] - self.places[there])[:2]))
        return RouteEdge(self.ids[min(at, other)], there, length_m, length_m / 0.4)


class WholeGridPlanner:
    """Plans over a saved grid; the map itself never changes."""

    def __init__(self, grid: GridView, config: NavConfig) -> None:
        self.grid = grid
        self.way = WayPoints()
        self._costmap = Costmap(config.costmap, config.body)
        self._costmap.follow_window(grid)
        self._crop: GridView | None = None
        self._crop_at = np.full(2, np.inf)
        self._renewed_s = -np.inf
        self._goal: tuple[float, float] | None = None
        self._cell: tuple[int, int] | None = None
        self._costs: Costs | None = None

    def set_goal(self, p_goal_grid: tuple[float, float]) -> None:
        """Take a point of the saved grid's frame; the next renew plans to it."""
        self._goal, self._cell, self._renewed_s = p_goal_grid, None, -np.inf

    def renew(self, T_grid_base: Pose, now_s: float) -> bool:
        """Plan over the whole grid if it is time; True when it did. Raises NoRoute."""
        if self._goal is None or now_s - self._renewed_s < RENEW_S - 1e-6:
            return False
        self._renewed_s = now_s
        costs = self._costs_at(T_grid_base)
        if self._cell is None:
            found = reach_from(costs, T_grid_base).nearest(self._goal, 0.3)
            self._cell = None if found is None else found[:2]
        plan = None if self._cell is None else plan_to(costs, T_grid_base, self._cell)
        if plan is None:
            raise NoRoute(f"no way over the grid to {self._goal[0]:.1f}, {self._goal[1]:.1f}")
        self.way.lay(np.vstack([plan.path_grid, plan.p_target_grid]))
        return True

    def _costs_at(self, T_grid_base: Pose) -> Costs:
        """Return the grid's costmap, made once; anew only where the robot stands too near to a wall."""
        costs = self._costs
        if costs is not None:
            row, col = costs.cell(T_grid_base)
            if np.isfinite(costs.cost[int(row), int(col)]):
                return costs
        self._costs = self._costmap.build(0.0, np.empty((0, 2)), T_grid_base[:2])
        return self._costs

    def view(self, T_grid_odom: Pose, T_grid_base: Pose, now_s: float) -> MapView:
        """Return the window around the robot and the way points as the navigator takes them."""
        places = self.way.places
        nearest = min(places, key=lambda n: float(np.hypot(*(places[n] - T_grid_base)[:2])), default=GOAL_ID)
        return MapView(
            stamp_s=now_s,
            grid=self._window(T_grid_base),
            T_grid_odom=T_grid_odom,
            T_grid_base=T_grid_base,
            associated_id=nearest,
            T_grid_node=dict(places),
            edges=self.way.links(),
            quality=1.0,
            diversity=1.0,
            lost=False,
        )

    def _window(self, T_grid_base: Pose) -> GridView:
        """Cut the window out of the grid; moved by whole metres, as the rolling window is."""
        if self._crop is not None and np.abs(T_grid_base[:2] - self._crop_at).max() < MOVE_WINDOW_M:
            return self._crop
        grid, half = self.grid, round(0.5 * WINDOW_M / self.grid.resolution_m)
        col, row = ((T_grid_base[:2] - np.array(grid.origin_m)) / grid.resolution_m).astype(int)
        out = np.full((2 * half, 2 * half), -1, dtype=np.int8)
        r0, c0 = max(0, row - half), max(0, col - half)
        piece = grid.occupancy[r0 : max(r0, row + half), c0 : max(c0, col + half)]
        out[r0 - row + half :, c0 - col + half :][: piece.shape[0], : piece.shape[1]] = piece
        corner = np.array(grid.origin_m) + (np.array([col, row]) - half) * grid.resolution_m
        self._crop = GridView(0.0, out, grid.resolution_m, (float(corner[0]), float(corner[1])))
        self._crop_at = np.array(T_grid_base[:2])
        return self._crop
