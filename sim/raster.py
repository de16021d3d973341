"""Worlds as images: rasterise boxes, merge wall cells into few boxes, find room to stand."""

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from lemtomap.sim.errors import BadWorld
from lemtomap.sim.shelter import ALL_ROUND, walls_around
from lemtomap.sim.world import Box, Pose2, Raster

SPAWN_CLEARANCE_M = 0.45  # body radius 0.178 m and room to turn and look around
MAX_CELLS = 16_000_000  # 200 m x 200 m at 0.05 m
MAX_BOXES = 60_000  # the physics has a body for each; a floor of 90 m mapped by robots has 24,000
FAR_M = 20_000.0  # the physics counts in single precision: 2 mm out there
STRIP_CELLS = 1 << 20
MAX_DRAWN_CELLS = 200_000_000  # all boxes' surroundings together: seconds


def merge_cells(occupied: NDArray[np.bool_]) -> list[tuple[int, int, int, int]]:
    """Cover occupied cells by few rectangles (row, col, rows, cols), longest run first come.

    Holds: the rectangles are disjoint and cover exactly the occupied cells. Raises BadWorld when more than
    MAX_BOXES are needed.
    """
    left = occupied.copy()
    rectangles: list[tuple[int, int, int, int]] = []
    for row in range(len(left)):
        col = 0
        while left[row, col:].any():
            col += int(np.argmax(left[row, col:]))
            cols = _run(np.asarray(left[row, col:]))
            rows = _run(np.asarray(left[row:, col]))
            if cols >= rows:
                rows = _run(np.asarray(left[row : row + rows, col : col + cols].all(axis=1)))
            else:
                cols = _run(np.asarray(left[row : row + rows, col : col + cols].all(axis=0)))
            left[row : row + rows, col : col + cols] = False
            rectangles.append((row, col, rows, cols))
            if len(rectangles) > MAX_BOXES:
                raise BadWorld(f"walls fall into more than {MAX_BOXES} pieces: noise, or not a floor plan")
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
    Raises BadWorld when there are no boxes, too many, or they reach too far.
    """
    solid = [box for box in boxes if _meets_robot(box)]
    if not solid:
        raise BadWorld("no walls at all")
    if len(solid) > MAX_BOXES:
        raise BadWorld(f"{len(solid)} walls and other things, at most {MAX_BOXES}")
    corners = np.concatenate([_corners(box) for box in solid])
    low = np.floor(corners.min(axis=0) / resolution_m - 2) * resolution_m
    size = np.ceil((corners.max(axis=0) - low) / resolution_m).astype(int) + 2
    require_cells(int(size[1]), int(size[0]), resolution_m)
    spans = np.ptp(corners.reshape(len(solid), -1, 2), axis=1) / resolution_m + 3
    if spans.prod(axis=1).sum() > MAX_DRAWN_CELLS:
        raise BadWorld("too many long walls askew")
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


def require_cells(rows: int, cols: int, resolution_m: float) -> None:
    """Raise BadWorld when a raster would have more than MAX_CELLS."""
    if rows * cols > MAX_CELLS:
        size = f"{cols * resolution_m:.0f} x {rows * resolution_m:.0f} m"
        most = f"at most {MAX_CELLS / 1e6:g} million cells"
        raise BadWorld(f"{size} at {resolution_m:g} m a cell is too large, {most}")


def _draw(occupied: NDArray[np.bool_], box: Box, origin: tuple[float, float], step: float) -> None:
    corners = _corners(box)
    rows, cols = occupied.shape
    col0, row0 = np.maximum(np.floor((corners.min(axis=0) - origin) / step).astype(int) - 1, 0)
    col1, row1 = np.minimum(np.ceil((corners.max(axis=0) - origin) / step).astype(int) + 1, [cols, rows])
    xs = origin[0] + (np.arange(col0, col1) + 0.5) * step - box.centre[0]
    ys = origin[1] + (np.arange(row0, row1) + 0.5) * step - box.centre[1]
    cos, sin = np.cos(box.yaw_rad), np.sin(box.yaw_rad)
    slack = step / 2 + 1e-6  # thin legs must not fall between cell centres
    strip = max(1, STRIP_CELLS // max(1, len(xs)))
    for first in range(0, len(ys), strip):
        gx, gy = np.meshgrid(xs, ys[first : first + strip])
        along, across = np.abs(cos * gx + sin * gy), np.abs(-sin * gx + cos * gy)
        inside = (along <= max(box.half[0], slack)) & (across <= max(box.half[1], slack))
        occupied[row0 + first : row0 + first + len(inside), col0:col1] |= inside


def connected(raster: Raster, inside: tuple[float, float]) -> NDArray[np.bool_]:
    """Return the free cells that hang together with a point; all free cells when the point is in a wall."""
    labels, _ = ndimage.label(raster.free)
    row, col = raster.cell(*inside)
    rows, cols = raster.free.shape
    label = int(labels[row, col]) if 0 <= row < rows and 0 <= col < cols else 0
    return np.asarray(labels == label) if label else raster.free


def clearance_m(raster: Raster) -> NDArray[np.float64]:
    """Return float64 (rows, cols), metres from each free cell to the nearest cell that is not free."""
    return _clearance_m(raster.free, raster.resolution_m)


def _clearance_m(free: NDArray[np.bool_], resolution_m: float) -> NDArray[np.float64]:
    distance = ndimage.distance_transform_edt(np.pad(free, 1))
    return np.asarray(distance, dtype=np.float64)[1:-1, 1:-1] * resolution_m


def fits(raster: Raster, x: float, y: float, needed_m: float) -> bool:
    """Return whether a point lies on the raster and has so much clearance."""
    row, col = raster.cell(x, y)
    rows, cols = raster.free.shape
    if not (0 <= row < rows and 0 <= col < cols):
        return False
    reach = math.ceil(needed_m / raster.resolution_m) + 1
    low_row, low_col = max(0, row - reach), max(0, col - reach)
    around = raster.free[low_row : row + reach + 1, low_col : col + reach + 1]
    return bool(_clearance_m(around, raster.resolution_m)[row - low_row, col - low_col] >= needed_m)


def roomy(raster: Raster, needed_m: float) -> NDArray[np.bool_]:
    """Return which cells have so much clearance, bool (rows, cols); in strips, as distances need memory."""
    rows, cols = raster.free.shape
    reach = math.ceil(needed_m / raster.resolution_m) + 1
    strip = max(reach, STRIP_CELLS // cols)
    result = np.zeros_like(raster.free)
    for row in range(0, rows, strip):
        low = max(0, row - reach)
        wide = _clearance_m(raster.free[low : row + strip + reach], raster.resolution_m) >= needed_m
        result[row : row + strip] = wide[row - low : row - low + strip]
    return result


def find_spawn(raster: Raster, name: str, wall: NDArray[np.bool_] | None = None) -> Pose2:
    """Choose a place to start: enough clearance, indoors, in the largest such region, nearest to its middle.

    `wall`, bool (rows, cols), are the cells that make a place indoors; by default all that is occupied. Where
    walls stand nowhere all round, the best there is counts. Raises BadWorld when there is nowhere to stand.
    """
    wide = roomy(raster, SPAWN_CLEARANCE_M)
    labels, count = ndimage.label(wide)
    if not count:
        raise BadWorld(f"{name}: no free space with {SPAWN_CLEARANCE_M} m of clearance to start in")
    around = np.where(wide, walls_around(raster.occupied if wall is None else wall, raster.free), 0)
    indoors = wide & (around >= min(ALL_ROUND, int(around.max())))
    largest = int(np.argmax(np.bincount(labels[indoors], minlength=count + 1)[1:])) + 1
    region = labels == largest
    rows, cols = np.arange(region.shape[0])[:, None], np.arange(region.shape[1])
    cells = np.count_nonzero(region)
    mid_row = float((region.sum(axis=1) * rows[:, 0]).sum() / cells)
    mid_col = float((region.sum(axis=0) * cols).sum() / cells)
    away = np.where(region & indoors, (rows - mid_row) ** 2 + (cols - mid_col) ** 2, np.inf)
    row, col = divmod(int(np.argmin(away)), len(cols))
    return (*raster.point(row, col), _widest_view(raster, row, col))


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
