"""Nodes of a map in the order of their way from one of them."""

import heapq
from collections.abc import Iterator
from collections.abc import Set as AbstractSet

from lemtomap.types import RouteGraph


def ways_from(graph: RouteGraph, start_id: int, at_most: int = 100_000) -> Iterator[tuple[float, int]]:
    """Yield (way in metres over edges, node id), nearest first, for at most so many nodes."""
    done: set[int] = set()
    heap = [(0.0, start_id)]
    while heap and len(done) < at_most:
        length_m, node_id = heapq.heappop(heap)
        if node_id in done:
            continue
        done.add(node_id)
        yield length_m, node_id
        for edge in graph.edges_of(node_id):
            if edge.other_id not in done:
                heapq.heappush(heap, (length_m + edge.length_m, edge.other_id))


def nearest_of(graph: RouteGraph, start_id: int, node_ids: AbstractSet[int], now_s: float) -> int:
    """Return which of some nodes is reached soonest, over open ways if there are any."""
    done: set[int] = set()
    heap = [(0.0, 0.0, start_id)]
    while heap:
        closed, time_s, node_id = heapq.heappop(heap)
        if node_id in node_ids:
            return node_id
        if node_id in done:
            continue
        done.add(node_id)
        for edge in graph.edges_of(node_id):
            if edge.other_id not in done:
                barred = float(edge.blocked_until_s > now_s)  # a way through what is closed comes last
                heapq.heappush(heap, (closed + barred, time_s + edge.time_s, edge.other_id))
    return min(node_ids)


def farthest_node(graph: RouteGraph, start_id: int) -> int:
    """Return the node whose shortest way over edges from `start_id` is longest."""
    last = start_id
    for _, node_id in ways_from(graph, start_id):
        last = node_id
    return last
