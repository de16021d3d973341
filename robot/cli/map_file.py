"""What a person does with a map file: look into it, correct it, hand it to other programs."""

import re
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from lemtomap.areas import edit as areas
from lemtomap.areas import export as area_export
from lemtomap.areas.find import find_areas
from lemtomap.areas.places import places
from lemtomap.errors import BadSetting
from lemtomap.topo.file import edit, journal
from lemtomap.topo.file.info import MapInfo, describe_map
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.graph import FOR_EVER_S
from lemtomap.topo.naming import listed, shown
from lemtomap.topo.whole import export

LINE = 200  # characters of an edit in words
Edit = Callable[[TopoStore, Sequence[str]], str]


def info(path: Path) -> str:
    """Return what a map holds, a line each. Raises BadMap."""
    with TopoStore.view(path) as store:
        held = describe_map(store)
    return "\n".join(f"{name:<13} {value}" for name, value in _facts(held))


def info_places(path: Path) -> str:
    """Return what a person needs to find a room: areas, doors and nodes, a line each. Raises BadMap."""
    with TopoStore.view(path) as store:
        return "\n".join(places(store))


def _facts(held: MapInfo) -> list[tuple[str, str]]:
    """Return names and values in the order a person asks for them."""
    edges = ", ".join(f"{count:,} {kind.replace('_', ' ')}" for kind, count in held.edges.items())
    names = [f"{listed(name)} = {node}" for name, node in sorted(held.names.items())]
    per_node = held.file_bytes / held.nodes if held.nodes else 0.0
    return [
        ("nodes", f"{held.nodes:,}"),
        ("edges", edges),
        ("driven", f"{held.edge_length_m:,.0f} m of first ways"),
        ("components", f"{held.components}" + (" (parts not joined yet)" if held.components > 1 else "")),
        ("levels", ", ".join(f"{level}: {count} nodes" for level, count in sorted(held.levels.items()))),
        ("names", ", ".join(names) or "none"),
        ("places", f"{held.places:,} recognisable, {held.place_bytes / max(1, held.places):.0f} bytes each"),
        ("openings", ", ".join(f"{count} {state}" for state, count in held.openings.items()) or "none"),
        ("edits", f"{held.undoable} can be undone"),
        ("file", f"{held.file_bytes / 1000:,.1f} kB, {per_node:.0f} bytes a node"),
    ]


def apply_edit(path: Path, words: Sequence[str]) -> str:
    """Change a map and return what was done. Raises BadInput; then the file is as it was, byte for byte."""
    kind, rest = words[0], words[1:]
    if kind not in EDITS:
        raise BadSetting(f"edit '{shown(kind)}': must be one of {', '.join(EDITS)}")
    wanted, action = EDITS[kind]
    if len(rest) != len(wanted) and not (action is _area and rest):
        raise BadSetting(f"edit {kind}: needs {' '.join(wanted) or 'nothing more'}")
    opened = TopoStore.view(path) if action is _history else TopoStore.editing(path)
    with opened as store:
        return action(store, rest)


def _name(store: TopoStore, words: Sequence[str]) -> str:
    node_id, name = edit.resolve_node(store, words[0]), words[1]
    before = store.names()
    edit.name_node(store, node_id, name, time.time())
    told = f"node {node_id} is now '{name}'"
    if before.get(name, node_id) != node_id:
        told += f", which was node {before[name]} until now"
    given_up = next((old for old, node in before.items() if node == node_id and old != name), None)
    return told if given_up is None else f"{told}; it was '{shown(given_up)}'"


def _unname(store: TopoStore, words: Sequence[str]) -> str:
    edit.unname(store, words[0], time.time())
    return f"the name '{shown(words[0])}' is gone"


def _delete(store: TopoStore, words: Sequence[str]) -> str:
    node_id = edit.resolve_node(store, words[0])
    edit.delete_node(store, node_id, time.time())
    return f"node {node_id} is deleted, with its edges"


def _delete_edge(store: TopoStore, words: Sequence[str]) -> str:
    edge = edit.edge_between(store, *(edit.resolve_node(store, word) for word in words))
    edit.delete_edge(store, edge.edge_id, time.time())
    return f"the {edge.type.value.replace('_', ' ')} edge {_way(words)} is deleted"


def _block(store: TopoStore, words: Sequence[str]) -> str:
    _close(store, words, FOR_EVER_S)
    return f"the way {_way(words)} is closed"


def _open(store: TopoStore, words: Sequence[str]) -> str:
    _close(store, words, 0.0)
    return f"the way {_way(words)} is open"


def _close(store: TopoStore, words: Sequence[str], until_s: float) -> None:
    a, b = (edit.resolve_node(store, word) for word in words)
    edit.block_between(store, a, b, until_s, time.time())


def _way(words: Sequence[str]) -> str:
    return " - ".join(shown(word) for word in words)


def _level(store: TopoStore, words: Sequence[str]) -> str:
    node_id = edit.resolve_node(store, words[0])
    if not re.fullmatch(r"[+-]?[0-9]{1,9}", words[1]):
        raise BadSetting(f"edit level: '{shown(words[1])}' is no level, a level is a whole number")
    level = int(words[1])
    edit.set_level(store, node_id, level, time.time())
    return f"node {node_id} is on level {level}"


def _area(store: TopoStore, words: Sequence[str]) -> str:
    """Change areas: name, merge, split, kind or find."""
    kind, rest = words[0], words[1:]
    if kind not in AREA_EDITS:
        raise BadSetting(f"edit area '{shown(kind)}': must be one of {', '.join(AREA_EDITS)}")
    wanted, action = AREA_EDITS[kind]
    if len(rest) != len(wanted):
        raise BadSetting(f"edit area {kind}: needs {' '.join(wanted) or 'nothing more'}")
    return action(store, rest)


def _split(store: TopoStore, words: Sequence[str]) -> str:
    a, b = (edit.resolve_node(store, word) for word in words[1:])
    return areas.split_area(store, words[0], a, b, time.time())


def _undo(store: TopoStore, _: Sequence[str]) -> str:
    what = journal.undo(store)
    return f"taken back: {shown(what, LINE)}" if what is not None else "nothing to take back"


def _history(store: TopoStore, _: Sequence[str]) -> str:
    return "\n".join(shown(entry.what, LINE) for entry in journal.entries(store)) or "no edits"


AREA_EDITS: dict[str, tuple[tuple[str, ...], Edit]] = {
    "name": (("AREA", "NAME"), lambda store, words: areas.name_area(store, words[0], words[1], time.time())),
    "merge": (
        ("AREA", "AREA"),
        lambda store, words: areas.merge_areas(store, words[0], words[1], time.time()),
    ),
    "split": (("AREA", "NODE", "NODE"), _split),
    "kind": (("AREA", "KIND"), lambda store, words: areas.set_kind(store, words[0], words[1], time.time())),
    "find": ((), lambda store, _: find_areas(store, time.time())),
}
EDITS: dict[str, tuple[tuple[str, ...], Edit]] = {
    "name": (("NODE", "NAME"), _name),
    "unname": (("NAME",), _unname),
    "delete": (("NODE",), _delete),
    "delete-edge": (("NODE", "NODE"), _delete_edge),
    "block": (("NODE", "NODE"), _block),
    "open": (("NODE", "NODE"), _open),
    "level": (("NODE", "LEVEL"), _level),
    "area": (("WHAT", "..."), _area),
    "undo": ((), _undo),
    "history": ((), _history),
}


def export_map(path: Path, target: Path) -> str:
    """Write the map for another program, by the target's suffix. Raises BadMap, BadSetting."""
    kind = next((each for each in EXPORTS if target.name.lower().endswith(each)), "")
    if not kind:
        raise BadSetting(f"{target}: unknown kind; known are {', '.join(EXPORTS)}")
    writer = EXPORTS[kind]
    with TopoStore.view(path) as store:
        writer(store, target)
        closed, unproven = export.left_out(store)
    told = [f"{target} written", NOTES[kind]]
    if closed and kind in WITHOUT_CLOSED:
        told.append(f"left out as closed by hand: {closed}")
    if unproven and kind in WITHOUT_UNPROVEN:
        told.append(f"left out as closures that nobody has driven: {unproven}")
    return "; ".join(told)


def _write_png(store: TopoStore, target: Path) -> None:
    """Draw; matplotlib is loaded only when it is needed."""
    from lemtomap.areas.painting import Painting
    from lemtomap.areas.picture import paint
    from lemtomap.topo.whole.picture import write_png

    painting = Painting.of(store)
    write_png(store, target, paint=lambda axes, places: paint(axes, painting, places, 16.0))


EXPORTS: dict[str, Callable[[TopoStore, Path], None]] = {
    ".indoor.geojson": area_export.write_indoor,
    ".geojson": area_export.write_route,
    ".gml": area_export.write_indoorgml,
    ".tmap2": export.write_tmap2,
    ".g2o": export.write_g2o,
    ".graphml": export.write_graphml,
    ".png": _write_png,
}
_PLACED = "its coordinates come from one full solve and are approximate"
NOTES = {
    ".indoor.geojson": f"areas and doors, Simple Indoor Tagging; {_PLACED}",
    ".geojson": f"nav2 route server; {_PLACED}",
    ".gml": f"IndoorGML cells and states; {_PLACED}",
    ".tmap2": f"topological_navigation; {_PLACED}",
    ".g2o": f"pose graph, whose edges are measurements and not ways; {_PLACED}",
    ".graphml": "relative poses as the map holds them",
    ".png": f"a picture; {_PLACED}",
}
WITHOUT_CLOSED, WITHOUT_UNPROVEN = (
    (".indoor.geojson", ".geojson", ".gml", ".tmap2", ".g2o"),
    (".indoor.geojson", ".geojson", ".gml", ".tmap2"),
)
