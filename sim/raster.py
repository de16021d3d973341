"""Worlds as images: rasterise boxes, merge wall cells into few boxes, find room to stand."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from lemtomap.sim.errors import BadWorld
from lemtomap.sim.world import Box, Pose2, Raster

SPAWN_CLEARANCE_M = 0.45  # body radius 0.178 m and room to turn and look around


def merge_cells(occupied: NDArray[np.bool_]) -> list[tuple[int, int, int, int]]:
    """Cover occupied cells by few rectangles (row, col, rows, cols), longest run first come.

    Holds: the rectangles are disjoint and cover exactly the occupied cells.
    """
    left = occupied.copy()
    rectangles: list[tuple[int, int, int, int]] = []
    for row, col in np.argwhere(occupied):
        if not left[row, col]:
            continue
        cols = _run(np.asarray(left[row, col:]))
        rows = _run(np.asarray(left[row:, col]))
        if cols >= rows:
            rows = _run(np.asarray(left[row:, col : col + cols].all(axis=1)))
        else:
            cols = _run(np.asarray(left[row : row + rows, col:].all(axis=0)))
        left[row : row + rows, col : col + cols] = False
        rectangles.append((int(row), int(col), rows, cols))
    return rectangles


def _run(line: NDArray[np.bool_]) -> int:
    """Return how many leading cells are set."""
    gap = int(np.argmin(line))
    return len(line) if line[gap] else gap


def boxes_from_raster(raster: Raster, height_m: float) -> tuple[Box, ...]:
    """Extrude the occupied cells."""
    x0, y0 = raster.origin_m
    step = raster.resolution_m
    return tuple(
        Box(
            centre=(x0 + (col + cols / 2) * step, y0 + (row + rows / 2) * step, height_m / 2),
            half=(cols * step / 2, rows * step / 2, height_m / 2),
        )
        for row, col, rows, cols in merge_cells(raster.occupied)
    )


def rasterise(boxes: Iterable[Box], inside: tuple[float, float], resolution_m: float = 0.05) -> Raster:
    """Draw all boxes that a robot could meet between floor and 0.4 m.

    `inside` is a point of the building's free space: free is what connects to it, never through walls.
    """
    solid = [box for box in boxes if _meets_robot(box)]
    if not solid:
        raise BadWorld("world: no walls at all")
    corners = np.concatenate([_corners(box) for box in solid])
    low = np.floor(corners.min(axis=0) / resolution_m - 2) * resolution_m
    size = np.ceil((corners.max(axis=0) - low) / resolution_m).astype(int) + 2
    occupied = np.zeros((size[1], size[0]), dtype=np.bool_)
    for box in solid:
        _draw(occupied, box, (float(low[0]), float(low[1])), resolution_m)
    raster = Raster(occupied, ~occupied, resolution_m, (float(low[0]), float(low[1])))
    return Raster(occupied, connected(raster, inside), resolution_m, raster.origin_m)


def _meets_robot(box: Box) -> bool:
    bottom, top = box.centre[2] - box.half[2], box.centre[2] + box.half[2]
    return top > 0.02 and bottom < 0.4 and abs(box.pitch_rad) < 1e-6


def _corners(box: Box) -> NDArray[np.float64]:
    cos, sin = np.cos(box.yaw_rad), np.sin(box.yaw_rad)
    local = np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]]) * box.half[:2]
    return np.asarray(local @ np.array([[cos, sin], [-sin, cos]]) + box.centre[:2])


def _draw(occupied: NDArray[np.bool_], box: Box, origin: tuple[float, float], step: float) -> None:
    corners = _corners(box)
    rows, cols = occupied.shape
    col0, row0 = np.maximum(np.floor((corners.min(axis=0) - origin) / step).astype(int) - 1, 0)
    col1, row1 = np.minimum(np.ceil((corners.max(axis=0) - origin) / step).astype(int) + 1, [cols, rows])
    xs = origin[0] + (np.arange(col0, col1) + 0.5) * step - box.centre[0]
    ys = origin[1] + (np.arange(row0, row1) + 0.5) * step - box.centre[1]
    gx, gy = np.meshgrid(xs, ys)
    cos, sin = np.cos(box.yaw_rad), np.sin(box.yaw_rad)
    slack = step / 2 + 1e-6  # thin legs must not fall between cell centres
    along, across = np.abs(cos * gx + sin * gy), np.abs(-sin * gx + cos * gy)
    occupied[row0:row1, col0:col1] |= (along <= max(box.half[0], slack)) & (across <= max(box.half[1], slack))


def connected(raster: Raster, inside: tuple[float, float]) -> NDArray[np.bool_]:
    """Return the free cells that hang together with a point; all free cells when the point is in a wall."""
    labels, _ = ndimage.label(raster.free)
    row, col = raster.cell(*inside)
    rows, cols = raster.free.shape
    label = int(labels[row, col]) if 0 <= row < rows and 0 <= col < cols else 0
    return np.asarray(labels == label) if label else raster.free


def clearance_m(raster: Raster) -> NDArray[np.float64]:
    """Return float64 (rows, cols), metres from each free cell to the nearest cell that is not free."""
    padded = np.pad(raster.free, 1)
    distance = ndimage.distance_transform_edt(padded)
    return np.asarray(distance, dtype=np.float64)[1:-1, 1:-1] * raster.resolution_m


def find_spawn(raster: Raster, name: str) -> Pose2:
    """Choose a place to start: enough clearance, in the largest connected region, nearest to its middle.

    Raises BadWorld when there is nowhere to stand.
    """
    roomy = clearance_m(raster) >= SPAWN_CLEARANCE_M
    labels, count = ndimage.label(roomy)
    if not count:
        raise BadWorld(f"{name}: no free space with {SPAWN_CLEARANCE_M} m of clearance to start in")
    largest = int(np.argmax(np.bincount(labels.ravel())[1:])) + 1
    cells = np.argwhere(labels == largest)
    row, col = cells[np.argmin(((cells - cells.mean(axis=0)) ** 2).sum(axis=1))]
    return (*raster.point(int(row), int(col)), _widest_view(raster, int(row), int(col)))


def _widest_view(raster: Raster, row: int, col: int) -> float:
    """Return which of eight directions has the longest free line."""

    def free_cells(yaw: float) -> int:
        for step in range(1, 400):
            r, c = round(row + step * np.sin(yaw)), round(col + step * np.cos(yaw))
            if not (0 <= r < raster.free.shape[0] and 0 <= c < raster.free.shape[1]) or not raster.free[r, c]:
                return step
        return 400

    yaws = [k * np.pi / 4 for k in range(8)]
    yaw = max(yaws, key=free_cells)
    return float((yaw + np.pi) % (2 * np.pi) - np.pi)
