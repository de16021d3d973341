"""Thinning a known map: where passes lie on one another, the newer nodes may go (thesis, section 7-2).

A robot that drives through one building for years makes nodes beside nodes: it was lost, or its window had
drifted. A node goes when an older one stands next to it, no wall between, and every way that led over it is
as short without it. Named nodes stay, and those that somebody or something points at.
"""

import heapq
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from lemtomap.se2 import Pose
from lemtomap.topo.file.paging import PagedGraph, chain
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.graph import Edge, OpeningState, detour
from lemtomap.topo.place import decode_place

PRUNED_TO = "pruned_to"
"""Key of the newest node that was looked at; what a map held then is not gone through again."""


@dataclass(frozen=True, slots=True)
class PruneConfig:
    """When a node is one too many."""

    beside_m: float = 0.7  # an older node this near does for both: two thirds of the usual distance
    search_m: float = 15.0  # of way, within which the older one is looked for: a part just joined
    search_nodes: int = 300
    wall_m: float = 0.12  # a stored point this near to the line between two nodes is a wall
    longer: float = 0.05  # a way may become longer by this share of the straight line, no more


def prune(store: TopoStore, config: PruneConfig | None = None) -> list[int]:
    """Delete the redundant nodes among those made since the last time; return their IDs.

    Nobody else may write to the map meanwhile. Costs a millisecond or so for each new node.
    """
    config = config or PruneConfig()
    graph = PagedGraph(store)
    since, protected = int(store.meta(PRUNED_TO) or 0), _protected(store)
    newest_first = "SELECT id FROM node WHERE id > ? ORDER BY id DESC"
    fresh = [node_id for (node_id,) in store.query(newest_first, (since,))]
    gone = []
    for node_id in fresh:
        if node_id not in protected and _is_redundant(graph, node_id, config):
            ends = [edge.other(node_id) for edge in graph.edges_of(node_id)]
            store.delete_node(node_id)
            graph.forget(node_id, *ends)
            gone.append(node_id)
    if fresh:
        store.set_meta(PRUNED_TO, fresh[0])
        store.commit()
    return gone


def _protected(store: TopoStore) -> set[int]:
    """Return the nodes that a name, an opening, something felt or a block points at."""
    kept = set(store.names().values())
    kept |= {each.node_id for each in store.placeholders() if each.state is OpeningState.OPEN}
    kept |= {node_id for (node_id,) in store.query("SELECT node FROM mark")}
    for ends in store.query("SELECT source, target FROM edge WHERE blocked > 0"):
        kept |= set(ends)
    return kept


def _is_redundant(graph: PagedGraph, node_id: int, config: PruneConfig) -> bool:
    poses = chain(graph.reach(node_id, config.search_m, config.search_nodes))
    return any(
        not _wall_between(graph, node_id, T, config) for _, T in _older_beside(graph, node_id, poses, config)
    ) and _ways_stay(graph, node_id, config)


def _older_beside(
    graph: PagedGraph, node_id: int, poses: dict[int, Pose], config: PruneConfig
) -> Iterator[tuple[int, Pose]]:
    """Iterate over older nodes of the same level, with localisation data, next to a node."""
    level = graph.node(node_id).level
    for other_id, T_node_other in poses.items():
        near = other_id < node_id and np.hypot(T_node_other[0], T_node_other[1]) <= config.beside_m
        if near and graph.node(other_id).level == level and graph.store.place(other_id) is not None:
            yield other_id, T_node_other


def _wall_between(graph: PagedGraph, node_id: int, T_node_other: Pose, config: PruneConfig) -> bool:
    """Return True if stored obstacles of a node lie on the line to another; a node without data sees none.

    No window is left of a place seen long ago: its obstacles are points, no cells for first_on_line.
    """
    place = graph.store.place(node_id)
    if place is None:
        return False
    points = decode_place(place.boundary).points.astype(np.float64)
    return bool(len(points)) and float(_from_line_m(points, T_node_other[:2]).min()) <= config.wall_m


def _from_line_m(points: NDArray[np.float64], end: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distances of points, float64 (N, 2), from the line between the origin and an end."""
    share = np.clip(points @ end / max(float(end @ end), 1e-12), 0.0, 1.0)
    return np.asarray(np.hypot(*(points - share[:, None] * end).T))


def _ways_stay(graph: PagedGraph, node_id: int, config: PruneConfig) -> bool:
    """Return True if any two neighbours are as near to each other without a node, or nearly straight."""
    edges = list(graph.edges_of(node_id))
    straight = {edge.other(node_id): edge.seen_from(node_id)[:2] for edge in edges}
    over = {edge.other(node_id): _way_m(edge) for edge in edges}
    for a, b in combinations(sorted(over), 2):
        line_m = float(np.hypot(*(straight[a] - straight[b])))
        limit_m = max(over[a] + over[b] + 1e-3, (1.0 + config.longer) * line_m)
        if not _joined_without(graph, (a, b), node_id, limit_m):
            return False
    return True


def _joined_without(graph: PagedGraph, ends: tuple[int, int], without_id: int, limit_m: float) -> bool:
    """Return True if a way of at most this length joins two nodes without a third (Dijkstra)."""
    start, goal = ends
    queue, done = [(0.0, start)], {without_id}
    while queue:
        way_m, node_id = heapq.heappop(queue)
        if node_id == goal:
            return True
        if node_id in done:
            continue
        done.add(node_id)
        for edge in graph.edges_of(node_id):
            further_m = way_m + _way_m(edge)
            if edge.other(node_id) not in done and further_m <= limit_m:
                heapq.heappush(queue, (further_m, edge.other(node_id)))
    return False


def _way_m(edge: Edge) -> float:
    """Return the way to expect over an edge: a closure that nobody has driven may take a detour."""
    return edge.length_m * (detour(edge.type) if edge.time_s is None else 1.0)
