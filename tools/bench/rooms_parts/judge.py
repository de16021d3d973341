"""A drive held against the truth: doors, passages, areas over nodes and over the seen floor."""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from matplotlib.path import Path as Outline
from numpy.typing import NDArray

from lemtomap.se2 import Pose, wrap_angle
from lemtomap.sim.truth.model import Doorway
from lemtomap.sim.world import Raster, World
from tools.bench.rooms_parts.drive import Drive, Step
from tools.bench.rooms_parts.score import DoorMatch, Labels, adjusted_rand, match_doors, room_f1

SEEN_WITHIN_M = 3.0
HALF_VIEW_RAD = math.radians(120.0)
CHANGE_WITHIN_M = 1.5
NODE_SEES_M = 12.0


@dataclass(slots=True)
class Verdict:
    """The figures of one drive, and what a picture of it needs."""

    match: DoorMatch
    counts: NDArray[np.bool_]
    passed: int
    noticed: int
    false_changes: int
    path_m: float
    ari: float
    f1: float
    cells: Labels
    """Area of each seen floor cell of a room that the robot was in, 0 for others."""


def judge(world: World, drive: Drive) -> Verdict:
    """Return the figures of a drive."""
    raster, doors = world.raster, world.truth.doors
    counts = np.array([door.is_door and _seen_open(door, raster, drive.steps) for door in doors], dtype=bool)
    true = np.array([(*door.centre, door.width_m) for door in doors]).reshape(-1, 3)
    found = np.array([door[:3] for door in drive.doors]).reshape(-1, 3)
    passed, noticed, false = passages(doors, drive.steps, _rooms_on_way(world, drive.steps))
    numbers = {room.name: number + 1 for number, room in enumerate(world.truth.rooms)}
    nodes = sorted(drive.T_world_node)
    names = [world.truth.room_at(*drive.T_world_node[node][:2]) or "" for node in nodes]
    room_of_node = np.array([numbers.get(name, 0) for name in names], dtype=np.int64)
    area_of_node = np.array([drive.area_of.get(node, 0) for node in nodes], dtype=np.int64)
    truth, answer = _floor(world, drive, numbers, set(room_of_node.tolist()) - {0})
    path_m = drive.steps[-1].path_m if drive.steps else 0.0
    return Verdict(
        match_doors(true, counts, found), counts, passed, noticed, false, path_m,
        adjusted_rand(room_of_node, area_of_node), room_f1(truth[truth != 0], answer[truth != 0]), answer,
    )  # fmt: skip


def passages(doors: tuple[Doorway, ...], steps: list[Step], rooms: list[str | None]) -> tuple[int, int, int]:
    """Return how often a true door was passed, how often the area changed then, and changes elsewhere."""
    changes = [b.path_m for a, b in pairwise(steps) if a.area and a.area != b.area]
    crossed, really = [], []
    for k, (a, b) in enumerate(pairwise(steps)):
        through = [door for door in doors if _crosses(a.T_world_base, b.T_world_base, door)]
        crossed += [b.path_m for door in through if door.is_door]
        if through or rooms[k] != rooms[k + 1]:
            really.append(b.path_m)
    near = [any(abs(change - at) <= CHANGE_WITHIN_M for change in changes) for at in crossed]
    false = [all(abs(change - at) > CHANGE_WITHIN_M for at in really) for change in changes]
    return len(crossed), sum(near), sum(false)


def _rooms_on_way(world: World, steps: list[Step]) -> list[str | None]:
    """Return the room of each step; where none is drawn, the last one."""
    rooms: list[str | None] = []
    for step in steps:
        x, y = float(step.T_world_base[0]), float(step.T_world_base[1])
        rooms.append(world.truth.room_at(x, y) or (rooms[-1] if rooms else None))
    return rooms


def _crosses(a: Pose, b: Pose, door: Doorway) -> bool:
    """Return True if a straight step leads between the jambs."""
    (px, py), (qx, qy) = door.ends

    def side(ox: float, oy: float, ux: float, uy: float, x: float, y: float) -> float:
        return ux * (y - oy) - uy * (x - ox)

    ax, ay, bx, by = (float(v) for v in (a[0], a[1], b[0], b[1]))
    of_door = side(px, py, qx - px, qy - py, ax, ay), side(px, py, qx - px, qy - py, bx, by)
    of_step = side(ax, ay, bx - ax, by - ay, px, py), side(ax, ay, bx - ax, by - ay, qx, qy)
    return of_door[0] * of_door[1] < 0.0 and of_step[0] * of_step[1] < 0.0


def _seen_open(door: Doorway, raster: Raster, steps: list[Step]) -> bool:
    """Return True if its middle was free, and in view of the laser from within 3 m at some time."""
    (ax, ay), (bx, by) = door.ends
    inner = np.linspace(0.25, 0.75, 9)
    if _met(raster, ax + inner * (bx - ax), ay + inner * (by - ay)):
        return False
    x, y = door.centre
    return any(_in_view(step.T_world_base, x, y, raster) for step in steps)


def _in_view(T_world_base: Pose, x: float, y: float, raster: Raster) -> bool:
    dx, dy = x - float(T_world_base[0]), y - float(T_world_base[1])
    away_m = math.hypot(dx, dy)
    bearing = float(wrap_angle(math.atan2(dy, dx) - T_world_base[2]))
    if away_m > SEEN_WITHIN_M or abs(bearing) > HALF_VIEW_RAD:
        return False
    along = np.linspace(0.0, 1.0, max(2, round(away_m / raster.resolution_m)))
    return not _met(raster, T_world_base[0] + along * dx, T_world_base[1] + along * dy)


def _met(raster: Raster, x: NDArray[np.float64], y: NDArray[np.float64]) -> bool:
    rows, cols = _cells(raster, x, y)
    return bool(raster.occupied[rows, cols].any())


def _cells(
    raster: Raster, x: NDArray[np.float64], y: NDArray[np.float64]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    (x0, y0), step, (rows, cols) = raster.origin_m, raster.resolution_m, raster.free.shape
    row = np.clip(np.floor((y - y0) / step).astype(np.intp), 0, rows - 1)
    return row, np.clip(np.floor((x - x0) / step).astype(np.intp), 0, cols - 1)


def _floor(world: World, drive: Drive, numbers: dict[str, int], entered: set[int]) -> tuple[Labels, Labels]:
    """Return true room and area of each cell, int64 (rows, cols) each, 0 where nothing is to be judged.

    Judged is floor that the laser saw, in rooms in which a node was born, in view of some node.
    """
    raster = world.raster
    answer = nearest_visible(raster, drive.T_world_node, drive.area_of)
    answer[~(drive.seen & raster.free)] = 0
    truth = np.zeros(answer.shape, dtype=np.int64)
    cells = np.argwhere(answer != 0)
    points = np.array(raster.origin_m) + (cells[:, ::-1] + 0.5) * raster.resolution_m
    truth[tuple(cells.T)] = room_numbers(world, points, numbers)
    truth[~np.isin(truth, list(entered))] = 0
    answer[truth == 0] = 0
    return truth, answer


def room_numbers(world: World, points: NDArray[np.float64], numbers: dict[str, int]) -> Labels:
    """Return the number of the room around each of many points, float64 (N, 2), world; 0: none."""
    found = np.zeros(len(points), dtype=np.int64)
    if world.truth.image is not None:
        names = [world.truth.room_at(float(x), float(y)) or "" for x, y in points]
        return np.array([numbers.get(name, 0) for name in names], dtype=np.int64)
    for room in reversed(world.truth.rooms):
        if room.level == 0 and len(points):
            found[Outline(room.outline).contains_points(points)] = numbers[room.name]
    return found


def nearest_visible(raster: Raster, nodes: dict[int, Pose], area_of: dict[int, int]) -> Labels:
    """Return the area of the nearest node in view of each cell, int64 (rows, cols); 0: none in view."""
    best = np.full(raster.free.size, np.inf)
    areas = np.zeros(raster.free.size, dtype=np.int64)
    reach = np.arange(0.0, NODE_SEES_M, 0.7 * raster.resolution_m)
    yaw = np.arange(0.0, 2.0 * math.pi, raster.resolution_m / NODE_SEES_M)
    for node, T_world_node in nodes.items():
        x = T_world_node[0] + np.cos(yaw)[:, None] * reach
        y = T_world_node[1] + np.sin(yaw)[:, None] * reach
        rows, cols = _cells(raster, x, y)
        clear = ~np.logical_or.accumulate(raster.occupied[rows, cols], axis=1)
        cells = (rows * raster.free.shape[1] + cols)[clear]
        away = np.broadcast_to(reach, clear.shape)[clear]
        nearer = away < best[cells] - 1e-9
        np.minimum.at(best, cells[nearer], away[nearer])
        areas[cells[nearer]] = area_of.get(node, 0)
    return areas.reshape(raster.free.shape)
