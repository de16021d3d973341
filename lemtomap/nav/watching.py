"""Watching edges: how long each takes to drive, and whether a barrier across one is a door or a person."""

from collections.abc import Container

import numpy as np

from lemtomap.nav import kernels
from lemtomap.nav.config import RecoveryConfig
from lemtomap.nav.costmap import Costs
from lemtomap.nav.metric import Reach
from lemtomap.nav.sliding import SNAP_M, Barrier
from lemtomap.topo.events import EdgeTraversed
from lemtomap.types import MapView, RouteGraph

AROUND_M = 0.9
"""What moves this near to the far side's line of a barrier belongs to it."""
MEMORY_S = 0.8
"""Something that was elsewhere this long ago moves."""


class EdgeClock:
    """Times the way from one associated node to the next."""

    def __init__(self) -> None:
        self._node_id: int | None = None
        self._since_s = 0.0
        self._fair = False

    def step(
        self, associated_id: int, graph: RouteGraph, now_s: float, *, driving: bool
    ) -> EdgeTraversed | None:
        """Return the edge just driven, if the robot drove all the way without waiting."""
        if associated_id == self._node_id:
            self._fair = self._fair and driving
            return None
        before, since_s, fair = self._node_id, self._since_s, self._fair
        self._node_id, self._since_s, self._fair = associated_id, now_s, driving
        if before is None or not fair or not driving:
            return None
        for edge in graph.edges_of(before):
            if edge.other_id == associated_id:
                return EdgeTraversed(before, associated_id, now_s - since_s)
        return None


class BarrierWatch:
    """Decides when the barrier on the route is to be believed: still for a while, or moving for too long."""

    def __init__(self, config: RecoveryConfig) -> None:
        self._config = config
        self._edge_id: int | None = None
        self._first_s = 0.0
        self._still_s = 0.0
        self._older: Costs | None = None
        self._newer: Costs | None = None

    def reset(self) -> None:
        """The route is open."""
        self._edge_id = None

    def remember(self, costs: Costs) -> None:
        """Keep a costmap from about MEMORY_S ago to compare with."""
        if self._newer is None or costs.stamp_s - self._newer.stamp_s >= MEMORY_S:
            self._older, self._newer = self._newer, costs

    def closed(self, barrier: Barrier, costs: Costs, *, near: bool) -> bool:
        """Take the barrier seen now; True once it is to be treated as closed.

        near: the robot stands before it; only then does waiting for something that moves run out.
        """
        now_s = costs.stamp_s
        if barrier.edge_id != self._edge_id:
            self._edge_id, self._first_s, self._still_s = barrier.edge_id, now_s, now_s
        if self.moving(barrier, costs):
            self._still_s = now_s
        if not near:
            self._first_s = now_s
        if now_s - self._still_s >= self._config.closed_after_s:
            return True
        return near and now_s - self._first_s >= self._config.polite_wait_s

    def moving(self, barrier: Barrier, costs: Costs) -> bool:
        """Tell whether obstacles around the barrier stand where none stood a moment ago."""
        old = self._older
        if old is None or old.state.shape != costs.state.shape:
            return False
        row, col = costs.cell(np.add(barrier.p_near_grid, barrier.p_far_grid) / 2.0)
        radius = AROUND_M / costs.resolution_m
        rows, cols = np.nonzero(costs.state == kernels.LETHAL)
        close = np.hypot(rows + 0.5 - row, cols + 0.5 - col) <= radius
        shift_col, shift_row = (np.array(costs.origin_m) - np.array(old.origin_m)) / costs.resolution_m
        r, c = rows[close] + round(shift_row), cols[close] + round(shift_col)
        inside = (r >= 0) & (c >= 0) & (r < old.state.shape[0]) & (c < old.state.shape[1])
        fresh = old.clearance[r[inside], c[inside]] > 3.0
        return int(fresh.sum()) >= 3


Link = tuple[int, int, int]
"""Edge id and its two nodes."""


def links_cut(map_view: MapView, reach: Reach, border_m: float) -> list[Link]:
    """Return the edges in the window that join a place the robot can reach with one it cannot."""
    open_of: dict[int, bool] = {}
    for node_id, T_grid_node in map_view.T_grid_node.items():
        if reach.costs.holds(T_grid_node, border_m):
            open_of[node_id] = reach.nearest(T_grid_node, SNAP_M) is not None
    return [
        (edge_id, a, b)
        for edge_id, a, b, _ in map_view.edges
        if a in open_of and b in open_of and open_of[a] != open_of[b]
    ]


def links_open_again(closed: Container[int], map_view: MapView, reach: Reach) -> list[Link]:
    """Return the closed edges whose straight line the window now shows free and seen."""
    costs, places = reach.costs, map_view.T_grid_node
    opened = []
    for edge_id, a, b, _ in map_view.edges:
        if edge_id not in closed or a not in places or b not in places:
            continue
        start, end = costs.cell(places[a]), costs.cell(places[b])
        if kernels.worst_on_line(costs.cost, costs.state, *start, *end) == 0:
            opened.append((edge_id, a, b))
    return opened
