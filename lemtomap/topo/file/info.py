"""What a map holds, in numbers."""

from collections import Counter
from dataclasses import dataclass

from lemtomap.topo.file.store import TopoStore
from lemtomap.types import EdgeType

_PLACE_SIZES = (
    "SELECT count(*), coalesce(sum(length(boundary) + coalesce(length(descriptor), 0)), 0) FROM place"
)


@dataclass(frozen=True, slots=True)
class MapInfo:
    """Figures of one map file."""

    nodes: int
    edges: dict[str, int]
    """Number of edges by type."""
    components: int
    levels: dict[int, int]
    """Number of nodes by level."""
    names: dict[str, int]
    areas: int
    places: int
    """Nodes with localisation data."""
    place_bytes: int
    """Bytes of localisation data, descriptors included."""
    openings: dict[str, int]
    """Number of unexplored openings by state."""
    undoable: int
    edge_length_m: float
    """Length of all odometry edges: about the length of ways driven first."""
    file_bytes: int


def describe_map(store: TopoStore) -> MapInfo:
    """Count what a map holds; one pass over nodes and edges."""
    edges: Counter[str] = Counter({str(kind): 0 for kind in EdgeType})
    length_m = 0.0
    leader = {node.node_id: node.node_id for node in store.nodes()}
    for edge in store.edges():
        edges[str(edge.type)] += 1
        length_m += edge.length_m if edge.type is EdgeType.ODOMETRY else 0.0
        leader[_root(leader, edge.source_id)] = _root(leader, edge.target_id)
    ((places, place_bytes),) = store.query(_PLACE_SIZES)
    return MapInfo(
        nodes=len(leader),
        edges=dict(edges),
        components=sum(_root(leader, node_id) == node_id for node_id in leader),
        levels=dict(Counter(node.level for node in store.nodes())),
        names=store.names(),
        areas=len({node.area_id for node in store.nodes()}),
        places=places,
        place_bytes=place_bytes,
        openings=dict(Counter(str(opening.state) for opening in store.placeholders())),
        undoable=store.count("journal"),
        edge_length_m=length_m,
        file_bytes=store.path.stat().st_size,
    )


def _root(leader: dict[int, int], node_id: int) -> int:
    while leader[node_id] != node_id:
        leader[node_id] = leader[leader[node_id]]
        node_id = leader[node_id]
    return node_id
