"""Nodes of a map in the order of their way from one of them."""

from collections.abc import Iterator
from itertools import islice

from lemtomap.dijkstra import CheapestFirst
from lemtomap.types import RouteEdge, RouteGraph


def ways_from(graph: RouteGraph, start_id: int, at_most: int = 100_000) -> Iterator[tuple[float, int]]:
    """Yield (way in metres over edges, node id), nearest first, for at most so many nodes."""

    def steps_from(node_id: int) -> Iterator[tuple[int, float, RouteEdge]]:
        return ((edge.other_id, edge.length_m, edge) for edge in graph.edges_of(node_id))

    for found in islice(CheapestFirst(start_id, steps_from), at_most):
        yield found.cost, found.node_id


def farthest_node(graph: RouteGraph, start_id: int) -> int:
    """Return the node whose shortest way over edges from `start_id` is longest."""
    last = start_id
    for _, node_id in ways_from(graph, start_id):
        last = node_id
    return last
