"""The route under way: planned, kept while it holds, and planned around edges that prove closed."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from lemtomap.errors import NoRoute
from lemtomap.nav.config import NavConfig
from lemtomap.nav.motion.metric import MetricPlan, Reach
from lemtomap.nav.route.barriers import find_barrier, find_detour
from lemtomap.nav.route.blocked import BlockedEdges
from lemtomap.nav.route.fresh import FreshGraph
from lemtomap.nav.route.planner import Route
from lemtomap.nav.route.planning import RoutePlanner
from lemtomap.nav.route.sliding import BORDER_M, SNAP_M, Target
from lemtomap.nav.route.watching import (
    BarrierWatch,
    Link,
    links_cut,
    links_open_again,
)
from lemtomap.nav.types import Goal
from lemtomap.se2 import Pose
from lemtomap.topo.events import EdgeTraversed, NavEvent
from lemtomap.types import MapView, RouteGraph, Twist

NEAR_BARRIER_M = 1.0  # the robot stands before what closes its edge
STARTS_TRIED = 12
BESIDE_M = 8.0
"""Nodes this near may stand in for the associated one."""
SHUT_IN_M2 = 1.0
"""A robot that can reach less floor than this is held by a chair or by noise, not by a closed door."""


@dataclass(frozen=True, slots=True)
class CycleInput:
    """What one control cycle knows."""

    map_view: MapView
    graph: FreshGraph
    T_odom_base: Pose
    T_grid_base: Pose
    twist: Twist
    now_s: float
    events: list[NavEvent] = field(default_factory=list)


class RouteKeeper:
    """Holds the route to one goal and which edges are closed; closed edges outlive the goal."""

    def __init__(self, config: NavConfig) -> None:
        self._config = config
        self._planner = RoutePlanner(config.route)
        self._version: int | None = None
        self.blocked = BlockedEdges(config.recovery)
        self.route: Route | None = None
        """None: to be planned anew."""
        self.barred_s: float | None = None
        """When the way under way was barred last, or seen to open again; None: not since the goal was set."""
        self.barriers = BarrierWatch(config.recovery)
        self._retried = False
        self._instead: tuple[int, int] | None = None
        """The associated node and the one to begin from as long as that is it."""
        self._sought_s = -np.inf

    def start_leg(self) -> None:
        """There is a new goal."""
        self.barriers.reset()
        self.barred_s, self._retried, self._instead, self._sought_s = None, False, None, -np.inf

    def keep(self, goal: Goal, moment: CycleInput) -> Route:
        """Return the route from the associated node, planned anew only when the map or the way changed.

        Raises NoRoute with the reason.
        """
        here = moment.map_view.associated_id
        if self._instead is not None and self._instead[0] == here:
            here = self._instead[1]
        if self.route is not None and self._version == moment.graph.version and here in self.route.nodes:
            self.route = self.route.since(here)
            return self.route
        self.route = self._plan_from(here, goal, moment)
        return self.route

    def begin_elsewhere(self, goal: Goal, reach: Reach, moment: CycleInput) -> bool:
        """Plan from another node that the window shows a way to, if the associated one has none.

        What was bumped into may stand on a node: all its edges are cut, though there is room to pass.
        """
        here = moment.map_view.associated_id
        tried = self._instead is not None and self._instead[0] == here
        if tried or moment.now_s - self._sought_s < self._config.look_period_s:
            return False
        self._sought_s = moment.now_s
        for node_id in _in_reach(moment.map_view, reach, moment.T_grid_base)[:STARTS_TRIED]:
            try:
                self.route = self._plan_from(node_id, goal, moment)
            except NoRoute:
                continue
            self._instead = here, node_id
            return True
        return False

    def _plan_from(self, node_id: int, goal: Goal, moment: CycleInput) -> Route:
        self._version = moment.graph.version
        closed_until_s = self.blocked.closed_until_s(moment.now_s)
        return self._planner.plan(moment.graph, node_id, goal.node_id, moment.now_s, closed_until_s)

    def check(
        self, goal: Goal, target: Target | None, plan: MetricPlan | None, reach: Reach, moment: CycleInput
    ) -> tuple[float, float] | None:
        """Open edges seen to be free; close those a standing barrier cuts, once it is to be believed.

        The route is then None, to be planned anew. Returns where a barrier that may go again stands, in the
        grid frame; what stands on a closure nobody has driven is mostly a wall.
        """
        self.reopen(reach, moment)
        route, places = self.route, moment.map_view.T_grid_node
        if route is None or (target is None and reach.area_m2() < SHUT_IN_M2):
            return None  # shut in by something near: no edge is to blame
        beyond = 0 if target is None else target.index
        barrier = find_barrier(route, places, reach, beyond)
        if barrier is None and plan is not None:
            way_m = np.inf if self.barriers.watching else plan.length_m
            barrier = find_detour(route, goal, places, reach.costs, beyond, way_m)
        if barrier is None:
            self.barriers.reset()
            return None
        away_m = float(np.hypot(*(np.array(barrier.p_near_grid) - moment.T_grid_base[:2])))
        near = away_m < NEAR_BARRIER_M or target is None
        if not route.edges[barrier.index].proven and not self.barriers.moving(barrier):
            moment.events.append(self.blocked.rule_out(_link(route, barrier.index), moment.now_s))
            self._plan_anew()
            return None
        if not self.barriers.closed(barrier, moment.now_s, near=near):
            return None
        self._close(
            [_link(route, barrier.index), *links_cut(moment.map_view, reach, barrier, BORDER_M)], moment
        )
        return barrier.p_middle_grid

    def reopen(self, reach: Reach, moment: CycleInput) -> bool:
        """Open closed edges that are seen to be free; return True if there were any."""
        links = links_open_again(self.blocked.may_be_seen_free(), moment.map_view, reach)
        self._open(links, moment)
        return bool(links)

    def retry(self, moment: CycleInput) -> bool:
        """Open, once for a goal, what was closed a while ago; return False when there is nothing."""
        old = [] if self._retried else self.blocked.worth_a_retry(moment.now_s)
        self._retried = self._retried or bool(old)
        self._open(old, moment)
        return bool(old)

    def close_next(self, moment: CycleInput) -> bool:
        """Close the first edge of the route; return False when there is none."""
        if self.route is None or not self.route.edges:
            return False
        self._close([_link(self.route, 0)], moment)
        return True

    def passed(self, driven: EdgeTraversed, graph: RouteGraph) -> None:
        """Take note of an edge driven from end to end."""
        for edge in graph.edges_of(driven.from_id):
            if edge.other_id == driven.to_id:
                self.blocked.driven(edge.edge_id)

    def _open(self, links: Sequence[Link], moment: CycleInput) -> None:
        moment.events.extend(self.blocked.open(links))
        if links:
            self.barred_s = moment.now_s  # the map will hear of it in a moment

    def _close(self, links: Sequence[Link], moment: CycleInput) -> None:
        moment.events.extend(self.blocked.close(links, moment.now_s))
        self.barred_s = moment.now_s
        self._plan_anew()

    def _plan_anew(self) -> None:
        self.route = None
        self.barriers.reset()


def _link(route: Route, index: int) -> Link:
    return route.edges[index].edge_id, route.nodes[index], route.nodes[index + 1]


def _in_reach(map_view: MapView, reach: Reach, T_grid_base: Pose) -> list[int]:
    """Return the nodes beside the robot that it can get to over seen floor, nearest first."""
    away_m = {
        node_id: float(np.hypot(*(T_grid_node - T_grid_base)[:2]))
        for node_id, T_grid_node in map_view.T_grid_node.items()
    }
    near = (node_id for node_id in sorted(away_m, key=away_m.__getitem__) if away_m[node_id] <= BESIDE_M)
    found = ((node_id, reach.nearest(map_view.T_grid_node[node_id], SNAP_M)) for node_id in near)
    return [node_id for node_id, cell in found if cell is not None and cell[2] == 1]
