"""The route graph with what is newest in the view: the mapper commits to its file only now and then."""

from collections.abc import Sequence

import numpy as np

from lemtomap.types import MapView, RouteEdge, RouteGraph

NEWEST = 4
"""IDs grow, so only the largest few of the view can be missing from the file."""


class FreshGraph:
    """A RouteGraph that joins a map view's newborn nodes, and new edges at them, to the graph on file.

    A robot that has just been found in the map stands at a node that one new edge alone joins to the rest.
    """

    def __init__(self, graph: RouteGraph, map_view: MapView, usual_speed_mps: float) -> None:
        self._graph = graph
        newest = {*sorted(map_view.T_grid_node)[-NEWEST:], map_view.associated_id}
        self._newborn = {node_id for node_id in newest if not graph.has_node(node_id)}
        known = {edge.edge_id for node_id in newest - self._newborn for edge in graph.edges_of(node_id)}
        self._extra: dict[int, list[RouteEdge]] = {}
        self._rows: list[tuple[int, int, int, float, float, float]] = []
        for edge_id, a, b, _ in map_view.edges:
            if edge_id in known or not (a in newest or b in newest):
                continue
            length_m = float(np.hypot(*(map_view.T_grid_node[a] - map_view.T_grid_node[b])[:2]))
            self._rows.append((edge_id, a, b, length_m, length_m / usual_speed_mps, 0.0))
            for here, other in ((a, b), (b, a)):
                edge = RouteEdge(edge_id, other, length_m, length_m / usual_speed_mps)
                self._extra.setdefault(here, []).append(edge)

    @property
    def version(self) -> int:
        """The version of the graph on file."""
        return self._graph.version

    def newborn_edges(self) -> list[tuple[int, int, int, float, float, float]]:
        """Return the edges that are not on file yet: id, two nodes, length m, time s, blocked until s."""
        return self._rows

    def has_node(self, node_id: int) -> bool:
        """Return True if the file or the view knows this node."""
        return node_id in self._newborn or self._graph.has_node(node_id)

    def edges_of(self, node_id: int) -> Sequence[RouteEdge]:
        """Return the edges at a node, of the file and of the view."""
        known = () if node_id in self._newborn else self._graph.edges_of(node_id)
        extra = self._extra.get(node_id)
        return known if extra is None else [*known, *extra]
