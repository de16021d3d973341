"""Jitted gathering of laser hits and of the window's boundary cells."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Values = NDArray[np.float64]
Points = NDArray[np.floating]
Indices = NDArray[np.int32]
Cells = NDArray[np.int8]


@njit(nogil=True, cache=True)
def add_hits(
    points_base: Points,
    T_grid_base: Values,
    cell: float,
    owner: Indices,
    taken: Cells,
    sums: Values,
    now: float,
    recent: float,
) -> None:
    """Add points seen from a base at T_grid_base to a ring of cells: owner (S, S, 2) is whose cell it
    is, taken (S, S) 1 where it holds anything, sums (S, S, 6) x, y, n, when it was hit last in metres of way
    like `now`, and the unit vectors to where it was seen from.

    A cell that last belonged to another place of the building, or was hit too long ago, starts anew.
    """
    size = owner.shape[0]
    from_x, from_y = T_grid_base[0], T_grid_base[1]
    cos, sin = math.cos(T_grid_base[2]), math.sin(T_grid_base[2])
    for k in range(points_base.shape[0]):
        along, aside = float(points_base[k, 0]), float(points_base[k, 1])
        x = from_x + cos * along - sin * aside
        y = from_y + sin * along + cos * aside
        if not (math.isfinite(x) and math.isfinite(y)):
            continue
        col, row = math.floor(x / cell), math.floor(y / cell)
        r, c = row % size, col % size
        is_new = not taken[r, c] or owner[r, c, 0] != row or owner[r, c, 1] != col
        if is_new or now - sums[r, c, 3] > recent:
            owner[r, c, 0], owner[r, c, 1] = row, col
            taken[r, c] = 1
            sums[r, c, :] = 0.0
        if sums[r, c, 2] > 100.0:  # the mean goes on following a wall that moved
            sums[r, c, :3] *= 0.5
            sums[r, c, 4:] *= 0.5
        sums[r, c, 0] += x
        sums[r, c, 1] += y
        sums[r, c, 2] += 1.0
        sums[r, c, 3] = now
        distance = max(math.hypot(from_x - x, from_y - y), 1e-6)
        sums[r, c, 4] += (from_x - x) / distance
        sums[r, c, 5] += (from_y - y) / distance


@njit(nogil=True, cache=True)
def collect_hits(
    owner: Indices,
    taken: Cells,
    sums: Values,
    cell: float,
    centre_x: float,
    centre_y: float,
    radius: float,
    least: float,
    since: float,
    occupancy: Cells,
    resolution: float,
    origin_x: float,
    origin_y: float,
    occupied_from: int,
) -> Values:
    """Return the mean hits in a square, newer than `since`, that the window believes, float64 (N, 4): x, y
    and the mean unit vector to where it was seen from. The ring's side must be a multiple of 8.

    Cells hit before `since` are given back: nobody will ask for them again, and left taken they would slow
    down every later call, as in time most of the ring has been hit.
    """
    size = owner.shape[0]
    eights = taken.view(np.int64)
    rows, cols = occupancy.shape
    reach = min(math.ceil(radius / cell), size // 2 - 1)
    row0, col0 = math.floor(centre_y / cell), math.floor(centre_x / cell)
    low_row = max(row0 - reach, math.floor(origin_y / cell))  # what lies outside the window is not believed
    high_row = min(row0 + reach, math.ceil((origin_y + rows * resolution) / cell))
    low_col = max(col0 - reach, math.floor(origin_x / cell))
    high_col = min(col0 + reach, math.ceil((origin_x + cols * resolution) / cell))
    out = np.empty((max(0, high_row - low_row + 1) * max(0, high_col - low_col + 1), 4))
    count = 0
    for row in range(low_row, high_row + 1):
        r = row % size
        col, c = low_col - 1, low_col % size - 1
        while col < high_col:
            col, c = col + 1, c + 1
            if c == size:
                c = 0
            if c & 7 == 0 and eights[r, c >> 3] == 0:  # most of 160,000 cells hold nothing
                col, c = col + 7, c + 7
                continue
            if not taken[r, c]:
                continue
            if sums[r, c, 3] < since:
                taken[r, c] = 0
                continue
            if owner[r, c, 0] != row or owner[r, c, 1] != col or sums[r, c, 2] < least:
                continue
            x, y = sums[r, c, 0] / sums[r, c, 2], sums[r, c, 1] / sums[r, c, 2]
            i, j = math.floor((y - origin_y) / resolution), math.floor((x - origin_x) / resolution)
            believed = False
            for di in range(-1, 2):
                for dj in range(-1, 2):
                    if 0 <= i + di < rows and 0 <= j + dj < cols:
                        believed |= occupancy[i + di, j + dj] >= occupied_from
            if believed:
                out[count, 0], out[count, 1] = x, y
                out[count, 2] = sums[r, c, 4] / sums[r, c, 2]
                out[count, 3] = sums[r, c, 5] / sums[r, c, 2]
                count += 1
    return out[:count].copy()


@njit(nogil=True, cache=True)
def boundary_cells(
    occupancy: Cells,
    resolution: float,
    origin_x: float,
    origin_y: float,
    centre_x: float,
    centre_y: float,
    radius: float,
    occupied_from: int,
) -> Values:
    """Return the occupied cells beside a free one within a square, float64 (N, 4), grid frame: middle, and
    the direction of the free ones, from where such a cell was seen.
    """
    rows, cols = occupancy.shape
    row0 = max(1, math.floor((centre_y - radius - origin_y) / resolution))
    row1 = min(rows - 1, math.ceil((centre_y + radius - origin_y) / resolution))
    col0 = max(1, math.floor((centre_x - radius - origin_x) / resolution))
    col1 = min(cols - 1, math.ceil((centre_x + radius - origin_x) / resolution))
    out = np.empty((max(0, row1 - row0) * max(0, col1 - col0), 4))
    count = 0
    for r in range(row0, row1):
        for c in range(col0, col1):
            if occupancy[r, c] < occupied_from:
                continue
            free, to_x, to_y = False, 0.0, 0.0
            for dr, dc in ((-1, 0), (1, 0), (0, -1), (0, 1)):
                if 0 <= occupancy[r + dr, c + dc] < occupied_from // 2 + 1:
                    free = True
                    to_x, to_y = to_x + dc, to_y + dr
            if free:
                length = max(math.hypot(to_x, to_y), 1.0)
                out[count, 2], out[count, 3] = to_x / length, to_y / length
                out[count, 0] = origin_x + (c + 0.5) * resolution
                out[count, 1] = origin_y + (r + 0.5) * resolution
                count += 1
    return out[:count].copy()
