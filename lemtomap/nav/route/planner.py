"""The topological planner: Dijkstra over relative edges, their lengths and learnt times (thesis, 3-5)."""

import heapq
from collections.abc import Mapping
from dataclasses import dataclass

from lemtomap.errors import NoRoute
from lemtomap.nav.config import RouteConfig
from lemtomap.types import RouteEdge, RouteGraph


@dataclass(frozen=True, slots=True)
class Route:
    """Nodes from here to the goal. Holds: len(nodes) == len(edges) + 1."""

    nodes: tuple[int, ...]
    edges: tuple[RouteEdge, ...]
    cost_s: float

    @property
    def length_m(self) -> float:
        """Length along the edges."""
        return sum(edge.length_m for edge in self.edges)

    @property
    def time_s(self) -> float:
        """Expected time along the edges."""
        return sum(edge.time_s for edge in self.edges)

    def since(self, node_id: int) -> "Route":
        """Return the rest of the route from one of its nodes on."""
        at = self.nodes.index(node_id)
        return self if at == 0 else Route(self.nodes[at:], self.edges[at:], self.cost_s)


def edge_cost_s(edge: RouteEdge, config: RouteConfig) -> float:
    """Mix learnt traversal time with length over usual speed; what may be no way at all is a last resort."""
    doubt_s = 0.0 if edge.proven else config.unproven_s
    return (
        doubt_s
        + config.learnt_weight * edge.time_s
        + (1.0 - config.learnt_weight) * (edge.length_m / config.usual_speed_mps)
    )


def plan_route(
    graph: RouteGraph,
    start_id: int,
    goal_id: int,
    now_s: float,
    config: RouteConfig,
    closed_until_s: Mapping[int, float] | None = None,
) -> Route:
    """Return the cheapest open route.

    closed_until_s: edges the navigator itself found closed, by edge id, before the map says so.
    Raises NoRoute with the reason: unknown node, no connection, or every way closed (and when one opens).
    """
    closed = closed_until_s or {}
    for node_id, role in ((start_id, "start"), (goal_id, "goal")):
        if not graph.has_node(node_id):
            raise NoRoute(f"{role} node {node_id} is not in the map")
    best_s = {start_id: 0.0}
    came: dict[int, tuple[int, RouteEdge]] = {}
    settled: set[int] = set()
    heap = [(0.0, start_id)]
    opens_s = float("inf")
    while heap:
        cost_s, node_id = heapq.heappop(heap)
        if node_id == goal_id:
            return _trace(came, start_id, goal_id, cost_s)
        if node_id in settled:
            continue
        settled.add(node_id)
        for edge in graph.edges_of(node_id):
            until_s = max(edge.blocked_until_s, closed.get(edge.edge_id, 0.0))
            if until_s > now_s:
                opens_s = min(opens_s, until_s)
                continue
            other_s = cost_s + edge_cost_s(edge, config)
            if other_s < best_s.get(edge.other_id, float("inf")):
                best_s[edge.other_id] = other_s
                came[edge.other_id] = (node_id, edge)
                heapq.heappush(heap, (other_s, edge.other_id))
    if opens_s < float("inf"):
        wait_s = opens_s - now_s
        raise NoRoute(
            f"every way from node {start_id} to {goal_id} is closed; one is tried again in {wait_s:.0f} s"
        )
    raise NoRoute(f"nodes {start_id} and {goal_id} are not connected")


def _trace(came: Mapping[int, tuple[int, RouteEdge]], start_id: int, goal_id: int, cost_s: float) -> Route:
    nodes, edges = [goal_id], []
    while nodes[-1] != start_id:
        before_id, edge = came[nodes[-1]]
        nodes.append(before_id)
        edges.append(edge)
    return Route(tuple(reversed(nodes)), tuple(reversed(edges)), cost_s)
