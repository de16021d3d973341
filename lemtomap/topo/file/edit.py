"""Changing a map by hand. Every edit is one entry of the journal; `undo` takes the newest back.

All functions raise BadInput, naming what is not there, before anything is written.
"""

from dataclasses import replace

from lemtomap.errors import BadInput
from lemtomap.topo import naming
from lemtomap.topo.file.checks import MOST_LEVEL
from lemtomap.topo.file.journal import recorded, undo
from lemtomap.topo.file.paging import PagedGraph
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.graph import FOR_EVER_S, Edge, Node

__all__ = [
    "block_between",
    "block_edge",
    "delete_edge",
    "delete_node",
    "name_node",
    "resolve_node",
    "set_level",
    "undo",
    "unname",
]


def resolve_node(store: TopoStore, text: str) -> int:
    """Return the node a person means by its number or its name."""
    names = store.names()
    node_id = naming.node_meant(text, names, lambda number: store.node(number) is not None)
    if node_id is None:
        instead = naming.told_instead(text, names)
        raise BadInput(f"{store.path}: no node or name '{naming.shown(text)}' ({instead})")
    return node_id


def name_node(store: TopoStore, node_id: int, name: str, stamp_s: float = 0.0) -> None:
    """Give a node a name; a name it had goes, and so does the name from any other node."""
    _node(store, node_id)
    fault = naming.fault(name)
    if fault is not None:
        raise BadInput(f"'{naming.shown(name)}' cannot be a name: {fault}")
    for (area_id,) in store.query("SELECT id FROM area WHERE name = ?", (name,)):
        raise BadInput(f"{store.path}: '{naming.shown(name)}' is the name of area {area_id} already")
    owner = store.names().get(name, node_id)
    moved = f", until then node {owner}" if owner != node_id else ""
    with recorded(store, f"name node {node_id} '{name}'{moved}", stamp_s) as recording:
        recording.touch_where("name", "node", node_id)
        recording.touch("name", name)
        store.write("DELETE FROM name WHERE node = ?", (node_id,))
        store.set_name(name, node_id)


def unname(store: TopoStore, name: str, stamp_s: float = 0.0) -> None:
    """Take a name away; one that does not print may be given as it is shown."""
    names = store.names()
    meant = naming.name_meant(name, names)
    if meant is None:
        instead = naming.told_instead(name, names)
        raise BadInput(f"{store.path}: no name '{naming.shown(name)}' ({instead})")
    name = meant
    with recorded(store, f"take name '{naming.shown(name)}' away", stamp_s) as recording:
        recording.touch("name", name)
        store.write("DELETE FROM name WHERE name = ?", (name,))


def delete_node(store: TopoStore, node_id: int, stamp_s: float = 0.0) -> None:
    """Delete a node with its edges, name and localisation data."""
    _node(store, node_id)
    with recorded(store, f"delete node {node_id}", stamp_s) as recording:
        recording.touch("node", node_id)
        recording.touch("place", node_id)
        for end in ("source", "target"):
            recording.touch_where("edge", end, node_id)
        for table in ("name", "placeholder", "ground", "mark", "door"):
            recording.touch_where(table, "node", node_id)
        for edge in store.edges_of(node_id):
            recording.touch("door_edge", edge.edge_id)
        store.delete_node(node_id)


def delete_edge(store: TopoStore, edge_id: int, stamp_s: float = 0.0) -> None:
    """Delete an edge; a closure taken back by hand."""
    edge = _edge(store, edge_id)
    with recorded(store, f"delete {edge.type} edge {edge_id}", stamp_s) as recording:
        recording.touch("edge", edge_id)
        recording.touch("door_edge", edge_id)
        store.delete_edge(edge_id)


def block_edge(store: TopoStore, edge_id: int, until_s: float = FOR_EVER_S, stamp_s: float = 0.0) -> None:
    """Close an edge to planning until a time, for ever by default; 0 opens it."""
    what = f"block edge {edge_id}" if until_s > 0.0 else f"open edge {edge_id}"
    _block(store, [_edge(store, edge_id)], what, until_s, stamp_s)


def block_between(
    store: TopoStore, a: int, b: int, until_s: float = FOR_EVER_S, stamp_s: float = 0.0
) -> None:
    """Close every edge between two nodes, or open them by 0: a way stays open as long as one of them is."""
    edge_between(store, a, b)
    edges = [edge for edge in store.edges_of(a) if edge.other(a) == b]
    what = f"block the way {a} - {b}" if until_s > 0.0 else f"open the way {a} - {b}"
    _block(store, edges, what, until_s, stamp_s)


def _block(store: TopoStore, edges: list[Edge], what: str, until_s: float, stamp_s: float) -> None:
    with recorded(store, what, stamp_s) as recording:
        for edge in edges:
            recording.touch("edge", edge.edge_id)
            store.put_edge(replace(edge, blocked_until_s=until_s))


def set_level(store: TopoStore, node_id: int, level: int, stamp_s: float = 0.0) -> None:
    """Put a node on a level; near-neighbour edges to nodes of other levels go, ramps and lifts stay."""
    node = _node(store, node_id)
    if abs(level) > MOST_LEVEL:
        raise BadInput(f"level {level}: levels lie between -{MOST_LEVEL} and {MOST_LEVEL}")
    with recorded(store, f"put node {node_id} on level {level}", stamp_s) as recording:
        recording.touch("node", node_id)
        store.put_node(replace(node, level=level))
        for edge in _wrong_levels(store, node_id, level):
            recording.touch("edge", edge.edge_id)
            recording.touch("door_edge", edge.edge_id)
            store.delete_edge(edge.edge_id)


def edge_between(store: TopoStore, a: int, b: int) -> Edge:
    """Return the edge that joins two nodes."""
    edge = PagedGraph(store).edge_between(a, b)
    if edge is None:
        raise BadInput(f"{store.path}: no edge between {a} and {b}")
    return edge


def _wrong_levels(store: TopoStore, node_id: int, level: int) -> list[Edge]:
    wrong = []
    for edge in store.edges_of(node_id):
        other = store.node(edge.other(node_id))
        if edge.type == "near_neighbour" and other is not None and other.level != level:
            wrong.append(edge)
    return wrong


def _node(store: TopoStore, node_id: int) -> Node:
    node = store.node(node_id)
    if node is None:
        raise BadInput(f"{store.path}: no node {node_id}")
    return node


def _edge(store: TopoStore, edge_id: int) -> Edge:
    edge = store.edge(edge_id)
    if edge is None:
        raise BadInput(f"{store.path}: no edge {edge_id}")
    return edge
