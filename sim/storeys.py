"""A multi-storey building: the office floor over itself, joined by ramps a Kobuki can climb.

Along the north wall runs a ramp shaft. The ramp from one level to the next rises from the west landing to the
east landing; both landings of each level have a door into the floor, so the way up leads through every level.
"""

import math
from collections.abc import Iterable

from lemtomap.sim.floorplan import FloorPlan
from lemtomap.sim.office import DEPTH_M, LENGTH_M, draw_office
from lemtomap.sim.world import Box, Surface, World

LEVEL_M = 1.3  # storey height: 5.7 degrees over the ramp; Kobuki climbs 12
SLAB_M = 0.1
LANDING_M = 1.5
SHAFT_M = 1.6
WALL_HEIGHT_M = LEVEL_M - SLAB_M
Area = tuple[float, float, float, float]


def storeys(levels: int = 3, _seed: int = 0) -> World:
    """Return `levels` office floors one over the other."""
    levels = max(1, levels)
    plan = FloorPlan("storeys", wall_height_m=WALL_HEIGHT_M)
    plan.flat = False
    plan.level_height_m = LEVEL_M
    top = DEPTH_M + SHAFT_M
    for level in range(levels):
        plan.level = level
        draw_office(plan, 0.0, f"{level}/")
        _shaft_walls(plan, f"{level}/", top)
        for area in _floor_areas(level, top):
            plan.box(slab(area, level * LEVEL_M))
        if level + 1 < levels:
            plan.box(ramp((LANDING_M, level * LEVEL_M), (LENGTH_M - LANDING_M, (level + 1) * LEVEL_M), top))
    return plan.build((2.0, 5.0, 0.0), f"{levels} floors of 16 x 10 m, joined by ramps of 5.7 degrees")


def _shaft_walls(plan: FloorPlan, prefix: str, top: float) -> None:
    plan.wall((0.0, DEPTH_M), (0.0, top))
    plan.wall((LENGTH_M, DEPTH_M), (LENGTH_M, top))
    plan.wall((0.0, top), (LENGTH_M, top))
    plan.room(f"{prefix}ramp", (0.0, DEPTH_M), (LENGTH_M, top), kind="ramp")
    plan.door(f"{prefix}door ramp west", (0.75, DEPTH_M), (f"{prefix}north 1", f"{prefix}ramp"))
    plan.door(f"{prefix}door ramp east", (LENGTH_M - 0.75, DEPTH_M), (f"{prefix}lobby", f"{prefix}ramp"))


def _floor_areas(level: int, top: float) -> list[Area]:
    """Return what is floor: the ground everywhere, above it all but the shaft between the landings."""
    if level == 0:
        return [(-0.5, -0.5, LENGTH_M + 0.5, top + 0.5)]
    return [
        (-0.5, -0.5, LENGTH_M + 0.5, DEPTH_M),
        (-0.5, DEPTH_M, LANDING_M, top + 0.5),
        (LENGTH_M - LANDING_M, DEPTH_M, LENGTH_M + 0.5, top + 0.5),
    ]


def slab(area: Area, level_m: float) -> Box:
    """Return a floor whose upper side lies at level_m."""
    x0, y0, x1, y1 = area
    centre = ((x0 + x1) / 2, (y0 + y1) / 2, level_m - SLAB_M / 2)
    return Box(centre, ((x1 - x0) / 2, (y1 - y0) / 2, SLAB_M / 2), surface=Surface.FLOOR)


def ramp(start: tuple[float, float], end: tuple[float, float], top: float) -> Box:
    """Return the ramp of the shaft: upper side from (x, z) start to (x, z) end."""
    (x0, z0), (x1, z1) = start, end
    pitch = math.atan2(z1 - z0, x1 - x0)
    length = math.hypot(x1 - x0, z1 - z0)
    centre = (
        (x0 + x1) / 2 + math.sin(pitch) * SLAB_M / 2,
        (DEPTH_M + top) / 2,
        (z0 + z1) / 2 - math.cos(pitch) * SLAB_M / 2,
    )
    return Box(centre, (length / 2, SHAFT_M / 2, SLAB_M / 2), pitch_rad=pitch, surface=Surface.FLOOR)


def way_up(levels: int) -> list[tuple[float, float]]:
    """Return the waypoints of a drive from the spawn to the top level: once through every floor."""
    west, east, middle = (0.75, DEPTH_M + SHAFT_M / 2), (LENGTH_M - 0.75, DEPTH_M + SHAFT_M / 2), (8.0, 5.0)
    return [(2.0, 5.0), *(point for _ in range(levels - 1) for point in (west, east, middle))]


def there_and_back(waypoints: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return waypoints forth and back."""
    forth = list(waypoints)
    return forth + forth[-2::-1]
