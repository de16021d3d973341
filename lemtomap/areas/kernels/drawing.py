"""Drawing what a node remembers into a window: open floor as far as its boundary, then the boundary."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Cells = NDArray[np.int8]
FREE, WALL = 0, 100
RAYS = 720
SHORT = 2.0  # cells before the boundary at which the open floor ends


@njit(nogil=True, cache=True)
def draw_free(cells: Cells, x: float, y: float, points: NDArray[np.float64]) -> None:
    """Mark as free what lies between (x, y) and the boundary, float64 (N, 2); in cells from the corner."""
    rows, cols = cells.shape
    nearest = np.full(RAYS, -1.0)
    for k in range(len(points)):
        dx, dy = points[k, 0] - x, points[k, 1] - y
        away = math.hypot(dx, dy)
        if away < 1.0:
            continue
        middle = math.atan2(dy, dx) / (2.0 * math.pi) * RAYS
        wide = math.atan2(1.2, away) / (2.0 * math.pi) * RAYS  # a boundary point stands for two cells
        for beam in range(math.floor(middle - wide), math.ceil(middle + wide) + 1):
            if nearest[beam % RAYS] < 0.0 or away < nearest[beam % RAYS]:
                nearest[beam % RAYS] = away
    for beam in range(RAYS):
        if nearest[beam] < 0.0:
            continue
        sin, cos = math.sin(2.0 * math.pi * beam / RAYS), math.cos(2.0 * math.pi * beam / RAYS)
        t = 0.0
        while t < nearest[beam] - SHORT:
            row, col = math.floor(y + t * sin), math.floor(x + t * cos)
            if row < 0 or col < 0 or row >= rows or col >= cols:
                break
            cells[row, col] = FREE
            t += 0.5


@njit(nogil=True, cache=True)
def draw_way(cells: Cells, x0: float, y0: float, x1: float, y1: float, radius: float) -> None:
    """Mark as free what a body of a radius sweeps on the line from one place to another; in cells."""
    rows, cols = cells.shape
    reach = math.ceil(radius)
    steps = max(1, math.ceil(math.hypot(x1 - x0, y1 - y0)))
    for k in range(steps + 1):
        x, y = x0 + (x1 - x0) * k / steps, y0 + (y1 - y0) * k / steps
        for row in range(math.floor(y) - reach, math.floor(y) + reach + 1):
            for col in range(math.floor(x) - reach, math.floor(x) + reach + 1):
                inside = 0 <= row < rows and 0 <= col < cols
                if inside and math.hypot(row + 0.5 - y, col + 0.5 - x) <= radius:
                    cells[row, col] = FREE


@njit(nogil=True, cache=True)
def draw_walls(cells: Cells, points: NDArray[np.float64]) -> None:
    """Mark boundary points, float64 (N, 2), in cells from the corner; neighbours join into a wall."""
    rows, cols = cells.shape
    for k in range(len(points)):
        _mark(cells, points[k, 0], points[k, 1], rows, cols)
        for other in range(k):
            dx, dy = points[other, 0] - points[k, 0], points[other, 1] - points[k, 1]
            if abs(dx) < 3.2 and abs(dy) < 3.2:
                for part in range(1, 4):
                    _mark(cells, points[k, 0] + 0.25 * part * dx, points[k, 1] + 0.25 * part * dy, rows, cols)


@njit(nogil=True, cache=True)
def _mark(cells: Cells, x: float, y: float, rows: int, cols: int) -> None:
    row, col = math.floor(y), math.floor(x)
    if 0 <= row < rows and 0 <= col < cols:
        cells[row, col] = WALL
