"""Nodes of a map in the order of their way from one of them."""

from collections.abc import Iterator
from collections.abc import Set as AbstractSet
from itertools import islice

from lemtomap.dijkstra import CheapestFirst
from lemtomap.types import RouteEdge, RouteGraph

SHUT_S = 1e9  # a way through what is closed comes after all open ones


def ways_from(graph: RouteGraph, start_id: int, at_most: int = 100_000) -> Iterator[tuple[float, int]]:
    """Yield (way in metres over edges, node id), nearest first, for at most so many nodes."""

    def steps_from(node_id: int) -> Iterator[tuple[int, float, RouteEdge]]:
        return ((edge.other_id, edge.length_m, edge) for edge in graph.edges_of(node_id))

    for found in islice(CheapestFirst(start_id, steps_from), at_most):
        yield found.cost, found.node_id


def nearest_of(graph: RouteGraph, start_id: int, node_ids: AbstractSet[int], now_s: float) -> int:
    """Return which of some nodes is reached soonest, over open ways if there are any."""

    def steps_from(node_id: int) -> Iterator[tuple[int, float, RouteEdge]]:
        for edge in graph.edges_of(node_id):
            yield edge.other_id, edge.time_s + (SHUT_S if edge.blocked_until_s > now_s else 0.0), edge

    found = (settled.node_id for settled in CheapestFirst(start_id, steps_from))
    return next((node_id for node_id in found if node_id in node_ids), min(node_ids))


def farthest_node(graph: RouteGraph, start_id: int) -> int:
    """Return the node whose shortest way over edges from `start_id` is longest."""
    last = start_id
    for _, node_id in ways_from(graph, start_id):
        last = node_id
    return last
