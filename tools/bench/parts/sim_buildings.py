"""Buildings that tempt a robot to err: offices all alike, and any building the day after."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from lemtomap.sim import furniture, worlds
from lemtomap.sim.floorplan import FloorPlan
from lemtomap.sim.raster import clearance_m, rasterise
from lemtomap.sim.truth.model import Doorway
from lemtomap.sim.world import (
    Box,
    Surface,
    World,
)

ROOM_M, DEPTH_M, CORRIDOR_M = 3.6, 4.2, 2.0
PIECE_M = 1.2  # boxes this near to one another are one piece of furniture
MOVED_M = 1.0
CLEAR_M, DOOR_CLEAR_M = 0.6, 1.1  # of a moved piece from walls, and from doors


def building(name: str) -> World:
    """Return a world by name; `alike:N` is a floor of N offices that look all the same. Raises BadWorld."""
    kind, _, number = name.partition(":")
    return alike(int(number)) if kind == "alike" and number.isdigit() else worlds.load(name)


def alike(rooms: int) -> World:
    """Return a corridor with identical offices on both sides, the same door, desk and cabinet in each."""
    count = max(1, rooms // 2)
    plan = FloorPlan(f"alike:{rooms}")
    width, top = count * ROOM_M, 2 * DEPTH_M + CORRIDOR_M
    plan.rectangle((0.0, 0.0), (width, top))
    plan.room("corridor", (0.0, DEPTH_M), (width, DEPTH_M + CORRIDOR_M), kind="corridor")
    for side, low, front in (("south", 0.0, DEPTH_M), ("north", DEPTH_M + CORRIDOR_M, DEPTH_M + CORRIDOR_M)):
        plan.wall((0.0, front), (width, front))
        back = low if side == "south" else low + DEPTH_M
        inwards = 1.0 if side == "south" else -1.0
        for index in range(count):
            left, name = index * ROOM_M, f"{side} {index + 1}"
            plan.room(name, (left, low), (left + ROOM_M, low + DEPTH_M))
            if index:
                plan.wall((left, low), (left, low + DEPTH_M))
            plan.door(f"door {name}", (left + 1.0, front), (name, "corridor"))
            for box in furniture.table(left + 2.4, back + 1.2 * inwards, 0.0):
                plan.box(box)
            for box in furniture.cabinet(left + 0.4, back + 0.8 * inwards, math.pi / 2):
                plan.box(box)
    return plan.build((1.5, DEPTH_M + 1.0, 0.0), f"{rooms} offices all alike")


def next_day(world: World, seed: int, moved_share: float = 0.3, shut_share: float = 0.5) -> World:
    """Return a building after a night: some of its furniture moved, some of its doors shut."""
    rng = np.random.default_rng([seed, 77])
    boxes: list[Box] = [box for box in world.boxes if box.surface not in _MOVABLE]
    for piece in _pieces(world.boxes):
        boxes += _elsewhere(piece, world, rng) if rng.random() < moved_share else piece
    doors = list(world.truth.doors)
    for index in rng.permutation(len(doors))[: round(shut_share * len(doors))]:
        boxes.append(_leaf(doors[index]))
    raster = rasterise(boxes, world.spawn[:2], world.raster.resolution_m)
    return replace(world, name=f"{world.name}, day {seed}", boxes=tuple(boxes), raster=raster)


_MOVABLE = frozenset({Surface.FURNITURE, Surface.DARK})


def _pieces(boxes: tuple[Box, ...]) -> Iterator[list[Box]]:
    """Iterate over pieces of furniture: boxes that follow one another and stand together."""
    piece: list[Box] = []
    for box in (each for each in boxes if each.surface in _MOVABLE):
        if piece and math.dist(piece[0].centre[:2], box.centre[:2]) > PIECE_M:
            yield piece
            piece = []
        piece.append(box)
    if piece:
        yield piece


def _elsewhere(piece: list[Box], world: World, rng: np.random.Generator) -> list[Box]:
    """Return a piece moved a little, clear of walls and doors; as it stood when there is no such place."""
    clearance = clearance_m(world.raster)
    x, y = np.mean([box.centre[:2] for box in piece], axis=0)
    for _ in range(30):
        dx, dy = rng.uniform(-MOVED_M, MOVED_M, 2)
        row, col = world.raster.cell(x + dx, y + dy)
        rows, cols = clearance.shape
        inside = 0 <= row < rows and 0 <= col < cols and clearance[row, col] >= CLEAR_M
        doors = [math.dist(door.centre, (x + dx, y + dy)) for door in world.truth.doors]
        if inside and min(doors, default=math.inf) >= DOOR_CLEAR_M:
            return [
                replace(box, centre=(box.centre[0] + dx, box.centre[1] + dy, box.centre[2])) for box in piece
            ]
    return piece


def _leaf(door: Doorway) -> Box:
    """Return the leaf of a shut door."""
    (x0, y0), (x1, y1) = door.ends
    half = (math.dist((x0, y0), (x1, y1)) / 2, 0.03, 1.0)
    return Box((*door.centre, 1.0), half, math.atan2(y1 - y0, x1 - x0), surface=Surface.WALL)
