"""Kernels of the map: ring-buffer windows in, ring-buffer windows out. Plain arrays, no classes.

A window is n x n cells. Cell (gx, gy) of the endless grid lies at row gy mod n, column gx mod n, so that a
shift moves nothing. `origin` holds (gx, gy) of the window's least corner. A `window` is the tuple of its
arrays.

evidence  int8 (n, n)        0 never seen, negative free, positive occupied; bounded on both sides
averaged  uint8 (n, n)       hits in the mean, saturates
mean      uint16 (n, n, 2)   averaged hit point from the cell's corner, 65535 to the far corner
whence    int8 (n, n, 2)     from an occupied cell to the laser that hit it last, 127 long
nearest   uint8 (n, n)       index into `offsets` (sorted by distance) of the nearest occupied cell; 255 none
lift      int8 (n, n)        from the averaged hit to the plane along its normal, 254 to a cell's side
normal    uint8 (n, n)       surface normal of an occupied cell, 180 / 255 degrees a step; 255 no plane
"""

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lemtomap.grid.kernels.planes import FAR, renew_normal

Array = NDArray[Any]

NONE = 255
WHOLE = 65535.0


@njit(nogil=True, cache=True)
def _reaches_out(offsets: Array, n: int, origin: Array, gx: int, gy: int) -> bool:
    """Return True if the cells around one may lie outside the window, or across the ring's seam in memory."""
    last = offsets.shape[0] - 1  # the furthest: no coordinate of any is larger than both of its together
    reach = abs(offsets[last, 0]) + abs(offsets[last, 1])
    x, y, col, row = gx - origin[0], gy - origin[1], gx % n, gy % n
    return bool(min(x, y, col, row) < reach or max(x, y, col, row) >= n - reach)


@njit(nogil=True, cache=True)
def _renew_nearest(
    evidence: Array, nearest: Array, offsets: Array, n: int, origin: Array, gx: int, gy: int
) -> None:
    """Search the nearest occupied cell anew, beyond the one that was nearest and is no longer occupied."""
    found = NONE
    edge = _reaches_out(offsets, n, origin, gx, gy)
    row, col = gy % n, gx % n
    for o in range(nearest[row, col] + 1, offsets.shape[0]):
        if edge:
            cx, cy = gx + offsets[o, 0], gy + offsets[o, 1]
            if cx < origin[0] or cy < origin[1] or cx >= origin[0] + n or cy >= origin[1] + n:
                continue
            if evidence[cy % n, cx % n] > 0:
                found = o
                break
        elif evidence[row + offsets[o, 1], col + offsets[o, 0]] > 0:
            found = o
            break
    nearest[row, col] = found


@njit(nogil=True, cache=True)
def _spread_new(nearest: Array, offsets: Array, n: int, origin: Array, gx: int, gy: int) -> None:
    """A cell became occupied: it may be the nearest of the cells around it."""
    edge = _reaches_out(offsets, n, origin, gx, gy)
    row0, col0 = gy % n, gx % n
    for o in range(offsets.shape[0]):
        row, col = row0 - offsets[o, 1], col0 - offsets[o, 0]
        if edge:
            cx, cy = gx - offsets[o, 0], gy - offsets[o, 1]
            if cx < origin[0] or cy < origin[1] or cx >= origin[0] + n or cy >= origin[1] + n:
                continue
            row, col = cy % n, cx % n
        nearest[row, col] = min(nearest[row, col], o)


@njit(nogil=True, cache=True)
def _orphan(
    nearest: Array, offsets: Array, n: int, origin: Array, gx: int, gy: int, orphans: Array, count: int
) -> int:
    """A cell is no longer occupied: list the cells whose nearest it was."""
    edge = _reaches_out(offsets, n, origin, gx, gy)
    row0, col0 = gy % n, gx % n
    for o in range(offsets.shape[0]):
        cx, cy = gx - offsets[o, 0], gy - offsets[o, 1]
        row, col = row0 - offsets[o, 1], col0 - offsets[o, 0]
        if edge:
            if cx < origin[0] or cy < origin[1] or cx >= origin[0] + n or cy >= origin[1] + n:
                continue
            row, col = cy % n, cx % n
        if nearest[row, col] == o and count < orphans.shape[0]:
            orphans[count, 0], orphans[count, 1] = cx, cy
            count += 1
    return count


@njit(nogil=True, cache=True)
def _average_hit(averaged: Array, mean: Array, row: int, col: int, x: float, y: float, bound: int) -> None:
    k = averaged[row, col]
    if k < bound:
        k += 1
        averaged[row, col] = k
    before_x, before_y = float(mean[row, col, 0]), float(mean[row, col, 1])
    mean[row, col, 0] = round(before_x + (x * WHOLE - before_x) / k)
    mean[row, col, 1] = round(before_y + (y * WHOLE - before_y) / k)


@njit(nogil=True, cache=True)
def _clear_ray(
    evidence: Array,
    averaged: Array,
    mark: Array,
    tag: int,
    n: int,
    origin: Array,
    ray: Array,
    miss: int,
    floor: int,
    resolution: float,
    lost: Array,
    lost_count: int,
) -> int:
    """Lower every cell between laser and end point that this scan has not touched yet."""
    x0, y0 = ray[0] / resolution - origin[0], ray[1] / resolution - origin[1]
    x1, y1 = ray[2] / resolution - origin[0], ray[3] / resolution - origin[1]
    x, y = math.floor(x0), math.floor(y0)
    dx, dy = x1 - x0, y1 - y0
    step_x, step_y = (1 if dx > 0 else -1), (1 if dy > 0 else -1)
    per_x = abs(1.0 / dx) if dx != 0.0 else 1e30
    per_y = abs(1.0 / dy) if dy != 0.0 else 1e30
    next_x = ((x + 1 - x0) if dx > 0 else (x0 - x)) * per_x
    next_y = ((y + 1 - y0) if dy > 0 else (y0 - y)) * per_y
    ring_x, ring_y = origin[0] % n, origin[1] % n
    for _ in range(abs(math.floor(x1) - x) + abs(math.floor(y1) - y)):
        if x < 0 or y < 0 or x >= n or y >= n:
            return lost_count
        col, row = x + ring_x, y + ring_y
        if col >= n:
            col -= n
        if row >= n:
            row -= n
        before = evidence[row, col]
        if before > floor and mark[row, col] != tag:  # most are at the floor already
            mark[row, col] = tag
            after = before - miss
            if after == 0:
                after = -1
            evidence[row, col] = max(after, floor)
            if before > 0 and after <= 0:
                averaged[row, col] = 0
                lost[lost_count, 0], lost[lost_count, 1] = x + origin[0], y + origin[1]
                lost_count += 1
        along_x = next_x < next_y  # by selection: which way a ray goes next no branch predictor guesses
        x += step_x if along_x else 0
        y += 0 if along_x else step_y
        next_x += per_x if along_x else 0.0
        next_y += 0.0 if along_x else per_y
    return lost_count


@njit(nogil=True, cache=True)
def integrate(
    window: Any,
    offsets: Array,
    mark: Array,
    tag: int,
    hits: Array,
    normals_rad: Array,
    cuts: Array,
    T_grid_base: Array,
    laser: Array,
    rules: Array,
    resolution: float,
    scratch: Array,
) -> None:
    """Put a scan into one window: hits first, then the free space before them; a cell moves at most once.

    rules int64: hit, miss, floor, ceiling, bound of the mean. laser (2,) in base, metres. scratch int64
    (3, many, 2).
    """
    evidence, averaged, mean, whence = window.evidence, window.averaged, window.mean, window.whence
    nearest, origin = window.nearest, window.origin
    n = evidence.shape[0]
    hit, miss, floor, ceiling, bound = rules[0], rules[1], rules[2], rules[3], rules[4]
    c, s = math.cos(T_grid_base[2]), math.sin(T_grid_base[2])
    touched, lost, orphans = np.empty(hits.shape[0], dtype=np.int64), scratch[0], scratch[1]
    touched_count = lost_count = orphan_count = 0
    ray = np.empty(4)
    ray[0] = T_grid_base[0] + c * laser[0] - s * laser[1]
    ray[1] = T_grid_base[1] + s * laser[0] + c * laser[1]
    for i in range(hits.shape[0]):
        x = T_grid_base[0] + c * hits[i, 0] - s * hits[i, 1]
        y = T_grid_base[1] + s * hits[i, 0] + c * hits[i, 1]
        gx, gy = math.floor(x / resolution), math.floor(y / resolution)
        if gx < origin[0] or gy < origin[1] or gx >= origin[0] + n or gy >= origin[1] + n:
            continue
        row, col = gy % n, gx % n
        if mark[row, col] != tag:
            mark[row, col] = tag
            before = evidence[row, col]
            after = min(before + hit, ceiling)
            if after == 0:
                after = 1
            evidence[row, col] = after
            touched[touched_count] = i
            touched_count += 1
            if before <= 0:
                averaged[row, col] = 0
                if after > 0:
                    _spread_new(nearest, offsets, n, origin, gx, gy)
            per_m = FAR / max(math.hypot(ray[0] - x, ray[1] - y), resolution)
            whence[row, col, 0], whence[row, col, 1] = per_m * (ray[0] - x), per_m * (ray[1] - y)
        _average_hit(averaged, mean, row, col, x / resolution - gx, y / resolution - gy, bound)
    for i in range(hits.shape[0] + cuts.shape[0]):
        if i < hits.shape[0]:
            px, py = hits[i, 0], hits[i, 1]
        else:
            px, py = cuts[i - hits.shape[0], 0], cuts[i - hits.shape[0], 1]
        ray[2] = T_grid_base[0] + c * px - s * py
        ray[3] = T_grid_base[1] + s * px + c * py
        lost_count = _clear_ray(
            evidence, averaged, mark, tag, n, origin, ray, miss, floor, resolution, lost, lost_count
        )
    for i in range(lost_count):
        orphan_count = _orphan(nearest, offsets, n, origin, lost[i, 0], lost[i, 1], orphans, orphan_count)
    for i in range(orphan_count):
        _renew_nearest(evidence, nearest, offsets, n, origin, orphans[i, 0], orphans[i, 1])
    for i in range(touched_count):
        k = touched[i]
        gx = math.floor((T_grid_base[0] + c * hits[k, 0] - s * hits[k, 1]) / resolution)
        gy = math.floor((T_grid_base[1] + s * hits[k, 0] + c * hits[k, 1]) / resolution)
        if evidence[gy % n, gx % n] > 0:
            renew_normal(window, gx, gy, normals_rad[k] + T_grid_base[2])


@njit(nogil=True, cache=True)
def _clear_cells(window: Any, x0: int, y0: int, x1: int, y1: int) -> None:
    """Forget the cells of a rectangle."""
    n = window.evidence.shape[0]
    for gy in range(y0, y1):
        row = gy % n
        for gx in range(x0, x1):
            col = gx % n
            window.evidence[row, col] = 0
            window.averaged[row, col] = 0
            window.nearest[row, col] = NONE
            window.normal[row, col] = NONE


@njit(nogil=True, cache=True)
def _spread_cells(window: Any, offsets: Array, x0: int, y0: int, x1: int, y1: int) -> None:
    """Tell the cells around a rectangle of its occupied cells."""
    n = window.evidence.shape[0]
    for gy in range(y0, y1):
        for gx in range(x0, x1):
            if window.evidence[gy % n, gx % n] > 0:
                _spread_new(window.nearest, offsets, n, window.origin, gx, gy)


@njit(nogil=True, cache=True)
def _forget_outside(window: Any, offsets: Array, x0: int, y0: int, x1: int, y1: int) -> None:
    """Search anew for the cells of a rectangle whose nearest occupied cell has left the window."""
    n, origin = window.evidence.shape[0], window.origin
    for gy in range(y0, y1):
        for gx in range(x0, x1):
            o = window.nearest[gy % n, gx % n]
            if o == NONE:
                continue
            cx, cy = gx + offsets[o, 0], gy + offsets[o, 1]
            if cx < origin[0] or cy < origin[1] or cx >= origin[0] + n or cy >= origin[1] + n:
                _renew_nearest(window.evidence, window.nearest, offsets, n, origin, gx, gy)


@njit(nogil=True, cache=True)
def shift(window: Any, offsets: Array, new_x: int, new_y: int) -> None:
    """Move the window: clear what enters, repair the look-up along the edges, touch nothing else."""
    n, origin = window.evidence.shape[0], window.origin
    old_x, old_y = origin[0], origin[1]
    origin[0], origin[1] = new_x, new_y
    x0, x1 = max(old_x, new_x), min(old_x, new_x) + n
    y0, y1 = max(old_y, new_y), min(old_y, new_y) + n
    if x0 >= x1 or y0 >= y1:
        _clear_cells(window, new_x, new_y, new_x + n, new_y + n)
        return
    _clear_cells(window, new_x, new_y, new_x + n, y0)
    _clear_cells(window, new_x, y1, new_x + n, new_y + n)
    _clear_cells(window, new_x, y0, x0, y1)
    _clear_cells(window, x1, y0, new_x + n, y1)
    reach = 0
    for o in range(offsets.shape[0]):
        reach = max(reach, offsets[o, 0])
    left, right = (x0, min(x0 + reach, x1)), (max(x1 - reach, x0), x1)
    low, high = (y0, min(y0 + reach, y1)), (max(y1 - reach, y0), y1)
    if new_x > old_x:
        _forget_outside(window, offsets, left[0], y0, left[1], y1)
        _spread_cells(window, offsets, right[0], y0, right[1], y1)
    elif new_x < old_x:
        _forget_outside(window, offsets, right[0], y0, right[1], y1)
        _spread_cells(window, offsets, left[0], y0, left[1], y1)
    if new_y > old_y:
        _forget_outside(window, offsets, x0, low[0], x1, low[1])
        _spread_cells(window, offsets, x0, high[0], x1, high[1])
    elif new_y < old_y:
        _forget_outside(window, offsets, x0, high[0], x1, high[1])
        _spread_cells(window, offsets, x0, low[0], x1, low[1])


@njit(nogil=True, cache=True)
def occupancy(evidence: Array, table: Array, out: Array) -> None:
    """Write each cell as -1 unknown, 0..100 occupied, where evidence has it; table: int8 (256,) by evidence +
    128.

    Most cells are like the ones beside them, so eight in a row that equal the last eight are not looked up.
    """
    cells, shown = evidence.reshape(-1), out.reshape(-1)
    whole = cells.shape[0] // 8 * 8
    eights, shown_eights = cells[:whole].view(np.int64), shown[:whole].view(np.int64)
    for k in range(eights.shape[0]):
        if k > 0 and eights[k] == eights[k - 1]:
            shown_eights[k] = shown_eights[k - 1]
            continue
        for i in range(8 * k, 8 * k + 8):
            shown[i] = table[cells[i] + 128]
    for i in range(whole, cells.shape[0]):
        shown[i] = table[cells[i] + 128]


@njit(nogil=True, cache=True)
def occupied_points(evidence: Array, mean: Array, origin: Array, resolution: float, out: Array) -> int:
    """Write the averaged hit point of each occupied cell, grid frame, metres; return how many."""
    n = evidence.shape[0]
    k = 0
    for gy in range(origin[1], origin[1] + n):
        row = gy % n
        for gx in range(origin[0], origin[0] + n):
            col = gx % n
            if evidence[row, col] > 0 and k < out.shape[0]:
                out[k, 0] = (gx + mean[row, col, 0] / WHOLE) * resolution
                out[k, 1] = (gy + mean[row, col, 1] / WHOLE) * resolution
                k += 1
    return k


@njit(nogil=True, cache=True)
def paste(
    window: Any,
    offsets: Array,
    gx: int,
    gy: int,
    evidence: Array,
    averaged: Array,
    mean: Array,
    whence: Array,
    lift: Array,
    normal: Array,
) -> None:
    """Put a remembered square of cells, least corner at (gx, gy), into unknown cells; the look-up learns
    of it.
    """
    n = window.evidence.shape[0]
    for dy in range(evidence.shape[0]):
        row = (gy + dy) % n
        for dx in range(evidence.shape[1]):
            col = (gx + dx) % n
            window.evidence[row, col] = evidence[dy, dx]
            window.averaged[row, col] = averaged[dy, dx]
            window.mean[row, col, 0] = mean[dy, dx, 0]
            window.mean[row, col, 1] = mean[dy, dx, 1]
            window.whence[row, col, 0] = whence[dy, dx, 0]
            window.whence[row, col, 1] = whence[dy, dx, 1]
            window.lift[row, col] = lift[dy, dx]
            window.normal[row, col] = normal[dy, dx]
            if evidence[dy, dx] > 0:
                _spread_new(window.nearest, offsets, n, window.origin, gx + dx, gy + dy)
