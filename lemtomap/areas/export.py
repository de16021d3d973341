"""Areas and doors for other programs: Simple Indoor Tagging in GeoJSON, IndoorGML's cells and states.

An area's floor is drawn round where the robot drove: cells of half a metre near its nodes and the open ways
between them, so that no polygon reaches through a wall. Ways that somebody closed are left out, and so are
closures that nobody has driven.
"""

import json
import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from lemtomap.areas.book import AreaBook
from lemtomap.areas.model import MappedDoor
from lemtomap.areas.topology import AreaSummary, Passage, areas_in, kind_of, passages
from lemtomap.errors import BadInput
from lemtomap.se2 import Pose, transform
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.naming import shown
from lemtomap.topo.whole.export import APPROXIMATE, ways, write_geojson, write_whole
from lemtomap.topo.whole.layout import lay_out

CELL_M = 0.5  # of the raster from which outlines are taken
Ring = list[list[float]]


def write_indoor(store: TopoStore, path: Path) -> None:
    """Write areas and doors as GeoJSON with the tags of OpenStreetMap's Simple Indoor Tagging, metres."""
    areas, at = _areas(store, path), lay_out(store).T_map_node
    features = [_area_feature(store, each, at) for each in areas]
    leading = {each.door_id: each for each in passages(store) if each.door_id}
    features += [
        _door_feature(store, door, at[door.node], leading)
        for door in AreaBook(store).doors()
        if door.node in at
    ]
    label = {"type": "FeatureCollection", "name": shown(path.stem), "comment": APPROXIMATE}
    write_whole(path, json.dumps({**label, "features": features}, indent=1).encode())


def _area_feature(store: TopoStore, each: AreaSummary, at: dict[int, Pose]) -> dict[str, Any]:
    area = each.area
    tags: dict[str, Any] = {"indoor": str(kind_of(area, at, each.nodes)), "level": str(area.level)}
    tags |= {"ref": str(area.area_id)} | ({"name": shown(area.name)} if area.name else {})
    rings = list(_rings(_floor(store, each, at)))
    return {
        "type": "Feature",
        "id": f"area/{area.area_id}",
        "geometry": {"type": "MultiPolygon", "coordinates": [[ring] for ring in rings]},
        "properties": tags,
    }


def _door_feature(
    store: TopoStore, door: MappedDoor, T_map_node: Pose, leading: dict[int, Passage]
) -> dict[str, Any]:
    door_id = door.door_id
    between = leading[door_id].area_ids if door_id in leading else ()
    tags = {"door": "yes", "width": f"{door.width_m:.2f}", "ref": str(door_id), "areas": list(between)}
    tags["level"] = str(_level(store, door.node))
    middle = transform(T_map_node, door.T_node_door[:2]).tolist()
    return {
        "type": "Feature",
        "id": f"door/{door_id}",
        "geometry": {"type": "Point", "coordinates": middle},
        "properties": tags | {"state": "shut" if door.is_shut else "open"},
    }


def _level(store: TopoStore, node_id: int) -> int:
    node = store.node(node_id)
    return 0 if node is None else node.level


def write_indoorgml(store: TopoStore, path: Path) -> None:
    """Write a cell and a state for each area, a transition for each passage (IndoorGML 1.1, core)."""
    areas, at = _areas(store, path), lay_out(store).T_map_node
    core, gml, link = (
        "http://www.opengis.net/indoorgml/1.0/core", "http://www.opengis.net/gml/3.2", "http://www.w3.org/1999/xlink",
    )  # fmt: skip
    for prefix, name in (("core", core), ("gml", gml), ("xlink", link)):
        ET.register_namespace(prefix, name)

    def child(parent: ET.Element, tag: str, space: str = core, **marks: str) -> ET.Element:
        return ET.SubElement(parent, f"{{{space}}}{tag}", {_mark(k, gml, link): v for k, v in marks.items()})

    root = ET.Element(f"{{{core}}}IndoorFeatures", {f"{{{gml}}}id": "map"})
    child(root, "description", gml).text = APPROXIMATE
    cells = child(child(root, "primalSpaceFeatures"), "PrimalSpaceFeatures", gml_id="cells")
    layer = child(child(root, "MultiLayeredGraph"), "spaceLayers")
    graph = child(child(layer, "spaceLayerMember"), "SpaceLayer", gml_id="layer")
    states, transitions = child(graph, "nodes", gml_id="states"), child(graph, "edges", gml_id="ways")
    for each in areas:
        area = each.area
        cell = child(child(cells, "cellSpaceMember"), "CellSpace", gml_id=f"cell-{area.area_id}")
        child(cell, "name", gml).text = shown(area.name) or f"area {area.area_id}"
        child(cell, "description", gml).text = f"{kind_of(area, at, each.nodes)}, level {area.level}"
        child(cell, "duality", xlink_href=f"#state-{area.area_id}")
        state = child(child(states, "stateMember"), "State", gml_id=f"state-{area.area_id}")
        child(state, "duality", xlink_href=f"#cell-{area.area_id}")
        middle = np.mean([at[k][:2] for k in each.nodes], axis=0)
        point = child(child(state, "geometry"), "Point", gml, gml_id=f"point-{area.area_id}")
        child(point, "pos", gml).text = f"{middle[0]:.3f} {middle[1]:.3f}"
    for k, passage in enumerate(_open_passages(store)):
        way = child(child(transitions, "transitionMember"), "Transition", gml_id=f"way-{k}")
        child(way, "name", gml).text = f"door {passage.door_id}" if passage.door_id else "open"
        for area_id in passage.area_ids:
            child(way, "connects", xlink_href=f"#state-{area_id}")
    write_whole(path, ET.tostring(root, encoding="utf-8", xml_declaration=True))


def _mark(name: str, gml: str, link: str) -> str:
    return f"{{{gml}}}id" if name == "gml_id" else f"{{{link}}}href"


def _open_passages(store: TopoStore) -> Iterator[Passage]:
    """Iterate over the passages that lead somewhere over at least one way that nobody closed."""
    book = AreaBook(store)
    crossed = book.crossed(edge.edge_id for edge in ways(store))
    opened = {
        (crossed.get(edge.edge_id, 0), *sorted((book.area_of(edge.source_id), book.area_of(edge.target_id))))
        for edge in ways(store)
    }
    return (each for each in passages(store) if (each.door_id, *each.area_ids) in opened)


def write_route(store: TopoStore, path: Path) -> None:
    """Write nav2's route graph, with each node's area and each edge's door among its metadata."""
    book = AreaBook(store)
    names = {area.area_id: shown(area.name) for area in book.areas() if area.name}
    area_of = dict(store.query("SELECT id, area FROM node"))
    doors = {door.door_id for door in book.doors()}
    crossed = book.crossed(edge.edge_id for edge in ways(store))

    def node_marks(node_id: int) -> dict[str, Any]:
        area_id = area_of.get(node_id, 0)
        marks: dict[str, Any] = {"area": area_id} if area_id else {}
        return marks | ({"area_name": names[area_id]} if area_id in names else {})

    def edge_marks(edge_id: int) -> dict[str, Any]:
        return {"door": crossed[edge_id]} if crossed.get(edge_id) in doors else {}

    write_geojson(store, path, node_marks, edge_marks)


def _areas(store: TopoStore, path: Path) -> list[AreaSummary]:
    areas = areas_in(store)
    if not areas:
        raise BadInput(f"{store.path}: no areas to write as {path.name}; `edit MAP area find` finds them")
    return areas


def _floor(store: TopoStore, each: AreaSummary, at: dict[int, Pose]) -> set[tuple[int, int]]:
    """Return the cells of half a metre, (column, row), near its nodes and the open ways between them."""
    nodes = set(each.nodes)
    points = [at[k][:2] for k in each.nodes]
    for node_id in each.nodes:
        for edge in store.edges_of(node_id):
            inside = edge.source_id == node_id and edge.target_id in nodes
            if inside and edge.is_proven and not edge.is_closed:
                a, b = at[edge.source_id][:2], at[edge.target_id][:2]
                steps = max(1, math.ceil(2.0 * edge.length_m / CELL_M))
                points += [a + (b - a) * k / steps for k in range(1, steps)]
    return {(math.floor(x / CELL_M), math.floor(y / CELL_M)) for x, y in points}


def _rings(cells: set[tuple[int, int]]) -> Iterator[Ring]:
    """Yield the outline of every group of cells that touch along a side, metres, anticlockwise and closed.

    Holes are left out.
    """
    rest = set(cells)
    while rest:
        group, waiting = set[tuple[int, int]](), [rest.pop()]
        while waiting:
            col, row = waiting.pop()
            group.add((col, row))
            for near in ((col + 1, row), (col - 1, row), (col, row + 1), (col, row - 1)):
                if near in rest:
                    rest.discard(near)
                    waiting.append(near)
        yield _outline(group)


def _outline(group: set[tuple[int, int]]) -> Ring:
    """Return the outer border of cells that touch, walked with the floor on the left."""
    col, row = min(group, key=lambda cell: (cell[1], cell[0]))
    corner, way = (col, row), (1, 0)
    begun = (corner, way)
    ring = []
    while True:
        ring.append([corner[0] * CELL_M, corner[1] * CELL_M])
        corner = (corner[0] + way[0], corner[1] + way[1])
        for turn in ((way[1], -way[0]), way, (-way[1], way[0]), (-way[0], -way[1])):
            if _beside(corner, turn, left=True) in group and _beside(corner, turn, left=False) not in group:
                way = turn
                break
        if (corner, way) == begun:
            return [*ring, ring[0]]


def _beside(corner: tuple[int, int], way: tuple[int, int], *, left: bool) -> tuple[int, int]:
    """Return the cell to the left or right of a step from a corner of the grid."""
    x = 2 * corner[0] + way[0] + (-way[1] if left else way[1])
    y = 2 * corner[1] + way[1] + (way[0] if left else -way[0])
    return math.floor(x / 2), math.floor(y / 2)
