"""What a wrong closure leaves in the graph besides itself, and how it is mended.

A robot that takes a place for another goes on from there: nodes born since hang on nodes that are elsewhere.
The window has held the robot's own trail all the while, so the nodes born in it are joined to one another
again and let go of what only the closure said was near.
"""

from collections.abc import Sequence

from lemtomap.se2 import between
from lemtomap.topo.file.paging import PagedGraph
from lemtomap.topo.graph import Covariance, Edge
from lemtomap.topo.local import LocalMap
from lemtomap.types import EdgeType


def take_back(graph: PagedGraph, local: LocalMap, edge_ids: Sequence[int], floor: Covariance) -> bool:
    """Delete closures and what grew from them; tell whether there was any.

    `floor`: least covariance of an edge, float64 (3, 3).
    """
    edges = [edge for edge_id in edge_ids if (edge := graph.store.edge(edge_id)) is not None]
    for edge in edges:
        graph.delete_edge(edge)
    if edges:
        local.release_matched()
        _cut_off(graph, local, min(edge.edge_id for edge in edges), floor)
    return bool(edges)


def _cut_off(graph: PagedGraph, local: LocalMap, since_edge_id: int, floor: Covariance) -> None:
    """Part the nodes born in this window from all others as far as edges made since a closure join them."""
    born = sorted(n for n, standing in local.standings.items() if standing.born and standing.anchored)
    own, parted = set(born), set()
    for node_id in born:
        for edge in graph.edges_of(node_id):
            if edge.edge_id > since_edge_id and edge.other(node_id) not in own:
                graph.delete_edge(edge)
                parted.add(node_id)
    for k, node_id in enumerate(born[1:], start=1):
        if node_id in parted and not any(edge.other(node_id) in born[:k] for edge in graph.edges_of(node_id)):
            _join(graph, local, born[k - 1], node_id, floor)


def _join(graph: PagedGraph, local: LocalMap, from_id: int, node_id: int, floor: Covariance) -> None:
    """Join a node to the one born before it, from which the robot came, by where both stand in the window."""
    here = local.standings[node_id]
    T_from_node = between(local.standings[from_id].T_grid_node, here.T_grid_node)
    graph.add_edge(Edge(0, from_id, node_id, T_from_node, here.covariance + floor, EdgeType.ODOMETRY))
