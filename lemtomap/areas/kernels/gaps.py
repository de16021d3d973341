"""Gaps between walls in a window: where the free floor is narrow, and opens on both sides."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Cells = NDArray[np.int8]
FREE_BELOW = 40  # occupancy, percent
FAN = 5  # rays to each side in which the other end of a gap is looked for ...
FAN_RAD = 0.1  # ... so far apart
RIDGE = 0.6
"""Clearance grows by less than this a cell, away from the nearest obstacle, where two are about as near."""
LATERAL = 0.3  # metres beside a gap's axis at which the floor behind it may open
END_REACH = 0.7  # metres round a gap's end within which its wall is followed
ISLAND_REACH = 2.0  # ... and within which it may turn out to be an island
WALL_MOST = 0.5  # metres: what is deeper, and stands free, is furniture or a column
FREE_SHARE = 0.8  # of the floor round an island; the rest is hidden, or another gap's wall
FIELDS = 9
"""Of a gap: row and column of both ends, width, opening before and behind it, wall at both ends; in cells."""


@njit(nogil=True, cache=True)
def find_gaps(
    occupancy: Cells,
    step_row: NDArray[np.int16],
    step_col: NDArray[np.int16],
    clearance: NDArray[np.float32],
    resolution: float,
    occupied_from: int,
    least_m: float,
    most_m: float,
    depth_m: float,
    opens: float,
    out: NDArray[np.float64],
) -> int:
    """Write the gaps into float64 (N, FIELDS), narrowest first among neighbours; returns how many.

    A gap has two obstacle cells as ends, known free floor between them, and floor on both sides where the
    clearance rises, within `depth_m` (or its own width) along its axis, to `opens` times that in its middle.
    """
    rows, cols = occupancy.shape
    count = 0
    low, high = 0.5 * least_m / resolution, 0.5 * most_m / resolution + 1.0
    for r in range(1, rows - 1):
        for c in range(1, cols - 1):
            d = clearance[r, c]
            if d < low or d > high or occupancy[r, c] < 0 or occupancy[r, c] >= FREE_BELOW:
                continue
            away_row, away_col = round(-step_row[r, c] / d), round(-step_col[r, c] / d)
            if clearance[r + away_row, c + away_col] - d > RIDGE * math.hypot(away_row, away_col):
                continue  # nearer to one wall than to the other
            found = _opposite(occupancy, r, c, step_row[r, c], step_col[r, c], d, occupied_from)
            if found[0] < 0:
                continue
            p_row, p_col = r + int(step_row[r, c]), c + int(step_col[r, c])
            q_row, q_col = found
            wide = math.hypot(q_row - p_row, q_col - p_col) - 1.0  # from face to face
            if wide * resolution < least_m or wide * resolution > most_m:
                continue
            along_row, along_col = (q_row - p_row) / (wide + 1.0), (q_col - p_col) / (wide + 1.0)
            mid_row, mid_col = 0.5 * (p_row + q_row), 0.5 * (p_col + q_col)
            if not _is_free(occupancy, p_row, p_col, q_row, q_col):
                continue
            half = 0.5 * wide + 0.5
            deep = max(depth_m, wide * resolution)
            before = _opening(occupancy, clearance, mid_row, mid_col, -along_col, along_row, resolution, deep)
            behind = _opening(occupancy, clearance, mid_row, mid_col, along_col, -along_row, resolution, deep)
            if before < opens * half or behind < opens * half:
                continue
            count = _keep(
                out, count, p_row, p_col, q_row, q_col, wide, before / half, behind / half, resolution
            )
    for k in range(count):
        out[k, 7] = _wall(occupancy, out[k, 0], out[k, 1], resolution, occupied_from)
        out[k, 8] = _wall(occupancy, out[k, 2], out[k, 3], resolution, occupied_from)
    return count


@njit(nogil=True, cache=True)
def _opposite(
    occupancy: Cells, r: int, c: int, dr: int, dc: int, d: float, occupied_from: int
) -> tuple[int, int]:
    """Return the obstacle cell opposite the nearest one, about as far; (-1, -1) when there is none."""
    rows, cols = occupancy.shape
    back = math.atan2(-dr, -dc)
    best = d + 1.6
    found = (-1, -1)
    for k in range(-FAN, FAN + 1):
        sin, cos = math.sin(back + k * FAN_RAD), math.cos(back + k * FAN_RAD)
        t = 1.0
        while t <= best:
            row, col = round(r + t * sin), round(c + t * cos)
            if row < 0 or col < 0 or row >= rows or col >= cols:
                break
            if occupancy[row, col] >= occupied_from:
                length = math.hypot(row - r, col - c)
                if length < best:
                    best = length
                    found = (row, col)
                break
            t += 0.5
    return found


@njit(nogil=True, cache=True)
def _is_free(occupancy: Cells, p_row: int, p_col: int, q_row: int, q_col: int) -> bool:
    """Return True if all between two cells, but for a cell beside each, is known free floor."""
    steps = 2 * int(math.hypot(q_row - p_row, q_col - p_col)) + 1
    for k in range(3, steps - 2):
        row = round(p_row + (q_row - p_row) * k / steps)
        col = round(p_col + (q_col - p_col) * k / steps)
        if occupancy[row, col] < 0 or occupancy[row, col] >= FREE_BELOW:
            return False
    return True


@njit(nogil=True, cache=True)
def _opening(
    occupancy: Cells,
    clearance: NDArray[np.float32],
    row: float,
    col: float,
    n_row: float,
    n_col: float,
    resolution: float,
    depth_m: float,
) -> float:
    """Return the largest clearance of the free floor straight on, cells; 0 when it ends within 0.4 m."""
    rows, cols = occupancy.shape
    largest = 0.0
    reached = 0.0
    t = 0.0
    while t * resolution <= depth_m:
        r, c = round(row + t * n_row), round(col + t * n_col)
        if r < 0 or c < 0 or r >= rows or c >= cols:
            break
        if occupancy[r, c] < 0 or occupancy[r, c] >= FREE_BELOW:
            break
        reached = t * resolution
        for side in range(-1, 2):
            a = round(row + t * n_row + side * LATERAL / resolution * n_col)
            b = round(col + t * n_col - side * LATERAL / resolution * n_row)
            if a < 0 or b < 0 or a >= rows or b >= cols or t * resolution < 0.15:
                continue
            if 0 <= occupancy[a, b] < FREE_BELOW and clearance[a, b] > largest:
                largest = clearance[a, b]
        t += 1.0
    return largest if reached >= 0.4 else 0.0


@njit(nogil=True, cache=True)
def _keep(
    out: NDArray[np.float64],
    count: int,
    p_row: int,
    p_col: int,
    q_row: int,
    q_col: int,
    wide: float,
    before: float,
    behind: float,
    resolution: float,
) -> int:
    """Keep a gap unless a narrower one lies at the same place; returns how many there are now."""
    row, col = 0.5 * (p_row + q_row), 0.5 * (p_col + q_col)
    apart = 0.6 / resolution
    same = -1
    for k in range(count):
        a, b = 0.5 * (out[k, 0] + out[k, 2]), 0.5 * (out[k, 1] + out[k, 3])
        if math.hypot(a - row, b - col) < apart:
            same = k
            if out[k, 4] < wide - 1e-9:
                return count
            break
    if same < 0:
        if count == len(out):
            return count
        same = count
        count += 1
    out[same, 0], out[same, 1], out[same, 2], out[same, 3] = p_row, p_col, q_row, q_col
    out[same, 4], out[same, 5], out[same, 6] = wide, before, behind
    return count


@njit(nogil=True, cache=True)
def _wall(occupancy: Cells, row: float, col: float, resolution: float, occupied_from: int) -> float:
    """Return how far, in cells, the obstacle at a gap's end goes on, over holes of a cell, within a reach.

    0 for furniture: what stands free on the floor all round, and is deeper than a wall.
    """
    rows, cols = occupancy.shape
    span = int(ISLAND_REACH / resolution)
    side = 2 * span + 1
    seen = np.zeros((side, side), dtype=np.bool_)
    stack = np.zeros((side * side, 2), dtype=np.int64)
    r0, c0 = int(row), int(col)
    top, count = 1, 0
    stack[0, 0], stack[0, 1] = r0, c0
    seen[span, span] = True
    far, ends = 0.0, False
    low_r, high_r, low_c, high_c = r0, r0, c0, c0
    sums = np.zeros(5)
    while top > 0:
        top -= 1
        r, c = stack[top, 0], stack[top, 1]
        far = max(far, math.hypot(r - r0, c - c0))
        low_r, high_r, low_c, high_c = min(low_r, r), max(high_r, r), min(low_c, c), max(high_c, c)
        x, y = float(c - c0), float(r - r0)
        sums += np.array([x, y, x * x, y * y, x * y])
        count += 1
        for dr in range(-2, 3):
            for dc in range(-2, 3):
                a, b = r + dr, c + dc
                if a < 0 or b < 0 or a >= rows or b >= cols or occupancy[a, b] < occupied_from:
                    continue
                if abs(a - r0) > span or abs(b - c0) > span:
                    ends = True  # it goes on beyond the reach
                elif not seen[a - r0 + span, b - c0 + span]:
                    seen[a - r0 + span, b - c0 + span] = True
                    stack[top, 0], stack[top, 1] = a, b
                    top += 1
    far = min(far, END_REACH / resolution)
    if ends:
        return far
    mean_x, mean_y = sums[0] / count, sums[1] / count
    xx, yy, xy = sums[2] / count - mean_x**2, sums[3] / count - mean_y**2, sums[4] / count - mean_x * mean_y
    across = 0.5 * (xx + yy) - math.sqrt(0.25 * (xx - yy) ** 2 + xy * xy)
    is_deep = 4.0 * math.sqrt(max(0.0, across)) * resolution > WALL_MOST
    if is_deep and _stands_free(occupancy, low_r - 3, high_r + 3, low_c - 3, high_c + 3):
        return 0.0
    return far


@njit(nogil=True, cache=True)
def _stands_free(occupancy: Cells, low_r: int, high_r: int, low_c: int, high_c: int) -> bool:
    """Return True if nearly all of the floor on the border of a box is known and free."""
    rows, cols = occupancy.shape
    if low_r < 0 or low_c < 0 or high_r >= rows or high_c >= cols:
        return False
    free, all_round = 0, 0
    for r in range(low_r, high_r + 1):
        for c in range(low_c, high_c + 1):
            if r in (low_r, high_r) or c in (low_c, high_c):
                all_round += 1
                free += 0 <= occupancy[r, c] < FREE_BELOW
    return free >= FREE_SHARE * all_round
