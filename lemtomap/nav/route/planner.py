"""The topological planner: Dijkstra over relative edges, their lengths and learnt times (thesis, 3-5)."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from lemtomap.dijkstra import CheapestFirst, Settled, way_back
from lemtomap.errors import NoRoute
from lemtomap.nav.config import RouteConfig
from lemtomap.topo.graph import Quantity
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
    """Return the price of an edge."""
    return price_s(edge.time_s, edge.length_m, float(edge.proven), config)


def price_s(time_s: Quantity, length_m: Quantity, proven: Quantity, config: RouteConfig) -> Quantity:
    """Return the price of an edge, or of many in arrays of equal length.

    proven: 1 where driven or seen to be free, 0 where nobody knows. Learnt traversal time mixed with length
    over usual speed; what may be no way at all is a last resort.
    """
    share = config.learnt_weight
    usual_s = length_m / config.usual_speed_mps
    price: Quantity = config.unproven_s * (1.0 - proven) + share * time_s + (1.0 - share) * usual_s
    return price


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
    opens_s = math.inf

    def steps_from(node_id: int) -> Iterator[tuple[int, float, RouteEdge]]:
        nonlocal opens_s
        for edge in graph.edges_of(node_id):
            until_s = max(edge.blocked_until_s, closed.get(edge.edge_id, 0.0))
            if until_s > now_s:
                opens_s = min(opens_s, until_s)
            else:
                yield edge.other_id, edge_cost_s(edge, config), edge

    settled: dict[int, Settled[RouteEdge]] = {}
    for found in CheapestFirst(start_id, steps_from):
        settled[found.node_id] = found
        if found.node_id == goal_id:
            return Route(*way_back(settled, goal_id), found.cost)
    if opens_s < math.inf:
        wait_s = opens_s - now_s
        raise NoRoute(
            f"every way from node {start_id} to {goal_id} is closed; one is tried again in {wait_s:.0f} s"
        )
    raise NoRoute(f"nodes {start_id} and {goal_id} are not connected")
