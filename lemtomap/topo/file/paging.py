"""The part of the map near the robot, in memory; the rest stays on disk until the robot comes near."""

import heapq
import math
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from lemtomap.se2 import Pose, compose
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.graph import DirectedEdge, Edge, Node

MICRO = 1e6  # lengths in whole micrometres: equal ways tie, in whatever frame they were measured
LEGS_PER_NODE = 4  # legs are kept of so many times the nodes: in plain numbers they are small


class Reached(NamedTuple):
    """A node within reach, and how it was reached."""

    node_id: int
    distance_m: float
    """Topological distance: length of the shortest way over edges."""
    via: Edge | None
    """Last edge of that way; None at the start."""


class PagedGraph:
    """Nodes and edges by ID, read through to the store, at most `capacity` nodes in memory.

    All changes go through here, so that memory and file never differ.
    """

    def __init__(self, store: TopoStore, capacity: int = 4096) -> None:
        self.store = store
        self._capacity = capacity
        self._nodes: OrderedDict[int, Node] = OrderedDict()
        self._edges: OrderedDict[int, tuple[Edge, ...]] = OrderedDict()
        self._ways: dict[int, list[tuple[int, int, Edge]]] = {}
        """Other end, length (um) and edge, of nodes in memory that were asked for their ways."""
        self._legs: OrderedDict[int, tuple[DirectedEdge, ...]] = OrderedDict()

    def node(self, node_id: int) -> Node:
        """Return a node. Raises KeyError for one the map does not have."""
        node = self._nodes.get(node_id)
        if node is None:
            node = self.store.node(node_id)
            if node is None:
                raise KeyError(node_id)
            self._keep_node(node)
        return node

    def edges_of(self, node_id: int) -> Sequence[Edge]:
        """Return the edges at a node; empty for an unknown one."""
        edges = self._edges.get(node_id)
        if edges is None:
            edges = tuple(self.store.edges_of(node_id))
            self._keep_edges(node_id, edges)
        else:
            self._edges.move_to_end(node_id)
        return edges

    def legs_of(self, node_id: int) -> Sequence[DirectedEdge]:
        """Return the edges at a node as seen from it, in the order of `edges_of`."""
        legs = self._legs.get(node_id)
        if legs is None:
            legs = tuple(DirectedEdge.along(edge, node_id) for edge in self.edges_of(node_id))
            self._legs[node_id] = legs
            if len(self._legs) > LEGS_PER_NODE * self._capacity:
                self._legs.popitem(last=False)
        else:
            self._legs.move_to_end(node_id)
        return legs

    def edge_between(self, a: int, b: int) -> Edge | None:
        """Return an edge that joins two nodes, None when there is none."""
        return next((edge for edge in self.edges_of(a) if edge.other(a) == b), None)

    def add_node(self, *, area_id: int = 1, level: int = 0, created_s: float = 0.0) -> Node:
        """Make a new node."""
        node = self.store.add_node(area_id=area_id, level=level, created_s=created_s)
        self._keep_node(node)
        self._keep_edges(node.node_id, ())
        return node

    def put_node(self, node: Node) -> None:
        """Write a changed node."""
        self.store.put_node(node)
        self._keep_node(node)

    def add_edge(self, edge: Edge) -> Edge:
        """Write a new edge; returns it with its ID."""
        ends = {end: self.edges_of(end) for end in (edge.source_id, edge.target_id)}
        edge = self.store.add_edge(edge)
        for end, edges in ends.items():
            self._legs.pop(end, None)
            self._keep_edges(end, (*edges, edge))
        return edge

    def put_edge(self, edge: Edge) -> None:
        """Write a changed edge."""
        self.store.put_edge(edge)
        self.forget(edge.source_id, edge.target_id)

    def delete_edge(self, edge: Edge) -> None:
        """Remove an edge."""
        self.store.delete_edge(edge.edge_id)
        self.forget(edge.source_id, edge.target_id)

    def forget(self, *node_ids: int) -> None:
        """Drop nodes from memory; they are read again when needed."""
        for node_id in node_ids:
            self._nodes.pop(node_id, None)
            self._edges.pop(node_id, None)
            self._ways.pop(node_id, None)
            self._legs.pop(node_id, None)

    def reach(self, start_id: int, radius_m: float, limit: int = 1 << 30) -> dict[int, Reached]:
        """Return the nodes within a topological distance of one node, nearest first (Dijkstra).

        A loop of its own beside dijkstra.CheapestFirst: every scan asks, and equal ways must tie in whatever
        frame they were measured.
        Holds: a node's `via` comes from a node earlier in the result.
        """
        reached: dict[int, Reached] = {}
        queue: list[tuple[int, int, int, Edge | None]] = [(0, 0, start_id, None)]
        best = {start_id: 0}
        pushed, radius_um = 0, math.floor(radius_m * MICRO)
        beyond_um = radius_um + 1
        while queue and len(reached) < limit:
            distance_um, _, node_id, via = heapq.heappop(queue)
            if node_id in reached:
                continue
            reached[node_id] = Reached(node_id, distance_um / MICRO, via)
            for other_id, length_um, edge in self._ways_from(node_id):
                further_um = distance_um + length_um
                if further_um < best.get(other_id, beyond_um):
                    best[other_id] = further_um
                    pushed += 1
                    heapq.heappush(queue, (further_um, pushed, other_id, edge))
        return reached

    def _ways_from(self, node_id: int) -> list[tuple[int, int, Edge]]:
        ways = self._ways.get(node_id)
        if ways is None:
            edges = self.edges_of(node_id)
            ways = [(edge.other(node_id), round(MICRO * edge.length_m), edge) for edge in edges]
            self._ways[node_id] = ways
        return ways

    def _keep_node(self, node: Node) -> None:
        self._nodes[node.node_id] = node
        self._nodes.move_to_end(node.node_id)
        while len(self._nodes) > self._capacity:
            self._nodes.popitem(last=False)

    def _keep_edges(self, node_id: int, edges: tuple[Edge, ...]) -> None:
        self._edges[node_id] = edges
        self._edges.move_to_end(node_id)
        self._ways.pop(node_id, None)
        while len(self._edges) > self._capacity:
            dropped_id, _ = self._edges.popitem(last=False)
            self._ways.pop(dropped_id, None)


def chain(reached: Mapping[int, Reached]) -> dict[int, Pose]:
    """Return the pose of every reached node in the frame of the start."""
    poses: dict[int, Pose] = {}
    for node_id, way in reached.items():
        if way.via is None:
            poses[node_id] = np.zeros(3)
        else:
            before = way.via.other(node_id)
            poses[node_id] = compose(poses[before], way.via.seen_from(before))
    return poses
