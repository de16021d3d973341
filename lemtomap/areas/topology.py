"""The area topology: areas and what leads from one into another (thesis, section 3-3-2 and figure A-13).

It is read from ways and doors where it is asked for, so it is never out of step with the map.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from lemtomap.areas.book import AreaBook
from lemtomap.areas.model import Area, AreaKind
from lemtomap.se2 import Pose
from lemtomap.topo.file.store import TopoStore

CORRIDOR_TIMES = 3.0
"""A corridor is so many times as long as it is wide, by where its nodes stand, ..."""
CORRIDOR_LEAST_M = 4.0  # ... and at least this long


@dataclass(frozen=True, slots=True)
class Passage:
    """A way out of one area into another, through a door or a narrow place, or without either."""

    door_id: int
    """0: no door there."""
    area_ids: tuple[int, int]
    """The lower one first."""
    is_door: bool = True


@dataclass(frozen=True, slots=True)
class AreaSummary:
    """What a person wants to know of an area."""

    area: Area
    nodes: tuple[int, ...]
    doors: tuple[int, ...]
    neighbours: tuple[int, ...]


def passages(store: TopoStore) -> list[Passage]:
    """Return how areas hang together: each door with the two areas it leads between, and ways without one."""
    sql = (
        "SELECT coalesce(d.door, 0) AS door, min(a.area, b.area) AS low, max(a.area, b.area) AS high, "
        "coalesce(g.is_door, 1), count(*) AS ways "
        "FROM edge e JOIN node a ON a.id = e.source JOIN node b ON b.id = e.target "
        "LEFT JOIN door_edge d ON d.edge = e.id LEFT JOIN door g ON g.id = d.door "
        "WHERE a.area != b.area AND a.area > 0 AND b.area > 0 AND (e.time IS NOT NULL OR e.type != 2) "
        "GROUP BY door, low, high ORDER BY ways DESC, low, high, door"
    )
    found: dict[tuple[int, ...], Passage] = {}
    for door, low, high, is_door, _ in store.query(sql):
        between = (door,) if door else (door, low, high)  # a long way may lead through two doors, and on
        found.setdefault(between, Passage(door, (low, high), bool(is_door)))
    return sorted(found.values(), key=lambda each: (each.area_ids, each.door_id))


def areas_in(store: TopoStore) -> list[AreaSummary]:
    """Return every area that has nodes, by ID, with its doors and neighbours."""
    book, leading = AreaBook(store), passages(store)
    nodes: dict[int, list[int]] = {}
    for node_id, area_id in store.query("SELECT id, area FROM node ORDER BY id"):
        nodes.setdefault(area_id, []).append(node_id)
    summaries = []
    for area in book.areas():
        own = [each for each in leading if area.area_id in each.area_ids]
        others = {other for each in own for other in each.area_ids} - {area.area_id}
        doors = {each.door_id for each in own if each.door_id and each.is_door}
        if area.area_id in nodes:
            summaries.append(
                AreaSummary(area, tuple(nodes[area.area_id]), tuple(sorted(doors)), tuple(sorted(others)))
            )
    return summaries


def touch(store: TopoStore, a: int, b: int) -> bool:
    """Return True if some way leads straight from one area into another."""
    return any(set(each.area_ids) == {a, b} for each in passages(store))


def kind_of(area: Area, places: Mapping[int, Pose], nodes: Iterable[int]) -> AreaKind:
    """Return what a person said an area is; else a corridor if its nodes stand in a long row, or a room."""
    if area.kind:
        return AreaKind(area.kind)
    at = np.array([places[k][:2] for k in nodes if k in places])
    if len(at) < 3:
        return AreaKind.ROOM
    spread = np.linalg.svd(at - at.mean(axis=0), compute_uv=True)
    along, across = (np.ptp((at - at.mean(axis=0)) @ axis) for axis in spread[2][:2])
    is_long = along >= CORRIDOR_LEAST_M and along >= CORRIDOR_TIMES * max(across, 1.0)
    return AreaKind.CORRIDOR if is_long else AreaKind.ROOM


def area_meant(store: TopoStore, text: str) -> int | None:
    """Return the area that a person means by `area:7`, `7` or a name, also of one that merged since."""
    number = text.removeprefix("area:")
    if number.isdecimal() and len(number) < 16:
        area = AreaBook(store).area(int(number))
        return None if area is None else area.area_id
    return AreaBook(store).names().get(text)
