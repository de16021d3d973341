"""Watching edges: how long each takes to drive, and whether a barrier across one is a door or a person."""

import math
from collections import deque
from collections.abc import Container

import numpy as np

from lemtomap.kernels.lines import first_on_line
from lemtomap.nav.config import RecoveryConfig
from lemtomap.nav.kernels import fields as kernels
from lemtomap.nav.motion.metric import Reach
from lemtomap.nav.route.barriers import Barrier, cut_at
from lemtomap.nav.route.sliding import SNAP_M
from lemtomap.nav.types import Points
from lemtomap.topo.events import EdgeTraversed
from lemtomap.types import MapView, RouteGraph

AROUND_M = 0.9
"""What moves this near to the far side's line of a barrier belongs to it."""
MEMORY_S = 0.8
"""Something that was elsewhere this long ago moves ..."""
MOVED_M = 0.10
"""... if it was elsewhere by this much: more than the noise of a URG-04LX."""
MOVED_HITS = 4
SEEN_M = 0.2
"""A hit this near to a barrier's middle shows that it still stands there; a door's posts are further off."""
SAME_BARRIER_M = 0.8
"""Obstacles on two edges this near to one another are one door, one chair, one person."""


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
        self._met = False
        """True: the sensors have hit the barrier under suspicion, or the robot stands before it."""
        self._first_s = 0.0
        self._still_s = 0.0
        self._past: deque[tuple[float, Points]] = deque()

    @property
    def watching(self) -> bool:
        """True while a barrier is under suspicion."""
        return self._edge_id is not None

    def reset(self) -> None:
        """The route is open."""
        self._edge_id = None

    def remember(self, hits_grid: Points, now_s: float) -> None:
        """Keep what the sensors hit over the last second, to compare with; float64 (N, 2), metres."""
        self._past.append((now_s, hits_grid))
        while now_s - self._past[0][0] > MEMORY_S:
            self._past.popleft()

    def closed(self, barrier: Barrier, now_s: float, *, near: bool) -> bool:
        """Take the barrier seen now; True once it is to be treated as closed.

        near: the robot stands before it; only then does waiting for something that moves run out.
        From afar only what the sensors have hit since is believed: the window remembers doors that opened.
        """
        if barrier.edge_id != self._edge_id:
            self._edge_id, self._first_s, self._still_s = barrier.edge_id, now_s, now_s
            self._met = False
        self._met = self._met or near or self._seen(barrier)
        if self.moving(barrier) or not self._met:
            self._still_s = now_s
        if not near:
            self._first_s = now_s
        if now_s - self._still_s >= self._config.closed_after_s:
            return True
        return near and now_s - self._first_s >= self._config.polite_wait_s

    def _seen(self, barrier: Barrier) -> bool:
        """Return True if the newest hits show something at the barrier."""
        return bool(self._past) and bool(len(_around(self._past[-1][1], barrier, SEEN_M)))

    def moving(self, barrier: Barrier) -> bool:
        """Return True if around the barrier something is hit where nothing was hit a moment ago."""
        if len(self._past) < 2:
            return False
        (_, old), (_, new) = self._past[0], self._past[-1]
        new, old = _around(new, barrier, AROUND_M), _around(old, barrier, AROUND_M + 0.5)
        if len(new) < MOVED_HITS or not len(old):
            return False
        away_m = np.sqrt(((new[:, None, :] - old[None, :, :]) ** 2).sum(axis=-1).min(axis=1))
        return int((away_m > MOVED_M).sum()) >= MOVED_HITS


def _around(points_grid: Points, barrier: Barrier, radius_m: float) -> Points:
    away_m = np.hypot(*(points_grid - np.array(barrier.p_middle_grid)).T)
    return np.asarray(points_grid[away_m <= radius_m])


Link = tuple[int, int, int]
"""Edge id and its two nodes."""


def links_cut(map_view: MapView, reach: Reach, barrier: Barrier, border_m: float) -> list[Link]:
    """Return the edges in the window that the same barrier cuts.

    These join a place the robot can reach with one it cannot, or have an obstacle on their line right there.
    """
    open_of: dict[int, bool] = {}
    for node_id, T_grid_node in map_view.T_grid_node.items():
        if reach.costs.holds(T_grid_node, border_m):
            open_of[node_id] = reach.nearest(T_grid_node, SNAP_M) is not None
    return [
        (edge_id, a, b)
        for edge_id, a, b, _ in map_view.edges
        if a in open_of
        and b in open_of
        and (open_of[a] != open_of[b] or _cut_there(a, b, map_view, reach, barrier))
    ]


def _cut_there(a: int, b: int, map_view: MapView, reach: Reach, barrier: Barrier) -> bool:
    stands = cut_at(reach.costs, map_view.T_grid_node[a], map_view.T_grid_node[b])
    return stands is not None and math.dist(stands, barrier.p_middle_grid) < SAME_BARRIER_M


def links_open_again(closed: Container[int], map_view: MapView, reach: Reach) -> list[Link]:
    """Return the closed edges whose straight line the window now shows free and seen."""
    costs, places = reach.costs, map_view.T_grid_node
    opened = []
    for edge_id, a, b, _ in map_view.edges:
        if edge_id not in closed or a not in places or b not in places:
            continue
        line = (*costs.cell(places[a]), *costs.cell(places[b]))
        seen = math.isinf(first_on_line(costs.state, *line, kernels.UNKNOWN, kernels.UNKNOWN))
        if seen and costs.fits_between(places[a], places[b]):
            opened.append((edge_id, a, b))
    return opened
