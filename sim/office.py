"""The built-in office: a corridor with rooms on both sides, 16 x 10 m, drawn by code: no data needed."""

import math

from sim import furniture
from sim.floorplan import FloorPlan
from sim.world import World


def office() -> World:
    """Return the small default world."""
    plan = FloorPlan("office")
    plan.rectangle((0.0, 0.0), (16.0, 10.0))
    plan.wall((0.0, 4.0), (16.0, 4.0))
    plan.wall((0.0, 6.0), (12.0, 6.0))
    plan.room("corridor", (0.0, 4.0), (16.0, 6.0), kind="corridor")
    _south(plan)
    _north(plan)
    _furnish(plan)
    plan.dock = (0.35, 5.0, 0.0)
    return plan.build((2.0, 5.0, 0.0), "a corridor, seven rooms, 16 x 10 m (built in)")


def _south(plan: FloorPlan) -> None:
    edges = [0.0, 4.2, 7.6, 12.0, 16.0]
    doors = [2.9, 5.4, 11.0, 13.2]
    for index, (x0, x1, door) in enumerate(zip(edges[:-1], edges[1:], doors, strict=True)):
        name = f"south {index + 1}"
        plan.room(name, (x0, 0.0), (x1, 4.0))
        if x0 > 0.0:
            plan.wall((x0, 0.0), (x0, 4.0))
        plan.door(f"door {name}", (door, 4.0), (name, "corridor"))
    plan.door("door between south", (12.0, 1.6), ("south 3", "south 4"))


def _north(plan: FloorPlan) -> None:
    edges = [0.0, 5.0, 8.4, 12.0]
    doors = [1.2, 7.4, 9.3]
    for index, (x0, x1, door) in enumerate(zip(edges[:-1], edges[1:], doors, strict=True)):
        name = f"north {index + 1}"
        plan.room(name, (x0, 6.0), (x1, 10.0))
        plan.wall((x1, 6.0), (x1, 10.0))
        plan.door(f"door {name}", (door, 6.0), (name, "corridor"))
    plan.room("lobby", (12.0, 6.0), (16.0, 10.0))  # open to the corridor: no wall between
    plan.door("door north 3 lobby", (12.0, 8.6), ("north 3", "lobby"))


def _furnish(plan: FloorPlan) -> None:
    right = math.pi / 2
    pieces = [
        furniture.cabinet(1.0, 0.4, 0.0),
        furniture.table(1.4, 2.0, 0.0),
        furniture.cabinet(4.6, 1.2, right),
        furniture.table(6.4, 1.0, 0.3),
        furniture.cabinet(9.4, 0.4, 0.0, (2.0, 0.45)),
        furniture.table(9.6, 2.4, 0.0, (1.6, 0.8)),
        furniture.cabinet(15.6, 1.5, right),
        furniture.sofa(14.0, 0.6, 0.0),
        furniture.cabinet(4.6, 8.6, right),
        furniture.table(2.4, 9.3, 0.0),
        furniture.cabinet(6.7, 9.6, 0.0),
        furniture.table(10.4, 9.3, 0.0, (1.2, 0.7)),
        furniture.cabinet(15.6, 8.4, right, (1.6, 0.45)),
        furniture.table(13.6, 9.2, 0.0),
    ]
    for boxes in pieces:
        for box in boxes:
            plan.box(box)
