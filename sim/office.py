"""The built-in office: a corridor with rooms on both sides, 16 x 10 m, drawn by code: no data needed."""

import math

import numpy as np

from lemtomap.sim import furniture
from lemtomap.sim.floorplan import FloorPlan
from lemtomap.sim.world import Box, World

LENGTH_M, DEPTH_M = 16.0, 10.0
SOUTH_EDGES, SOUTH_DOORS = (0.0, 4.2, 7.6, 12.0, 16.0), (2.9, 5.4, 11.0, 13.2)
NORTH_EDGES, NORTH_DOORS = (0.0, 5.0, 8.4, 12.0), (1.2, 7.4, 9.3)


def office(copies: int = 1, day: int = 0) -> World:
    """Return the small default world; `copies` of it side by side look all the same, as in the thesis.

    On another day some of the furniture stands elsewhere.
    """
    plan = FloorPlan("office" if copies == 1 else f"office@{copies}")
    for index in range(copies):
        draw_office(plan, index * LENGTH_M, f"{index + 1}/" if copies > 1 else "")
        if index:
            at = (index * LENGTH_M, 5.0)
            plan.door(f"door to {index + 1}", at, (f"{index}/corridor", f"{index + 1}/corridor"), width_m=1.2)
        for boxes in _furniture(day, index):
            for box in boxes:
                plan.box(_shifted(box, index * LENGTH_M))
    plan.dock = (0.35, 5.0, 0.0)
    return plan.build((2.0, 5.0, 0.0), f"a corridor and eight rooms, {copies * 16} x 10 m")


def _shifted(box: Box, x0: float) -> Box:
    x, y, z = box.centre
    return Box((x + x0, y, z), box.half, box.yaw_rad, box.pitch_rad, box.surface)


def draw_office(plan: FloorPlan, x0: float, prefix: str) -> None:
    """Draw the walls, doors and rooms of one office, its lower left corner at (x0, 0)."""
    if x0 == 0.0:
        plan.wall((0.0, DEPTH_M), (0.0, 0.0))
    plan.wall((x0, 0.0), (x0 + LENGTH_M, 0.0))
    plan.wall((x0 + LENGTH_M, 0.0), (x0 + LENGTH_M, DEPTH_M))
    plan.wall((x0 + LENGTH_M, DEPTH_M), (x0, DEPTH_M))
    plan.wall((x0, 4.0), (x0 + LENGTH_M, 4.0))
    plan.wall((x0, 6.0), (x0 + 12.0, 6.0))
    plan.room(f"{prefix}corridor", (x0, 4.0), (x0 + LENGTH_M, 6.0), kind="corridor")
    _side(plan, x0, prefix, "south", (0.0, 4.0), (SOUTH_EDGES, SOUTH_DOORS))
    _side(plan, x0, prefix, "north", (6.0, DEPTH_M), (NORTH_EDGES, NORTH_DOORS))
    plan.wall((x0 + 12.0, 6.0), (x0 + 12.0, DEPTH_M))
    plan.room(f"{prefix}lobby", (x0 + 12.0, 6.0), (x0 + LENGTH_M, DEPTH_M), kind="hall")
    plan.opening(
        f"{prefix}lobby front", (x0 + 12.0, 6.0), (x0 + 16.0, 6.0), (f"{prefix}lobby", f"{prefix}corridor")
    )
    plan.door(f"{prefix}door south 3-4", (x0 + 12.0, 1.6), (f"{prefix}south 3", f"{prefix}south 4"))
    plan.door(f"{prefix}door north 3-lobby", (x0 + 12.0, 8.6), (f"{prefix}north 3", f"{prefix}lobby"))


def _side(
    plan: FloorPlan,
    x0: float,
    prefix: str,
    side: str,
    y_range: tuple[float, float],
    layout: tuple[tuple[float, ...], tuple[float, ...]],
) -> None:
    edges, doors = layout
    low, high = y_range
    front = high if side == "south" else low
    for index, (begin, end, door) in enumerate(zip(edges[:-1], edges[1:], doors, strict=True)):
        name = f"{prefix}{side} {index + 1}"
        plan.room(name, (x0 + begin, low), (x0 + end, high))
        if index:
            plan.wall((x0 + begin, low), (x0 + begin, high))
        plan.door(f"door {name}", (x0 + door, front), (name, f"{prefix}corridor"))


def _furniture(day: int, copy: int) -> list[list[Box]]:
    """Return the pieces; on later days half of the light ones have been moved a little."""
    right = math.pi / 2
    tables = [
        (1.4, 2.0, 0.0, (1.4, 0.7)),
        (6.4, 1.0, 0.3, (1.4, 0.7)),
        (9.6, 2.4, 0.0, (1.6, 0.8)),
        (2.4, 9.3, 0.0, (1.4, 0.7)),
        (10.4, 9.3, 0.0, (1.2, 0.7)),
        (13.6, 9.2, 0.0, (1.4, 0.7)),
    ]
    heavy = [
        furniture.cabinet(1.0, 0.4, 0.0),
        furniture.cabinet(4.6, 1.2, right),
        furniture.cabinet(9.4, 0.4, 0.0, (2.0, 0.45)),
        furniture.cabinet(15.6, 1.5, right),
        furniture.sofa(14.0, 0.6, 0.0),
        furniture.cabinet(4.6, 8.6, right),
        furniture.cabinet(6.7, 9.6, 0.0),
        furniture.cabinet(15.6, 8.4, right, (1.6, 0.45)),
    ]
    rng = np.random.default_rng([day, copy])
    light = []
    for x, y, yaw, size in tables:
        moved = rng.uniform(-0.4, 0.4, 2) if day and rng.random() < 0.5 else (0.0, 0.0)
        light.append(furniture.table(x + float(moved[0]), y + float(moved[1]), yaw, size))
    return heavy + light
