"""What driving teaches the map: how long edges take, which are closed, where something was felt."""

from dataclasses import replace

import numpy as np

from lemtomap.se2 import Pose, transform
from lemtomap.topo.events import (
    Bumped,
    EdgeBlocked,
    EdgeTraversed,
    GroundSeen,
    NavEvent,
    OpeningDone,
    OpeningSeen,
)
from lemtomap.topo.file.paging import PagedGraph
from lemtomap.topo.graph import Mark, OpeningState, Placeholder

NEWEST_SHARE = 0.3  # of a traversal time in the learnt one: follows a changed habit within some five drives


def learn(event: NavEvent, graph: PagedGraph, associated_id: int, T_node_base: Pose) -> None:
    """Write one of navigation's events into the map; events about what is no longer there are dropped."""
    match event:
        case EdgeTraversed(from_id, to_id, time_s):
            _learn_time(graph, from_id, to_id, time_s)
        case EdgeBlocked(from_id, to_id, until_s):
            edge = graph.edge_between(from_id, to_id)
            if edge is not None:
                graph.put_edge(replace(edge, blocked_until_s=until_s))
        case Bumped(kind, x_base_m, y_base_m, stamp_s):
            x, y = transform(T_node_base, np.array([x_base_m, y_base_m]))
            graph.store.add_mark(Mark(0, associated_id, kind, float(x), float(y), stamp_s))
        case OpeningSeen(number, node_id, x_m, y_m, yaw_rad, width_m):
            graph.store.put_placeholder(Placeholder(number, node_id, x_m, y_m, yaw_rad, width_m))
        case GroundSeen(node_id, picture):
            if graph.store.node(node_id) is not None:
                graph.store.put_ground(node_id, picture)
        case OpeningDone(number, closed):
            graph.store.end_placeholder(number, OpeningState.CLOSED if closed else OpeningState.EXPLORED)


def _learn_time(graph: PagedGraph, from_id: int, to_id: int, time_s: float) -> None:
    edge = graph.edge_between(from_id, to_id)
    if edge is None or not time_s > 0.0:
        return
    known_s = time_s if edge.time_s is None else edge.time_s
    graph.put_edge(replace(edge, time_s=(1.0 - NEWEST_SHARE) * known_s + NEWEST_SHARE * time_s))
