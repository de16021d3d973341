"""Routes over maps of every size: small ones straight from the graph, large ones from flat arrays."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Protocol, runtime_checkable

import numpy as np

from lemtomap.nav.config import RouteConfig
from lemtomap.nav.route.fresh import FreshGraph
from lemtomap.nav.route.network import RouteNetwork
from lemtomap.nav.route.planner import Route, plan_route
from lemtomap.types import EdgeTable, RouteEdge


@runtime_checkable
class BulkGraph(Protocol):
    """A RouteGraph that can hand out many edges at once."""

    @property
    def version(self) -> int:
        """As in RouteGraph."""
        ...

    def node_count(self) -> int:
        """Return how many nodes the map has."""
        ...

    def edge_table(self, node_ids: Iterable[int] | None = None) -> EdgeTable:
        """Return all edges, or those at some nodes."""
        ...

    def changed_since(self, version: int) -> Sequence[int] | None:
        """Return the nodes whose edges changed after a version; None when that is too long ago to tell."""
        ...


class RoutePlanner:
    """Plans routes; keeps the flat copy of a large graph in step with it. One for each navigation thread."""

    def __init__(self, config: RouteConfig) -> None:
        self._config = config
        self._network: RouteNetwork | None = None
        self._source: BulkGraph | None = None
        self._version = 0

    def plan(
        self,
        graph: FreshGraph,
        start_id: int,
        goal_id: int,
        now_s: float,
        closed_until_s: Mapping[int, float],
    ) -> Route:
        """Return the cheapest open route. Raises NoRoute with the reason."""
        stored = graph.stored
        if isinstance(stored, BulkGraph) and stored.node_count() >= self._config.large_nodes:
            network = self._in_step(stored)
            network.renew(graph.changed, table_of(graph.changed))
            return network.plan(start_id, goal_id, now_s, closed_until_s)
        return plan_route(graph, start_id, goal_id, now_s, self._config, closed_until_s)

    def _in_step(self, graph: BulkGraph) -> RouteNetwork:
        """Return the flat copy, brought up to the graph's version."""
        version = graph.version
        network = self._network
        if network is not None and self._source is graph and version != self._version:
            changed = graph.changed_since(self._version)
            if changed is None:
                network = None
            else:
                network.renew(changed, graph.edge_table(changed))
        if network is None or self._source is not graph:
            network = RouteNetwork(graph.edge_table(), self._config)
        self._network, self._source, self._version = network, graph, version
        return network


def table_of(edges_of: Mapping[int, Sequence[RouteEdge]]) -> EdgeTable:
    """Return the edges at some nodes in columns, each once."""
    found = {edge.edge_id: (node_id, edge) for node_id, edges in edges_of.items() for edge in edges}
    edges = [edge for _, edge in found.values()]
    return EdgeTable(
        np.array(list(found), dtype=np.int64),
        np.array([node_id for node_id, _ in found.values()], dtype=np.int64),
        np.array([edge.other_id for edge in edges], dtype=np.int64),
        np.array([edge.length_m for edge in edges], dtype=np.float32),
        np.array([edge.time_s for edge in edges], dtype=np.float32),
        np.array([edge.blocked_until_s for edge in edges], dtype=np.float64),
        np.array([edge.proven for edge in edges], dtype=np.bool_),
    )
