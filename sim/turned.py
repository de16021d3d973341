"""Plans that stand askew in the frame of their map: the yaw of map_server's `origin`."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lemtomap.sim.raster import connected, require_cells
from lemtomap.sim.truth.model import Room
from lemtomap.sim.world import Box, Pose2, Raster, World

Point = tuple[float, float]


def turned(world: World, about: Point, yaw_rad: float) -> World:
    """Return a world turned about a point: walls, start, rooms and raster, in one and the same frame.

    Doors stay, as the files beside a map give them in the map's frame. Raises BadWorld when it is too large.
    """
    turn = _Turn(about, yaw_rad)
    raster = turn.raster(world.raster)
    spawn = turn.pose(world.spawn)
    raster = replace(raster, free=connected(raster, spawn[:2]))
    rooms = tuple(turn.room(room) for room in world.truth.rooms)
    image = world.truth.image and replace(world.truth.image, yaw_rad=yaw_rad)
    return replace(
        world,
        boxes=tuple(turn.box(box) for box in world.boxes),
        raster=raster,
        spawn=spawn,
        truth=replace(world.truth, rooms=rooms, image=image),
    )


class _Turn:
    def __init__(self, about: Point, yaw_rad: float) -> None:
        self._about, self._yaw = about, yaw_rad
        self._cos, self._sin = math.cos(yaw_rad), math.sin(yaw_rad)

    def point(self, x: float, y: float) -> Point:
        dx, dy = x - self._about[0], y - self._about[1]
        return (
            self._about[0] + self._cos * dx - self._sin * dy,
            self._about[1] + self._sin * dx + self._cos * dy,
        )

    def pose(self, pose: Pose2) -> Pose2:
        return (*self.point(pose[0], pose[1]), math.remainder(pose[2] + self._yaw, 2 * math.pi))

    def box(self, box: Box) -> Box:
        centre = (*self.point(box.centre[0], box.centre[1]), box.centre[2])
        return replace(box, centre=centre, yaw_rad=box.yaw_rad + self._yaw)

    def room(self, room: Room) -> Room:
        return replace(room, outline=tuple(self.point(x, y) for x, y in room.outline))

    def raster(self, raster: Raster) -> Raster:
        """Return the cells as the nearest ones of the plan; a wall of one cell keeps its cells in touch."""
        step = raster.resolution_m
        rows, cols = raster.occupied.shape
        x0, y0 = raster.origin_m
        ends = [(x0 + col * step, y0 + row * step) for row in (0, rows) for col in (0, cols)]
        corners = np.array([self.point(x, y) for x, y in ends])
        low, high = corners.min(axis=0), corners.max(axis=0)
        size = np.ceil((high - low) / step - 1e-6).astype(int)
        require_cells(int(size[1]), int(size[0]), step)
        inside, row, col = self._cells(raster, low, (int(size[1]), int(size[0])))
        occupied, free = np.zeros_like(inside), np.zeros_like(inside)
        occupied[inside] = raster.occupied[row, col]
        free[inside] = raster.free[row, col]
        return Raster(occupied, free, step, (float(low[0]), float(low[1])))

    def _cells(
        self, raster: Raster, low: NDArray[np.float64], shape: tuple[int, int]
    ) -> tuple[NDArray[np.bool_], NDArray[np.int32], NDArray[np.int32]]:
        """Return which cells of the new raster lie on the old one, and for those its rows and columns."""
        step = raster.resolution_m
        dx = low[0] + (np.arange(shape[1], dtype=np.float32) + 0.5) * step - self._about[0]
        dy = (low[1] + (np.arange(shape[0], dtype=np.float32) + 0.5) * step - self._about[1])[:, None]
        shift_x, shift_y = (o - a for o, a in zip(raster.origin_m, self._about, strict=True))
        col = np.floor((self._cos * dx + self._sin * dy - shift_x) / step).astype(np.int32)
        row = np.floor((self._cos * dy - self._sin * dx - shift_y) / step).astype(np.int32)
        rows, cols = raster.occupied.shape
        inside = (row >= 0) & (row < rows) & (col >= 0) & (col < cols)
        return inside, row[inside], col[inside]
