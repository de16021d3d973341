"""Worlds described in TOML; an unknown key, an overlapping spawn or a door in no wall is one clear line.

name = "flat"
map = "plan.yaml"                      # a ROS map to begin with, if wanted
spawn = [1.0, 1.0, 0.0]
dock = [0.3, 2.0, 0.0]
[[wall]]
points = [[0, 0], [8, 0], [8, 5], [0, 5], [0, 0]]
surface = "glass"                      # wall (default), glass, dark
[[room]]
name = "kitchen"
low = [0, 0]
high = [4, 5]
[[door]]
at = [4.0, 2.5]
rooms = ["kitchen", "hall"]
leaf = "swings"                        # none (default), swings, closed, slides
[[door]]
at = [4.0, 4.0]
rooms = ["kitchen", "hall"]
leaf = "slides"
open = [[0, 30], [60, 90]]             # seconds; without it, it changes at random every `period` or so
[[furniture]]
kind = "table"                         # cabinet, table, chair, sofa, crate
at = [2.0, 1.0, 0.3]
moved = [[1, 2.4, 1.1, 0.3]]           # day, x, y, yaw
[[person]]
points = [[1, 4], [7, 4]]
[[barrier]]
from = [4.0, 2.0]
to = [4.0, 3.0]
during = [60.0, 120.0]                 # a closed corridor in mid-mission
[[ramp]]
from = [1.0, 4.0]
to = [4.0, 4.0]
rise = 0.3
width = 1.2
[[hole]]
low = [6, 1]
high = [7, 2]
"""

import math
import tomllib
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

from lemtomap.sim import furniture
from lemtomap.sim.errors import BadStart, BadWorld
from lemtomap.sim.faults import Faults, LinkFaults, Window
from lemtomap.sim.floorplan import FloorPlan
from lemtomap.sim.movers import Appearing, Person, SwingDoor
from lemtomap.sim.ros_map import load_ros_map
from lemtomap.sim.sliding import SlidingDoor
from lemtomap.sim.text_file import read_text
from lemtomap.sim.toml_entry import KEYS, MAX_ITEMS, MAX_TABLES, TomlEntry
from lemtomap.sim.world import Box, Pose2, Surface, World

Area = tuple[float, float, float, float]
FLOOR_SLAB_M = 0.2
MARGIN_M = 1.0
FURNITURE: dict[str, Callable[[float, float, float], list[Box]]] = {
    "cabinet": furniture.cabinet,
    "table": furniture.table,
    "chair": furniture.office_chair,
    "sofa": furniture.sofa,
    "crate": lambda x, y, _yaw: furniture.bin_low(x, y),
}


def load_toml(path: Path, *, day: int = 0) -> World:
    """Read a world description. Raises BadWorld with file and line."""
    top = _read(path)
    document = top.values
    entries = {table: _entries(top, table) for table in KEYS if table and "faults" not in table}
    plan = FloorPlan(f"{path}")
    spawn = _pose(top, "spawn") if "spawn" in document else None
    if "map" in document:
        base = load_ros_map(path.parent / top.text_of("map"))
        plan.remarks = base.remarks
        for box in base.boxes:
            plan.box(box)
        spawn = spawn or base.spawn
    if sum(len(entry.items("points", "points")) for entry in entries["wall"]) > MAX_ITEMS:
        raise top.refuse(f"all walls together have more than {MAX_ITEMS} points", "wall")
    for table, add in _ADD.items():
        for entry in entries[table]:
            add(plan, entry, day)
    _floors(plan, entries["ramp"], entries["hole"])
    if "faults" in document:
        plan.faults = _faults(top)
    if "dock" in document:
        plan.dock = _pose(top, "dock")
    try:
        return plan.build(spawn, top.text_of("description", path.name), name=top.text_of("name"))
    except BadStart as error:
        raise BadWorld(f"{path}:{top.line('spawn')}: {str(error).removeprefix(f'{path}: ')}") from error


def _read(path: Path) -> TomlEntry:
    text = read_text(path)
    try:
        document = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # ValueError: also a number of ten thousand digits
        raise BadWorld(f"{path}: not a readable TOML file ({error})") from error
    top = TomlEntry(path, text, "", 0, document)
    top.check_keys()
    return top


def _pose(entry: TomlEntry, key: str) -> Pose2:
    x, y, yaw = entry.numbers(key, 3)
    return x, y, yaw


def _entries(top: TomlEntry, table: str) -> list[TomlEntry]:
    tables = top.values.get(table, [])
    if not isinstance(tables, list) or not all(isinstance(item, dict) for item in tables):
        raise top.refuse(f"write [[{table}]], one table each", table)
    if len(tables) > MAX_TABLES:
        raise top.refuse(f"{len(tables)} times [[{table}]], at most {MAX_TABLES}", table)
    entries = [TomlEntry(top.path, top.text, table, index, item) for index, item in enumerate(tables)]
    for entry in entries:
        entry.check_keys()
    return entries


def _wall(plan: FloorPlan, entry: TomlEntry, _day: int) -> None:
    surface = Surface(entry.choice("surface", "wall", ["wall", "glass", "dark"]))
    for start, end in pairwise(entry.points("points")):
        if start == end:
            raise entry.refuse(f"wall from {start} to itself", "points")
        plan.wall(
            start,
            end,
            thickness_m=entry.number_of("thickness", 0.12, 0.01, 2.0),
            height_m=entry.number_of("height", 2.4, 0.02, 10.0),
            surface=surface,
        )


def _room(plan: FloorPlan, entry: TomlEntry, _day: int) -> None:
    low, high = entry.point("low"), entry.point("high")
    if not (low[0] < high[0] and low[1] < high[1]):
        raise entry.refuse("'low' must lie left of and below 'high'", "low")
    plan.room(entry.text_of("name"), low, high, kind=entry.text_of("kind", "room"))


def _door(plan: FloorPlan, entry: TomlEntry, _day: int) -> None:
    rooms = entry.values["rooms"]
    if not isinstance(rooms, list) or len(rooms) != 2:
        raise entry.refuse("'rooms' must be the names of two rooms", "rooms")
    a, b = (entry.checked_text(room, "rooms") for room in rooms)
    name = entry.text_of("name", f"door {entry.number + 1}")
    width = entry.number_of("width", 0.95, 0.4, 10.0)
    try:
        door = plan.door(name, entry.point("at"), (a, b), width_m=width)
    except BadWorld as error:
        raise entry.refuse(f"door '{name}' at {entry.values['at']} lies in no wall", "at") from error
    leaf = entry.choice("leaf", "none", ["none", "swings", "closed", "slides"])
    if leaf != "slides" and "open" in entry.values:
        raise entry.refuse("'open' is for a leaf that slides", "open")
    if leaf == "none":
        return
    (x0, y0), (x1, y1) = door.ends
    yaw = math.atan2(y1 - y0, x1 - x0)
    share = 0.0 if leaf == "closed" else 0.5
    period = entry.number_of("period", 60.0, 5.0, 1e6)
    if leaf == "slides":
        times = [entry.checked(item, "open", 2) for item in entry.items("open", "[from, to]")]
        if any(begin_s >= end_s for begin_s, end_s in times):
            raise entry.refuse("'open' must be [from, to] with from before to", "open")
        plan.mover(SlidingDoor(door.ends, tuple((begin_s, end_s) for begin_s, end_s in times), period))
        return
    plan.mover(SwingDoor((x0, y0), yaw, math.dist(*door.ends) - 0.02, period, share))


def _furniture(plan: FloorPlan, entry: TomlEntry, day: int) -> None:
    kind = entry.choice("kind", "", list(FURNITURE))
    x, y, yaw = entry.numbers("at", 3)
    for item in entry.items("moved", "[day, x, y, yaw]"):
        from_day, *place = entry.checked(item, "moved", 4)
        if from_day <= day:
            x, y, yaw = place
    for box in FURNITURE[kind](x, y, yaw):
        plan.box(box)


def _person(plan: FloorPlan, entry: TomlEntry, _day: int) -> None:
    plan.mover(
        Person(
            tuple(entry.points("points")),
            entry.number_of("speed", 1.1, 0.05, 3.0),
            entry.number_of("pause", 0.0, 0.0, 1e6),
        )
    )


def _barrier(plan: FloorPlan, entry: TomlEntry, _day: int) -> None:
    (x0, y0), (x1, y1) = entry.point("from"), entry.point("to")
    begin_s, end_s = entry.numbers("during", 2)
    half = (max(math.hypot(x1 - x0, y1 - y0) / 2, 0.05), 0.05, 0.5)
    box = Box(((x0 + x1) / 2, (y0 + y1) / 2, 0.5), half, math.atan2(y1 - y0, x1 - x0))
    plan.mover(Appearing((box,), begin_s, end_s))


_ADD: dict[str, Callable[[FloorPlan, TomlEntry, int], None]] = {
    "wall": _wall,
    "room": _room,
    "door": _door,
    "furniture": _furniture,
    "person": _person,
    "barrier": _barrier,
}


def _floors(plan: FloorPlan, ramps: list[TomlEntry], holes: list[TomlEntry]) -> None:
    """Lay a floor with holes, and ramps on it; a world without both needs no floor."""
    if not ramps and not holes:
        return
    plan.flat = False
    areas = [plan.outline(MARGIN_M)]
    for entry in holes:
        low, high = entry.point("low"), entry.point("high")
        areas = [piece for area in areas for piece in _without(area, (*low, *high))]
        if len(areas) > MAX_ITEMS:
            raise entry.refuse(f"the holes cut the floor into more than {MAX_ITEMS} pieces", "low")
    for x0, y0, x1, y1 in areas:
        centre = ((x0 + x1) / 2, (y0 + y1) / 2, -FLOOR_SLAB_M / 2)
        half = ((x1 - x0) / 2, (y1 - y0) / 2, FLOOR_SLAB_M / 2)
        plan.box(Box(centre, half, surface=Surface.FLOOR))
    for entry in ramps:
        plan.box(_ramp(entry))


def _ramp(entry: TomlEntry) -> Box:
    (x0, y0), (x1, y1) = entry.point("from"), entry.point("to")
    rise = entry.number_of("rise", 0.1, -5.0, 5.0)
    run = math.hypot(x1 - x0, y1 - y0)
    if run < 0.1 or abs(rise) > 0.27 * run:
        raise entry.refuse("a ramp steeper than 15 degrees cannot be driven", "rise")
    pitch, yaw, thick = math.atan2(rise, run), math.atan2(y1 - y0, x1 - x0), 0.05
    shift = math.sin(pitch) * thick
    centre = (
        (x0 + x1) / 2 + shift * math.cos(yaw),
        (y0 + y1) / 2 + shift * math.sin(yaw),
        rise / 2 - math.cos(pitch) * thick,
    )
    half = (math.hypot(run, rise) / 2, entry.number_of("width", 1.2, 0.4, 20.0) / 2, thick)
    return Box(centre, half, yaw, pitch, Surface.FLOOR)


def _without(area: Area, hole: Area) -> list[Area]:
    """Return what is left of a rectangle without another: at most four rectangles."""
    x0, y0, x1, y1 = area
    hx0, hy0, hx1, hy1 = max(x0, hole[0]), max(y0, hole[1]), min(x1, hole[2]), min(y1, hole[3])
    if hx0 >= hx1 or hy0 >= hy1:
        return [area]
    pieces = [(x0, y0, hx0, y1), (hx1, y0, x1, y1), (hx0, y0, hx1, hy0), (hx0, hy1, hx1, y1)]
    return [piece for piece in pieces if piece[0] < piece[2] and piece[1] < piece[3]]


def _faults(top: TomlEntry) -> Faults:
    entry = _table(top, "faults", top.values["faults"])
    return Faults(
        kobuki=_link(_table(top, "faults.kobuki", entry.values.get("kobuki", {}))),
        hokuyo=_link(_table(top, "faults.hokuyo", entry.values.get("hokuyo", {}))),
        stuck_left=_window(entry, "stuck_left"),
        stuck_right=_window(entry, "stuck_right"),
        blocked_laser=_window(entry, "blocked_laser"),
    )


def _table(top: TomlEntry, name: str, values: object) -> TomlEntry:
    if not isinstance(values, dict):
        raise top.refuse(f"write [{name}], a table", name.rpartition(".")[2])
    entry = TomlEntry(top.path, top.text, name, 0, values)
    entry.check_keys()
    return entry


def _link(entry: TomlEntry) -> LinkFaults:
    windows = entry.items("unplugged", "[from, to] in seconds")
    return LinkFaults(
        lose_byte=entry.number_of("lose_byte", 0.0, 0.0, 1.0),
        flip_bit=entry.number_of("flip_bit", 0.0, 0.0, 1.0),
        burst_s=entry.number_of("burst_s", 0.0, 0.0, 1.0),
        delay_s=entry.number_of("delay_s", 0.0, 0.0, 10.0),
        jitter_s=entry.number_of("jitter_s", 0.0, 0.0, 10.0),
        unplugged=tuple(_pair(entry, "unplugged", window) for window in windows),
    )


def _window(entry: TomlEntry, key: str) -> Window | None:
    return _pair(entry, key, entry.values[key]) if key in entry.values else None


def _pair(entry: TomlEntry, key: str, value: object) -> Window:
    begin_s, end_s = entry.checked(value, key, 2)
    return begin_s, end_s
