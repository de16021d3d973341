"""Routes over maps of every size: small ones straight from the graph, large ones from flat arrays."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Protocol, runtime_checkable

import numpy as np

from lemtomap.nav.config import RouteConfig
from lemtomap.nav.route.fresh import FreshGraph
from lemtomap.nav.route.network import RouteNetwork
from lemtomap.nav.route.planner import Route, plan_route
from lemtomap.types import EdgeTable, MapView, RouteGraph


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
        graph: RouteGraph,
        map_view: MapView,
        goal_id: int,
        now_s: float,
        closed_until_s: Mapping[int, float],
    ) -> Route:
        """Return the cheapest open route from the associated node. Raises NoRoute with the reason."""
        start_id = map_view.associated_id
        fresh = FreshGraph(graph, map_view, self._config.usual_speed_mps)
        if isinstance(graph, BulkGraph) and graph.node_count() >= self._config.large_nodes:
            network = self._in_step(graph)
            network.put(table_of(fresh.newborn_edges()))
            return network.plan(start_id, goal_id, now_s, closed_until_s)
        return plan_route(fresh, start_id, goal_id, now_s, self._config, closed_until_s)

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


def table_of(rows: Sequence[tuple[int, int, int, float, float, float]]) -> EdgeTable:
    """Return the table of rows (edge id, source, target, length m, time s, blocked until s)."""
    edge_id, source, target, length_m, time_s, blocked_s = zip(*rows, strict=True) if rows else ((),) * 6
    return EdgeTable(
        np.array(edge_id, dtype=np.int64),
        np.array(source, dtype=np.int64),
        np.array(target, dtype=np.int64),
        np.array(length_m, dtype=np.float32),
        np.array(time_s, dtype=np.float32),
        np.array(blocked_s, dtype=np.float64),
    )
