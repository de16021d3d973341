"""Buildings made by rules and a seed: larger offices, a loop, a featureless corridor, a campus."""

import math
from itertools import pairwise

import numpy as np

from lemtomap.sim import furniture
from lemtomap.sim.floorplan import FloorPlan
from lemtomap.sim.movers import Person
from lemtomap.sim.world import World

CORRIDOR_M = 2.0
ROOM_DEPTH_M = (3.6, 4.6)
ROOM_WIDTH_M = (2.8, 4.4)
ROOMS_PER_SIDE = 10
WALK_M, WALK_Y_M = 8.0, 6.0
Point = tuple[float, float]


def corridor(length_m: int = 40, _seed: int = 0) -> World:
    """Return the featureless corridor of Appendix D: two walls and two ends far apart."""
    length_m = max(length_m, 4)
    plan = FloorPlan("corridor")
    plan.rectangle((0.0, 0.0), (float(length_m), CORRIDOR_M))
    plan.room("corridor", (0.0, 0.0), (float(length_m), CORRIDOR_M), kind="corridor")
    return plan.build((1.2, 1.0, 0.0), f"a featureless corridor, {length_m} x 2 m")


def offices(rooms: int = 60, seed: int = 0) -> World:
    """Return a floor of about `rooms` rooms along parallel corridors that cross corridors join into loops."""
    rng = np.random.default_rng(seed)
    plan = FloorPlan("offices")
    bands = max(1, math.ceil(rooms / (2 * ROOMS_PER_SIDE)))
    per_side = math.ceil(rooms / (2 * bands))
    _floor(plan, rng, (0.0, 0.0), bands, per_side, "")
    return plan.build(None, f"{2 * bands * per_side} rooms along {bands} corridors, seed {seed}")


def _floor(
    plan: FloorPlan, rng: np.random.Generator, low: Point, bands: int, per_side: int, prefix: str
) -> Point:
    """Draw one floor with its lower left corner at low; return its upper right corner."""
    x0, y = low
    begin, width = x0 + CORRIDOR_M, per_side * sum(ROOM_WIDTH_M) / 2
    end = begin + width
    plan_names = [f"{prefix}corridor {band + 1}" for band in range(bands)]
    lanes: list[float] = []
    for band, name in enumerate(plan_names):
        for side in ("south", "north"):
            depth = float(rng.uniform(*ROOM_DEPTH_M))
            rows = (y, y + depth)
            _rooms(plan, rng, (begin, end), rows, (side, per_side, f"{prefix}{band + 1}{side[0]}", name))
            y += depth
            if side == "south":
                plan.room(name, (x0, y), (end + CORRIDOR_M, y + CORRIDOR_M), kind="corridor")
                lanes.append(y + CORRIDOR_M / 2)
                y += CORRIDOR_M
    top = y
    plan.rectangle((x0, low[1]), (end + CORRIDOR_M, top))
    for name, x in ((f"{prefix}west lane", begin), (f"{prefix}east lane", end)):
        left = x0 if x == begin else end
        plan.room(name, (left, low[1]), (left + CORRIDOR_M, top), kind="corridor")
        for lane, corridor_name in zip(lanes, plan_names, strict=True):
            half = CORRIDOR_M / 2
            ends = ((x, lane - half), (x, lane + half))
            plan.opening(f"{corridor_name} {name}", *ends, (name, corridor_name))
    return end + CORRIDOR_M, top


def _rooms(
    plan: FloorPlan,
    rng: np.random.Generator,
    x_range: tuple[float, float],
    y_range: tuple[float, float],
    row: tuple[str, int, str, str],
) -> None:
    """Draw one row of rooms: a back wall, a front wall with doors, and walls between."""
    side, count, prefix, corridor_name = row
    (begin, end), (low, high) = x_range, y_range
    shares = rng.uniform(*ROOM_WIDTH_M, count)
    edges = begin + np.concatenate([[0.0], np.cumsum(shares)]) * (end - begin) / shares.sum()
    front = high if side == "south" else low
    plan.wall((begin, front), (end, front))
    plan.wall((begin, low + high - front), (end, low + high - front))
    for index, (left, right) in enumerate(pairwise(edges)):
        name = f"{prefix}{index + 1}"
        plan.room(name, (float(left), low), (float(right), high))
        plan.wall((float(left), low), (float(left), high))
        door = float(rng.uniform(left + 0.8, right - 0.8))
        plan.door(f"door {name}", (door, front), (name, corridor_name))
        if index and rng.random() < 0.15:
            middle = (low + high) / 2
            plan.door(f"door {name}-", (float(left), middle), (f"{prefix}{index}", name))
        _furnish(plan, rng, (float(left), low, float(right), high), (door, front))
    plan.wall((end, low), (end, high))


def _furnish(
    plan: FloorPlan, rng: np.random.Generator, room: tuple[float, float, float, float], door: Point
) -> None:
    """Put a cabinet along a side wall, and mostly a table and a chair, away from the door."""
    left, low, right, high = room
    back = low if door[1] == high else high
    inwards = 1.0 if back == low else -1.0
    x = left + 0.35 if door[0] - left > right - door[0] else right - 0.35
    pieces = [furniture.cabinet(x, back + inwards * float(rng.uniform(0.9, 1.2)), math.pi / 2)]
    if rng.random() < 0.8:
        table_x = float(rng.uniform(left + 1.3, right - 1.3)) if right - left > 2.7 else (left + right) / 2
        pieces.append(furniture.table(table_x, back + inwards * 0.6, 0.0))
        if rng.random() < 0.5:
            pieces.append(furniture.office_chair(table_x, back + inwards * 1.3, float(rng.uniform(0, 6))))
    for boxes in pieces:
        for box in boxes:
            plan.box(box)


def loop(people: int = 0, seed: int = 0) -> World:
    """Return a corridor that runs round a core, rooms outside, 24 x 18 m; people may walk it."""
    rng = np.random.default_rng(seed)
    plan = FloorPlan("loop")
    plan.rectangle((0.0, 0.0), (24.0, 18.0))
    plan.rectangle((6.0, 6.0), (18.0, 12.0))
    plan.room("core", (6.0, 6.0), (18.0, 12.0))
    for name, low, high in (
        ("corridor south", (4.0, 4.0), (20.0, 6.0)),
        ("corridor north", (4.0, 12.0), (20.0, 14.0)),
        ("corridor west", (4.0, 6.0), (6.0, 12.0)),
        ("corridor east", (18.0, 6.0), (20.0, 12.0)),
    ):
        plan.room(name, low, high, kind="corridor")
    for x, name in ((4.0, "west"), (18.0, "east")):
        for y, other in ((6.0, "south"), (12.0, "north")):
            ends = ((x, y), (x + 2.0, y))
            plan.opening(f"corner {other} {name}", *ends, (f"corridor {other}", f"corridor {name}"))
    _rooms(plan, rng, (4.0, 20.0), (0.0, 4.0), ("south", 4, "s", "corridor south"))
    _rooms(plan, rng, (4.0, 20.0), (14.0, 18.0), ("north", 4, "n", "corridor north"))
    for name, x, wall in (("west", 0.0, 4.0), ("east", 20.0, 20.0)):
        plan.wall((wall, 4.0), (wall, 14.0))
        plan.room(f"hall {name}", (x, 0.0), (x + 4.0, 18.0), kind="hall")
        plan.door(f"door hall {name}", (wall, 9.0), (f"hall {name}", f"corridor {name}"))
    plan.door("door core", (12.0, 6.0), ("core", "corridor south"))
    ring = ((5.0, 5.0), (19.0, 5.0), (19.0, 13.0), (5.0, 13.0))
    for _ in range(people):
        plan.mover(Person(ring, speed_mps=float(rng.uniform(0.7, 1.3))))
    return plan.build((8.0, 5.0, 0.0), f"a corridor round a core, {people} people")


def campus(buildings: int = 4, seed: int = 0) -> World:
    """Return N office buildings in a row, joined by covered walks; no two alike."""
    rng = np.random.default_rng(seed)
    plan = FloorPlan("campus")
    x, before = 0.0, ""
    for index in range(max(1, buildings)):
        prefix = f"{chr(ord('A') + index % 26)}{index // 26 or ''}-"
        right, _ = _floor(plan, rng, (x, 0.0), int(rng.integers(1, 3)), int(rng.integers(3, 6)), prefix)
        if index:
            _walk(plan, (x - WALK_M, x), (before, prefix))
        before, x = prefix, right + WALK_M
    return plan.build(None, f"{buildings} buildings joined by covered walks, seed {seed}")


def _walk(plan: FloorPlan, x_range: tuple[float, float], prefixes: tuple[str, str]) -> None:
    """Join two buildings by a covered walk 2 m wide."""
    (begin, end), y, name = x_range, WALK_Y_M, f"walk {prefixes[0]}{prefixes[1][:-1]}"
    plan.wall((begin, y - 1.0), (end, y - 1.0))
    plan.wall((begin, y + 1.0), (end, y + 1.0))
    plan.room(name, (begin, y - 1.0), (end, y + 1.0), kind="corridor")
    plan.door(f"{name} west", (begin, y), (f"{prefixes[0]}east lane", name), width_m=1.2)
    plan.door(f"{name} east", (end, y), (name, f"{prefixes[1]}west lane"), width_m=1.2)
