"""The route under way: planned, kept while it holds, and planned around edges that prove closed."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from lemtomap.nav.barriers import find_barrier, find_detour
from lemtomap.nav.config import NavConfig
from lemtomap.nav.metric import MetricPlan, Reach
from lemtomap.nav.route.planner import Route
from lemtomap.nav.route.planning import RoutePlanner
from lemtomap.nav.sliding import BORDER_M, Target
from lemtomap.nav.types import Goal
from lemtomap.nav.watching import BarrierWatch, Link, links_cut, links_open_again
from lemtomap.se2 import Pose
from lemtomap.topo.events import EdgeBlocked, EdgeTraversed, NavEvent
from lemtomap.types import MapView, RouteGraph, Twist

NEAR_BARRIER_M = 1.0
SEEN_FREE_TIMES = 2
SHUT_IN_M2 = 1.0
"""A robot that can reach less floor than this is held by a chair or by noise, not by a closed door."""


@dataclass(frozen=True, slots=True)
class Moment:
    """What one control cycle knows."""

    map_view: MapView
    graph: RouteGraph
    T_odom_base: Pose
    T_grid_base: Pose
    twist: Twist
    now_s: float
    events: list[NavEvent] = field(default_factory=list)


class WayKeeper:
    """Holds the route to one goal and which edges are closed; closed edges outlive the goal."""

    def __init__(self, config: NavConfig) -> None:
        self._config = config
        self._planner = RoutePlanner(config.route)
        self._version: int | None = None
        self._closed_s: dict[int, float] = {}
        self._closings: dict[int, tuple[int, float]] = {}
        """How often an edge was closed of late, and when last."""
        self.route: Route | None = None
        """None: to be planned anew."""
        self.barred_s: float | None = None
        """When the way under way was barred last, or seen to open again; None: not since the goal was set."""
        self.barriers = BarrierWatch(config.recovery)

    def keep(self, goal: Goal, moment: Moment) -> Route:
        """Return the route from the associated node, planned anew only when the map or the way changed.

        Raises NoRoute with the reason.
        """
        graph, here = moment.graph, moment.map_view.associated_id
        if self.route is not None and self._version == graph.version and here in self.route.nodes:
            self.route = self.route.since(here)
            return self.route
        self._closed_s = {edge: until for edge, until in self._closed_s.items() if until > moment.now_s}
        self.route = self._planner.plan(graph, moment.map_view, goal.node_id, moment.now_s, self._closed_s)
        self._version = graph.version
        return self.route

    def check(
        self, goal: Goal, target: Target | None, plan: MetricPlan | None, reach: Reach, moment: Moment
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
            self._rule_out(route, barrier.index, moment)
            return None
        if not self.barriers.closed(barrier, moment.now_s, near=near):
            return None
        on_route = (barrier.edge_id, route.nodes[barrier.index], route.nodes[barrier.index + 1])
        self._close([on_route, *links_cut(moment.map_view, reach, barrier, BORDER_M)], moment)
        return barrier.p_middle_grid

    def reopen(self, reach: Reach, moment: Moment) -> bool:
        """Open closed edges that are seen to be free; tell whether there were any.

        One that proved closed again and again, though it had been seen free, waits for its time.
        """
        believed = [e for e in self._closed_s if self._closings.get(e, (0, 0.0))[0] <= SEEN_FREE_TIMES]
        links = links_open_again(believed, moment.map_view, reach)
        for edge_id, a, b in links:
            del self._closed_s[edge_id]
            moment.events.append(EdgeBlocked(a, b, 0.0))
            self.barred_s = moment.now_s  # the map will hear of it in a moment
        return bool(links)

    def close_next(self, moment: Moment) -> bool:
        """Close the first edge of the route; False when there is none."""
        route = self.route
        if route is None or not route.edges:
            return False
        self._close([(route.edges[0].edge_id, route.nodes[0], route.nodes[1])], moment)
        return True

    def passed(self, driven: EdgeTraversed, graph: RouteGraph) -> None:
        """Forget how often an edge was closed: it was open all along its length since."""
        for edge in graph.edges_of(driven.from_id) if self._closings else ():
            if edge.other_id == driven.to_id:
                self._closings.pop(edge.edge_id, None)

    def _rule_out(self, route: Route, index: int, moment: Moment) -> None:
        """Close a closure that the window shows to lead through something: it never was a way."""
        edge_id, until_s = route.edges[index].edge_id, moment.now_s + self._config.recovery.block_longest_s
        self._closed_s[edge_id] = until_s
        moment.events.append(EdgeBlocked(route.nodes[index], route.nodes[index + 1], until_s))
        self.route = None
        self.barriers.reset()

    def _close(self, links: Sequence[Link], moment: Moment) -> None:
        """Plan around these edges from now on, and tell the map."""
        longest_s = self._config.recovery.block_longest_s
        self._closings = {e: c for e, c in self._closings.items() if moment.now_s - c[1] < longest_s}
        for edge_id, a, b in {link[0]: link for link in links}.values():
            until_s = self._closed_s[edge_id] = moment.now_s + self._block_s(edge_id, moment.now_s)
            moment.events.append(EdgeBlocked(a, b, until_s))
        self.barred_s = moment.now_s
        self.route = None
        self.barriers.reset()

    def _block_s(self, edge_id: int, now_s: float) -> float:
        """Return how long an edge is to be closed: each time longer, else two closed ways that open again
        while the robot is at the other one send it to and fro for ever.

        Found cut while it is closed, it was not closed again: one barrier is met from several edges.
        """
        recovery = self._config.recovery
        before, _ = self._closings.get(edge_id, (0, now_s))
        if before and self._closed_s.get(edge_id, 0.0) > now_s:
            before -= 1
        self._closings[edge_id] = (before + 1, now_s)
        return min(recovery.block_s * recovery.block_growth**before, recovery.block_longest_s)
