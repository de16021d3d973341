"""What a person corrects in a map's areas: names, what belongs together, what is apart. All can be undone.

The robot never overrules it: an area that somebody merged or split is held as it is. Each raises BadInput in
one line before anything is written.
"""

import heapq
from dataclasses import replace

from lemtomap.areas import topology
from lemtomap.areas.book import AreaBook
from lemtomap.areas.labels import taken_in
from lemtomap.areas.model import Area, AreaKind
from lemtomap.errors import BadInput
from lemtomap.topo import naming
from lemtomap.topo.file.journal import recorded
from lemtomap.topo.file.store import TopoStore


def resolve_area(store: TopoStore, text: str) -> Area:
    """Return the area that a person means by its number or its name."""
    area_id = topology.area_meant(store, text)
    area = None if area_id is None else AreaBook(store).area(area_id)
    if area is None:
        instead = naming.told_instead(text, AreaBook(store).names())
        raise BadInput(f"{store.path}: no area '{naming.shown(text)}' ({instead})")
    return area


def name_area(store: TopoStore, text: str, name: str, stamp_s: float = 0.0) -> str:
    """Give an area a name, in place of the one it had; returns what was done."""
    area, book = resolve_area(store, text), AreaBook(store)
    fault = naming.fault(name)
    if fault is not None:
        raise BadInput(f"'{naming.shown(name)}' cannot be a name: {fault}")
    owner = book.names().get(name)
    if owner not in {None, area.area_id}:
        raise BadInput(f"{store.path}: '{naming.shown(name)}' is the name of area {owner} already")
    if name in store.names():
        raise BadInput(
            f"{store.path}: '{naming.shown(name)}' is the name of node {store.names()[name]} already"
        )
    told = f"area {area.area_id} is now '{naming.shown(name)}'"
    told += f"; it was '{naming.shown(area.name)}'" if area.name not in {"", name} else ""
    with recorded(store, f"name area {area.area_id} '{name}'", stamp_s) as recording:
        recording.touch("area", area.area_id)
        others = tuple(each for each in area.other_names if each != name)
        book.put_area(replace(area, name=name, other_names=others))
    return told


def set_kind(store: TopoStore, text: str, kind: str, stamp_s: float = 0.0) -> str:
    """Say what an area is: a room, a corridor, or just an area."""
    area = resolve_area(store, text)
    if kind not in list(AreaKind):
        raise BadInput(f"'{naming.shown(kind)}' is no kind of area; kinds are {', '.join(AreaKind)}")
    with recorded(store, f"area {area.area_id} is a {kind}", stamp_s) as recording:
        recording.touch("area", area.area_id)
        AreaBook(store).put_area(replace(area, kind=kind))
    return f"area {area.area_id} is {'an' if kind == AreaKind.AREA else 'a'} {kind}"


def merge_areas(store: TopoStore, first: str, second: str, stamp_s: float = 0.0) -> str:
    """Make one area of two that touch: the older ID stays, the other and both names go on to mean it."""
    one, other = sorted(
        (resolve_area(store, text) for text in (first, second)), key=lambda area: area.area_id
    )
    if one.area_id == other.area_id:
        raise BadInput(f"{store.path}: '{naming.shown(first)}' and '{naming.shown(second)}' are one area")
    if not topology.touch(store, one.area_id, other.area_id):
        raise BadInput(
            f"{store.path}: areas {one.area_id} and {other.area_id} do not touch: no way joins them"
        )
    book = AreaBook(store)
    with recorded(store, f"merge area {other.area_id} into {one.area_id}", stamp_s) as recording:
        recording.touch("area", one.area_id)
        recording.touch("area", other.area_id)
        recording.touch_where("node", "area", other.area_id)
        store.write("UPDATE node SET area = ? WHERE area = ?", (one.area_id, other.area_id))
        book.delete_area(other.area_id)
        book.put_area(replace(taken_in(one, other), is_held=True))
    return f"area {other.area_id} is part of area {one.area_id} now"


def split_area(store: TopoStore, text: str, a: int, b: int, stamp_s: float = 0.0) -> str:
    """Part an area between two of its nodes: every other one goes with the nearer by way.

    The name stays where most of the named nodes are, else with the larger part.
    """
    area, book = resolve_area(store, text), AreaBook(store)
    for node_id in (a, b):
        if book.area_of(node_id) != area.area_id:
            raise BadInput(f"{store.path}: node {node_id} is not in area {area.area_id}")
    if a == b:
        raise BadInput(f"{store.path}: an area is split between two different nodes")
    near_a, near_b = _parted(store, set(book.nodes_of(area.area_id)), a, b)
    named = set(store.names().values())
    by_names = sorted((near_a, near_b), key=lambda part: (len(part & named), len(part)))
    going = by_names[0]
    with recorded(store, f"split area {area.area_id} between {a} and {b}", stamp_s) as recording:
        recording.touch("area", area.area_id)
        recording.touch("area", book.next_area_id())
        new = book.add_area(area.level)
        for node_id in going:
            recording.touch("node", node_id)
            store.write("UPDATE node SET area = ? WHERE id = ?", (new.area_id, node_id))
        book.put_area(replace(new, is_held=True))
        book.put_area(replace(area, is_held=True))
    return f"{len(going)} nodes of area {area.area_id} are area {new.area_id} now"


def _parted(store: TopoStore, nodes: set[int], a: int, b: int) -> tuple[set[int], set[int]]:
    """Return the nodes in two groups, by which of two of them the way is shorter to."""
    whose: dict[int, int] = {}
    heap = [(0.0, a, a), (0.0, b, b)]
    while heap:
        way_m, node_id, source = heapq.heappop(heap)
        if node_id in whose:
            continue
        whose[node_id] = source
        for edge in store.edges_of(node_id):
            other_id = edge.other(node_id)
            if other_id in nodes and other_id not in whose and edge.is_proven:
                heapq.heappush(heap, (way_m + edge.length_m, other_id, source))
    near_b = {node_id for node_id, source in whose.items() if source == b}
    return nodes - near_b, near_b
