"""ROS map_server maps (YAML beside an image) as worlds: walls merged into few long boxes, extruded."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from lemtomap.sim.errors import BadWorld
from lemtomap.sim.plan_image import Drawing, read_drawing
from lemtomap.sim.plan_settings import read_settings
from lemtomap.sim.raster import (
    MAX_CELLS,
    SPAWN_CLEARANCE_M,
    boxes_from_raster,
    connected,
    find_spawn,
    fits,
    require_cells,
)
from lemtomap.sim.truth.beside import PlanFrame, read_truth
from lemtomap.sim.turned import turned
from lemtomap.sim.world import Pose2, Raster, World

WALL_HEIGHT_M = 1.0
SOLID_M2 = 0.25  # unmapped ground of that size is what nobody could look into; less is a speck of the mapping
WITHOUT = "driving without rooms as ground truth"
GAP_M = 2.5  # between copies and round them
KNOWN_SPAWNS: dict[str, Pose2] = {
    "willowgarage_perfect": (6.0, -16.0, 0.0)
}  # as in 2014 (ros_lemtomap launch)


def load_ros_map(path: Path) -> World:
    """Read a map_server map. Raises BadWorld naming the file and the reason."""
    settings = read_settings(path)
    drawing = read_drawing(settings)
    if not drawing.floor.any():
        free = f"free_thresh {settings.free_thresh:g}"
        raise BadWorld(f"{settings.image}: no free space (no pixel is free by {free})")
    x0, y0, yaw = settings.origin
    step = settings.resolution_m
    try:
        ground, (row, col) = _ground(drawing, step)
        raster = Raster(ground.occupied, ground.free, step, (x0 + col * step, y0 + row * step))
        spawn = _spawn(raster, ground.wall, path)
        raster = replace(raster, free=connected(raster, spawn[:2]))
        rows, cols = drawing.floor.shape
        truth = read_truth(path.parent, PlanFrame((x0, y0), step, rows, cols))
        world = World(
            name=path.stem,
            boxes=boxes_from_raster(raster, WALL_HEIGHT_M),
            raster=raster,
            spawn=spawn,
            truth=truth,
            description=f"ROS map {path.name}",
            remarks=(
                *drawing.remarks,
                *(f"{line}; driving without rooms as ground truth" for line in truth.damage),
            ),
        )
        return turned(world, (x0, y0), yaw) if yaw else world
    except BadWorld as error:
        raise BadWorld(f"{path}: {str(error).removeprefix(f'{path}: ')}") from error


@dataclass(frozen=True, slots=True)
class _Ground:
    """Where a robot could drive, bool (rows, cols) each."""

    wall: NDArray[np.bool_]
    """What the image draws as occupied."""
    occupied: NDArray[np.bool_]
    free: NDArray[np.bool_]

    def part(self, rows: slice, cols: slice) -> "_Ground":
        return _Ground(self.wall[rows, cols], self.occupied[rows, cols], self.free[rows, cols])


def _ground(drawing: Drawing, resolution_m: float) -> tuple[_Ground, tuple[int, int]]:
    """Decide on unmapped ground, and return row and column of the first cell in the image.

    What lies outside the image is unmapped, too: where floor reaches its edge, a rim of cells more takes the
    wall. Of an image too large to work on, what is mapped is cut out. Raises BadWorld when that is too large.
    """
    wall, floor, row, col = drawing.wall, drawing.floor, 0, 0
    if wall.size > MAX_CELLS:
        known = wall | floor
        rows, cols = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
        row, col = int(rows[0]), int(cols[0])
        wall, floor = (part[row : rows[-1] + 1, col : cols[-1] + 1] for part in (wall, floor))
    require_cells(wall.shape[0], wall.shape[1], resolution_m)
    ground = _close(np.pad(wall, 1), np.pad(floor, 1), resolution_m)
    rim = ground.occupied.copy()
    rim[1:-1, 1:-1] = False
    if rim.any():
        return ground, (row - 1, col - 1)
    return ground.part(slice(1, -1), slice(1, -1)), (row, col)


def _close(wall: NDArray[np.bool_], floor: NDArray[np.bool_], resolution_m: float) -> _Ground:
    """Wall off large unmapped ground where it borders on floor, as nothing is known behind; a speck is floor.

    Without that a robot leaves a real plan through glass and gaps, into a plain without end.
    """
    unmapped = ~wall & ~floor
    labels, _ = ndimage.label(unmapped)
    large = np.bincount(labels.ravel()) * resolution_m**2 >= SOLID_M2
    large[labels[0, 0]] = True  # the rim goes on outside
    large[0] = False
    solid = large[labels]
    free = floor | (unmapped & ~solid)
    return _Ground(wall, wall | (solid & ndimage.binary_dilation(free)), free)


def _spawn(raster: Raster, wall: NDArray[np.bool_], path: Path) -> Pose2:
    known = KNOWN_SPAWNS.get(path.stem)
    if known is not None and fits(raster, known[0], known[1], SPAWN_CLEARANCE_M):
        return known
    return find_spawn(raster, str(path), wall)


def side_by_side(world: World, copies: int) -> World:
    """Return so many copies of a map in a row, GAP_M apart, a wall round them all: they look all the same.

    Raises BadWorld when they become too large.
    """
    raster = world.raster
    step = raster.resolution_m
    rows, cols = np.nonzero(raster.occupied)
    gap = round(GAP_M / step)
    building = np.pad(raster.occupied[rows.min() : rows.max() + 1, cols.min() : cols.max() + 1], gap)
    pitch = building.shape[1] - gap
    require_cells(building.shape[0], pitch * copies + gap, step)
    occupied = np.zeros((building.shape[0], pitch * copies + gap), dtype=np.bool_)
    for index in range(copies):
        occupied[:, index * pitch : index * pitch + building.shape[1]] |= building
    occupied[:2] = occupied[-2:] = True
    occupied[:, :2] = occupied[:, -2:] = True
    x0 = raster.origin_m[0] + (int(cols.min()) - gap) * step
    y0 = raster.origin_m[1] + (int(rows.min()) - gap) * step
    joined = Raster(occupied, ~occupied, step, (x0, y0))
    joined = Raster(occupied, connected(joined, world.spawn[:2]), step, (x0, y0))
    return World(
        name=f"{world.name}@{copies}",
        boxes=boxes_from_raster(joined, WALL_HEIGHT_M),
        raster=joined,
        spawn=world.spawn,
        description=f"{copies} x {world.description}",
        remarks=world.remarks,
    )
