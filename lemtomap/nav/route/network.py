"""The whole graph in flat arrays, for planning across maps of a million nodes.

IDs are dense and never reused, so they serve as indices; edges can be added and re-priced in place. A plan
is a tree of best ways towards the goal; when a way proves closed, an A* search led by that tree finds the
next best.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lemtomap.errors import NoRoute
from lemtomap.nav.config import RouteConfig
from lemtomap.nav.kernels import route as kernels
from lemtomap.nav.route.planner import Route, price_s
from lemtomap.types import EdgeTable, RouteEdge

Column = NDArray[Any]

FALLEN = 0.8
"""An edge that has become this much cheaper makes the tree of ways worth a new search."""


class RouteNetwork:
    """Plans over an EdgeTable; owned by the navigation thread."""

    def __init__(self, edges: EdgeTable, config: RouteConfig) -> None:
        self._config = config
        nodes = int(max(edges.source_id.max(initial=0), edges.target_id.max(initial=0))) + 1
        count = int(edges.edge_id.max(initial=0)) + 1
        self._first_arc = np.full(_room(nodes), -1, dtype=np.int32)
        self._next_arc = np.full(2 * _room(count), -1, dtype=np.int32)
        self._arc_to = np.full(2 * _room(count), -1, dtype=np.int32)
        self._length_m = np.zeros(_room(count), dtype=np.float32)
        self._time_s = np.zeros(_room(count), dtype=np.float32)
        self._open_price = np.full(_room(count), np.inf, dtype=np.float32)
        self._price = np.full(_room(count), np.inf, dtype=np.float32)
        """As open prices, but inf where closed: kept up to date, for there may be millions."""
        self._proven = np.ones(_room(count), dtype=bool)
        self._chained = np.zeros(_room(count), dtype=bool)
        self._blocked_s: dict[int, float] = {}
        """Edges the map holds closed, and until when."""
        self._closed: set[int] = set()
        """Edges that are inf in the prices now."""
        self._fallen = False
        """True: some price has fallen since the tree of ways was made."""
        self._reached = np.empty(0, dtype=np.float32)
        self._goal_id = -1
        self._to_go = np.empty(0, dtype=np.float32)
        self._via = np.empty(0, dtype=np.int32)
        self._final_s = 0.0
        self.put(edges)

    def put(self, edges: EdgeTable) -> None:
        """Add new edges and take over new times and blockings of known ones. Each edge comes once."""
        ids = edges.edge_id
        if not ids.size:
            return
        self._make_room(int(max(edges.source_id.max(), edges.target_id.max())), int(ids.max()))
        new = ~self._chained[ids]
        self._proven[ids] = True if edges.proven is None else edges.proven
        price = price_s(edges.time_s, edges.length_m, self._proven[ids].astype(np.float32), self._config)
        self._length_m[ids], self._time_s[ids] = edges.length_m, edges.time_s
        self._open_price[ids] = np.maximum(price, 1e-3)
        self._note_blocked(edges)
        open_now = ids[~np.isin(ids, list(self._closed))] if self._closed else ids
        self._fallen |= bool((self._open_price[open_now] < FALLEN * self._price[open_now]).any())
        self._price[open_now] = self._open_price[open_now]
        kernels.chain_arcs(
            edges.source_id[new].astype(np.int32),
            edges.target_id[new].astype(np.int32),
            ids[new].astype(np.int32),
            self._first_arc,
            self._next_arc,
            self._arc_to,
        )
        self._chained[ids] = True
        if new.any():
            self._goal_id = -1  # a shorter way may have appeared

    def _note_blocked(self, edges: EdgeTable) -> None:
        """Take over which of these edges the map holds closed."""
        shut = edges.blocked_until_s > 0.0
        if self._blocked_s:
            for edge_id in self._blocked_s.keys() & set(edges.edge_id[~shut].tolist()):
                del self._blocked_s[edge_id]
        pairs = zip(edges.edge_id[shut].tolist(), edges.blocked_until_s[shut].tolist(), strict=True)
        self._blocked_s.update(pairs)

    def renew(self, node_ids: Iterable[int], edges: EdgeTable) -> None:
        """Take over all edges that changed nodes have now; those they no longer have are gone for good."""
        still = set(edges.edge_id.tolist())
        for node_id in node_ids:
            arc = int(self._first_arc[node_id]) if node_id < self._first_arc.size else -1
            while arc >= 0:
                if arc >> 1 not in still:
                    self._open_price[arc >> 1] = self._price[arc >> 1] = np.inf
                    self._blocked_s.pop(arc >> 1, None)
                arc = int(self._next_arc[arc])
        self.put(edges)

    def plan(
        self, start_id: int, goal_id: int, now_s: float, closed_until_s: Mapping[int, float] | None = None
    ) -> Route:
        """Return the cheapest open route. Raises NoRoute with the reason.

        The first plan to a goal costs a search of the map; later ones, from elsewhere or around edges closed
        since, only a look at the nodes of the detour.
        """
        for node_id, role in ((start_id, "start"), (goal_id, "goal")):
            if not 0 <= node_id < self._first_arc.size or (
                self._first_arc[node_id] < 0 and start_id != goal_id
            ):
                raise NoRoute(f"{role} node {node_id} is not in the map")
        if start_id == goal_id:
            return Route((start_id,), (), 0.0)
        self._close(now_s, closed_until_s or {})
        if goal_id != self._goal_id or self._fallen:
            return self._plan_anew(start_id, goal_id)
        return self._plan_around(start_id, goal_id)

    def _close(self, now_s: float, closed_until_s: Mapping[int, float]) -> None:
        """Bring the prices up to which edges are closed now."""
        wanted = {edge_id for edge_id, until_s in self._blocked_s.items() if until_s > now_s}
        for edge_id, until_s in closed_until_s.items():
            if until_s > now_s and edge_id < self._price.size:
                wanted.add(edge_id)
        for edge_id in wanted - self._closed:
            self._price[edge_id] = np.inf
        for edge_id in self._closed - wanted:
            self._price[edge_id] = self._open_price[edge_id]
            self._fallen = True
        self._closed = wanted

    def _plan_anew(self, start_id: int, goal_id: int) -> Route:
        self._to_go = np.full(self._first_arc.size, np.inf, dtype=np.float32)
        self._via = np.full(self._first_arc.size, -1, dtype=np.int32)
        self._goal_id, self._fallen = goal_id, False
        self._final_s = kernels.way_to_goal(
            self._first_arc, self._next_arc, self._arc_to, self._price, goal_id, start_id,
            self._config.bucket_s, self._to_go, self._via,
        )  # fmt: skip
        if not np.isfinite(self._to_go[start_id]):
            self._goal_id = -1
            raise self._no_route(start_id, goal_id)
        arcs, node_id = [], start_id
        while node_id != goal_id:
            arcs.append(int(self._via[node_id]))
            node_id = int(self._arc_to[arcs[-1]])
        return self._route(start_id, arcs, float(self._to_go[start_id]))

    def _plan_around(self, start_id: int, goal_id: int) -> Route:
        size = self._first_arc.size
        if self._reached.size != size:
            self._reached = np.full(size, np.inf, dtype=np.float32)
        reached = self._reached
        came = np.empty(size, dtype=np.int32)
        touched = np.empty(size, dtype=np.int32)
        count = kernels.guided_way(
            self._first_arc, self._next_arc, self._arc_to, self._price, start_id, goal_id,
            self._to_go, self._final_s, reached, came, touched,
        )  # fmt: skip
        cost_s = float(reached[goal_id])
        reached[touched[: abs(count)]] = np.inf  # as it was found
        if count < 0:
            raise self._no_route(start_id, goal_id)
        arcs, node_id = [], goal_id
        while node_id != start_id:
            arcs.append(int(came[node_id]))
            node_id = int(self._arc_to[arcs[-1] ^ 1])
        return self._route(start_id, arcs[::-1], cost_s)

    def _route(self, start_id: int, arcs: list[int], cost_s: float) -> Route:
        nodes = (start_id, *(int(self._arc_to[arc]) for arc in arcs))
        edges = tuple(
            RouteEdge(
                arc >> 1,
                int(self._arc_to[arc]),
                float(self._length_m[arc >> 1]),
                float(self._time_s[arc >> 1]),
                self._blocked_s.get(arc >> 1, 0.0),
                bool(self._proven[arc >> 1]),
            )
            for arc in arcs
        )
        return Route(nodes, edges, cost_s)

    def _no_route(self, start_id: int, goal_id: int) -> NoRoute:
        shut = len(self._closed)
        if shut:
            return NoRoute(f"every way from node {start_id} to {goal_id} is closed ({shut} edges blocked)")
        return NoRoute(f"nodes {start_id} and {goal_id} are not connected")

    def _make_room(self, node_id: int, edge_id: int) -> None:
        if node_id >= self._first_arc.size:
            self._first_arc = _grown(self._first_arc, _room(node_id + 1), -1)
        if edge_id >= self._length_m.size:
            size = _room(edge_id + 1)
            self._next_arc = _grown(self._next_arc, 2 * size, -1)
            self._arc_to = _grown(self._arc_to, 2 * size, -1)
            self._length_m = _grown(self._length_m, size, 0.0)
            self._time_s = _grown(self._time_s, size, 0.0)
            self._open_price = _grown(self._open_price, size, np.inf)
            self._price = _grown(self._price, size, np.inf)
            self._proven = _grown(self._proven, size, fill=True)
            self._chained = _grown(self._chained, size, 0)


def _room(count: int) -> int:
    return count + count // 8 + 64


def _grown(array: Column, size: int, fill: float) -> Column:
    out = np.full(size, fill, dtype=array.dtype)
    out[: array.size] = array
    return out
