"""What others see of the map: immutable views of the robot's neighbourhood in the window's frame."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from lemtomap.topo.file.paging import PagedGraph
from lemtomap.topo.graph import route_edge
from lemtomap.topo.local import LocalMap
from lemtomap.types import (
    EdgeType,
    GridView,
    MapView,
    RouteEdge,
    SlamUpdate,
)


class Snapshots:
    """Takes views of the nodes that stand nearby; their edges are found again only when the map changed."""

    def __init__(self, graph: PagedGraph, local: LocalMap) -> None:
        self._graph = graph
        self._local = local
        self._key = (-1, -1)
        self._edges: list[tuple[int, int, int, EdgeType]] = []
        self._changed_key: tuple[int, frozenset[int]] = (-1, frozenset())
        self._changed_edges: Mapping[int, tuple[RouteEdge, ...]] = {}

    def take(
        self,
        now: tuple[SlamUpdate, GridView],
        associated_id: int,
        quality: float,
        *,
        lost: bool,
        particles: NDArray[np.float64] | None,
    ) -> MapView:
        """Return the neighbourhood as it is now; particles: float64 (N, 3), T_grid_base."""
        slam, grid = now
        poses = {node_id: standing.T_grid_node for node_id, standing in self._local.standings.items()}
        names = self._graph.store.names().items()
        return MapView(
            stamp_s=slam.stamp_s,
            grid=grid,
            T_grid_odom=slam.T_grid_odom,
            T_grid_base=slam.T_grid_base,
            associated_id=associated_id,
            T_grid_node=poses,
            edges=self._edges_at(associated_id),
            quality=quality,
            diversity=slam.diversity,
            lost=lost,
            particles=particles,
            names={node_id: name for name, node_id in names if node_id in poses},
            changed=self.changed(),
            graph_version=self._graph.store.version,
        )

    def changed(self) -> Mapping[int, tuple[RouteEdge, ...]]:
        """Return the edges of each node that changed since the file was written."""
        key = (self._graph.store.version, self._graph.store.uncommitted)
        if self._changed_key != key:
            self._changed_key = key
            self._changed_edges = {
                node_id: tuple(route_edge(edge, node_id) for edge in self._graph.edges_of(node_id))
                for node_id in sorted(key[1])
            }
        return self._changed_edges

    def _edges_at(self, associated_id: int) -> list[tuple[int, int, int, EdgeType]]:
        """Return (edge ID, source, target, type)."""
        key = (self._graph.store.version, associated_id)
        if self._key != key:
            self._key = key
            standings = self._local.standings
            self._edges = [
                (edge.edge_id, edge.source_id, edge.target_id, edge.type)
                for node_id in standings
                for edge in self._graph.edges_of(node_id)
                if edge.source_id == node_id and edge.target_id in standings
            ]
        return self._edges
