"""Doors and areas as rows of the map file.

A door's row keeps where it stands and what was seen of it, `door_edge` which edges lead through it. An area's
row keeps what no node can tell: its name and kind, the IDs that merged into it, and whether a person drew it.
"""

import json
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from lemtomap.areas.model import Area, AreaKind, MappedDoor
from lemtomap.errors import BadMap
from lemtomap.topo.file.store import TopoStore

_DOOR = (
    "id, node, x, y, yaw, width, seen_open, seen_shut, last_open, last_shut, passed, is_door"  # as the table
)


class AreaBook:
    """Reads and writes doors and areas through an open map file."""

    def __init__(self, store: TopoStore) -> None:
        self._store = store

    # -- doors ----------------------------------------------------------------------------------------------

    def doors(self) -> list[MappedDoor]:
        """Return all doors by ID, without places where the floor only narrows."""
        return [door for door in self.gates() if door.is_door]

    def gates(self) -> list[MappedDoor]:
        """Return all doors and narrow places by ID."""
        return self._doors(f"SELECT {_DOOR} FROM door ORDER BY id")  # noqa: S608

    def gates_at(self, node_ids: Iterable[int]) -> list[MappedDoor]:
        """Return the doors and narrow places that stand in the frames of some nodes, by ID."""
        numbers = json.dumps(list(node_ids))
        sql = f"SELECT {_DOOR} FROM door WHERE node IN (SELECT value FROM json_each(?)) ORDER BY id"  # noqa: S608
        return self._doors(sql, (numbers,))

    def _doors(self, sql: str, values: Iterable[Any] = ()) -> list[MappedDoor]:
        return [self._door(row) for row in list(self._store.query(sql, values))]

    def _door(self, row: tuple[Any, ...]) -> MappedDoor:
        number, node, x, y, yaw, width, opened, shut, last_open, last_shut, passed, is_door = row
        rows = self._store.query("SELECT edge FROM door_edge WHERE door = ? ORDER BY edge", (number,))
        edges = tuple(edge for (edge,) in rows)
        seen = (opened, shut, last_open, last_shut, passed, bool(is_door))
        return MappedDoor(number, node, x, y, yaw, width, edges, *seen)

    def add_door(self, door: MappedDoor) -> MappedDoor:
        """Write a new door; returns it with an ID never used before (`door.door_id` is ignored)."""
        door = replace(door, door_id=self._next("door"))
        self._store.set_meta("next_door", door.door_id + 1)
        self.put_door(door)
        return door

    def next_door_id(self) -> int:
        """Return the ID that the next new door gets."""
        return self._next("door")

    def put_door(self, door: MappedDoor) -> None:
        """Write a changed door over the one with its ID, its edges too."""
        values = (
            door.door_id, door.node, float(door.x_m), float(door.y_m), float(door.yaw_rad),
            float(door.width_m), door.seen_open, door.seen_shut, door.last_open_s, door.last_shut_s,
            door.passed, int(door.is_door),
        )  # fmt: skip
        self._store.write(f"REPLACE INTO door({_DOOR}) VALUES({', '.join('?' * len(values))})", values)
        self.put_edges(door)

    def put_edges(self, door: MappedDoor) -> None:
        """Write which edges lead through a door. An edge through two stays with the one it had first."""
        here = "SELECT edge FROM door_edge WHERE door = ?"
        before = {edge_id for (edge_id,) in self._store.query(here, (door.door_id,))}
        for edge_id in before - set(door.edges):
            self._store.write("DELETE FROM door_edge WHERE edge = ?", (edge_id,))
        for edge_id in set(door.edges) - before:
            how = "INSERT OR IGNORE INTO door_edge(edge, door) VALUES(?, ?)"
            self._store.write(how, (edge_id, door.door_id))

    def delete_door(self, door_id: int) -> None:
        """Remove what proved to be no door. Its ID stays used for ever."""
        self._store.write("DELETE FROM door_edge WHERE door = ?", (door_id,))
        self._store.write("DELETE FROM door WHERE id = ?", (door_id,))

    def crossed(self, edge_ids: Iterable[int]) -> dict[int, int]:
        """Return {edge ID: door ID} of those edges that lead through a door or a narrow place."""
        sql = "SELECT edge, door FROM door_edge WHERE edge IN (SELECT value FROM json_each(?))"
        return dict(self._store.query(sql, (json.dumps(list(edge_ids)),)))

    # -- areas ----------------------------------------------------------------------------------------------

    def areas(self) -> list[Area]:
        """Return all areas by ID. Empty for a map in which none were looked for yet. Raises BadMap."""
        rows = self._store.query("SELECT id, name, kind, tags FROM area ORDER BY id")
        return [self._area(row) for row in rows]

    def some(self, area_ids: Iterable[int]) -> dict[int, Area]:
        """Return those of some areas that have a row, by ID."""
        sql = "SELECT id, name, kind, tags FROM area WHERE id IN (SELECT value FROM json_each(?))"
        rows = list(self._store.query(sql, (json.dumps(list(area_ids)),)))
        return {row[0]: self._area(row) for row in rows}

    def is_used(self, area_id: int) -> bool:
        """Return True if some node bears this area's ID."""
        return any(True for _ in self._store.query("SELECT 1 FROM node WHERE area = ? LIMIT 1", (area_id,)))

    def area(self, area_id: int) -> Area | None:
        """Return the area with this ID, or the one that took it in; None when there is neither."""
        for row in list(self._store.query("SELECT id, name, kind, tags FROM area WHERE id = ?", (area_id,))):
            return self._area(row)
        return next((area for area in self.areas() if area_id in area.aliases), None)

    def area_of(self, node_id: int) -> int:
        """Return the ID of a node's area; 0 for a node that is not there."""
        for (area_id,) in self._store.query("SELECT area FROM node WHERE id = ?", (node_id,)):
            return int(area_id)
        return 0

    def nodes_of(self, area_id: int) -> list[int]:
        """Return the nodes of an area by ID."""
        sql = "SELECT id FROM node WHERE area = ? ORDER BY id"
        return [node_id for (node_id,) in self._store.query(sql, (area_id,))]

    def numbers(self) -> set[int]:
        """Return the IDs by which areas may be called, also of those that merged into others."""
        return {number for area in self.areas() for number in (area.area_id, *area.aliases)}

    def names(self) -> dict[str, int]:
        """Return {name: area ID} of the areas that have a name."""
        return {
            name: area.area_id for area in self.areas() for name in (area.name, *area.other_names) if name
        }

    def next_area_id(self) -> int:
        """Return the ID that the next new area gets."""
        return self._next("area")

    def add_area(self, level: int = 0) -> Area:
        """Make an area with an ID never used before."""
        area = Area(self._next("area"), level=level)
        self._store.set_meta("next_area", area.area_id + 1)
        self.put_area(area)
        return area

    def put_area(self, area: Area) -> None:
        """Write a changed area over the one with its ID."""
        tags: dict[str, Any] = {"level": area.level}
        if area.aliases:
            tags["aliases"] = list(area.aliases)
        if area.other_names:
            tags["names"] = list(area.other_names)
        if area.is_held:
            tags["held"] = True
        values = (
            area.area_id,
            area.name or None,
            area.kind or None,
            json.dumps(tags) if tags != {"level": 0} else None,
        )
        self._store.write("REPLACE INTO area(id, name, kind, tags) VALUES(?, ?, ?, ?)", values)

    def delete_area(self, area_id: int) -> None:
        """Remove an area that another took in. Its ID stays used for ever."""
        self._store.write("DELETE FROM area WHERE id = ?", (area_id,))

    def _area(self, row: tuple[Any, ...]) -> Area:
        area_id, name, kind, text = row
        try:
            tags = json.loads(text) if text else {}
            aliases = tuple(int(number) for number in tags.get("aliases", ()))
            names = tuple(str(each) for each in tags.get("names", ()))
            level, held = int(tags.get("level", 0)), bool(tags.get("held"))
            return Area(area_id, name or "", AreaKind(kind) if kind else "", aliases, names, level, held)
        except (ValueError, TypeError, AttributeError, RecursionError):
            raise BadMap(f"{self._store.path}: area {area_id}: its kind or tags are not ours") from None

    def _next(self, table: str) -> int:
        """Return an ID of `door` or `area` that nothing ever had."""
        found = list(self._store.query(f"SELECT coalesce(max(id), 0) FROM {table}"))  # noqa: S608
        if table == "area":
            found += self._store.query("SELECT coalesce(max(area), 0) FROM node")
        highest = max(int(number) for (number,) in found)
        return max(highest + 1, int(self._store.meta(f"next_{table}") or 1))
