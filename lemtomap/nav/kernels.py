"""Jitted functions of navigation on plain arrays: costmap layers and fields over the window.

Arrays are indexed [row, col]; row grows with y, col with x; cell centres lie at (index + 0.5) * resolution.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[Any]
F4 = NDArray[np.float32]
F8 = NDArray[np.float64]
I1 = NDArray[np.int8]
I4 = NDArray[np.int32]
I8 = NDArray[np.int64]
U1 = NDArray[np.uint8]

FREE, UNKNOWN, LETHAL = 0, 1, 2


@njit(nogil=True, cache=True)
def shift_cells(layer: Array, rows: int, cols: int, fill: float) -> Array:
    """Move a layer's content by whole cells: new[r, c] = old[r + rows, c + cols]; what enters is fill."""
    height, width = layer.shape
    out = np.full_like(layer, fill)
    for r in range(max(0, -rows), min(height, height - rows)):
        for c in range(max(0, -cols), min(width, width - cols)):
            out[r, c] = layer[r + rows, c + cols]
    return out


@njit(nogil=True, cache=True)
def clear_rays(
    last_hit_s: F8, hits: U1, row0: float, col0: float, ends_row: F8, ends_col: F8, cut: float
) -> None:
    """Forget live obstacles along rays from (row0, col0), stopping `cut` cells before each end."""
    height, width = last_hit_s.shape
    for i in range(ends_row.size):
        dr, dc = ends_row[i] - row0, ends_col[i] - col0
        length = np.sqrt(dr * dr + dc * dc)
        steps = int(np.floor(length - cut))
        if steps <= 0:
            continue
        for k in range(steps + 1):
            r = int(np.floor(row0 + dr * k / length))
            c = int(np.floor(col0 + dc * k / length))
            if r < 0 or c < 0 or r >= height or c >= width:
                break
            hits[r, c] = 0
            last_hit_s[r, c] = -np.inf


@njit(nogil=True, cache=True)
def clear_cells(last_hit_s: F8, hits: U1, rows: F8, cols: F8) -> None:
    """Forget live obstacles in the cells of these points."""
    height, width = last_hit_s.shape
    for i in range(rows.size):
        r, c = int(np.floor(rows[i])), int(np.floor(cols[i]))
        if r >= 0 and c >= 0 and r < height and c < width:
            hits[r, c] = 0
            last_hit_s[r, c] = -np.inf


@njit(nogil=True, cache=True)
def mark_hits(last_hit_s: F8, hits: U1, rows: F8, cols: F8, now_s: float) -> None:
    """Count one hit per cell and scan."""
    height, width = last_hit_s.shape
    for i in range(rows.size):
        r, c = int(np.floor(rows[i])), int(np.floor(cols[i]))
        if r < 0 or c < 0 or r >= height or c >= width or last_hit_s[r, c] == now_s:
            continue
        last_hit_s[r, c] = now_s
        if hits[r, c] < 100:
            hits[r, c] += 1


@njit(nogil=True, cache=True)
def stamp_disc(state: U1, row: float, col: float, radius: float, value: int) -> None:
    """Set the cells whose centres lie within radius (cells) of (row, col)."""
    height, width = state.shape
    for r in range(max(0, int(row - radius) - 1), min(height, int(row + radius) + 2)):
        for c in range(max(0, int(col - radius) - 1), min(width, int(col + radius) + 2)):
            dr, dc = r + 0.5 - row, c + 0.5 - col
            if dr * dr + dc * dc <= radius * radius:
                state[r, c] = value


@njit(nogil=True, cache=True)
def classify(occupancy: I1, occupied_percent: int, state: U1) -> None:
    """Write FREE, UNKNOWN or LETHAL for each cell of an occupancy window (-1 unknown, 0..100)."""
    height, width = occupancy.shape
    for r in range(height):
        for c in range(width):
            o = occupancy[r, c]
            if o < 0:
                state[r, c] = UNKNOWN
            elif o >= occupied_percent:
                state[r, c] = LETHAL
            else:
                state[r, c] = FREE


@njit(nogil=True, cache=True)
def add_live(state: U1, last_hit_s: F8, hits: U1, now_s: float, decay_s: float, live_hits: int) -> None:
    """Mark live obstacles that are fresh and seen often enough; forget those that are stale."""
    height, width = state.shape
    for r in range(height):
        for c in range(width):
            if hits[r, c] == 0:
                continue
            if now_s - last_hit_s[r, c] > decay_s:
                hits[r, c] = 0
                last_hit_s[r, c] = -np.inf
            elif hits[r, c] >= live_hits:
                state[r, c] = LETHAL


@njit(nogil=True, cache=True)
def clearance_transform(state: U1, reach: float) -> F4:
    """Return float32 distance in cells from each cell centre to the nearest LETHAL centre, capped at reach.

    Two passes of lower envelopes of parabolas (Felzenszwalb and Huttenlocher, 2012), rows first.
    """
    height, width = state.shape
    cap2 = reach * reach
    in_row = np.empty((height, width), dtype=np.float32)
    for r in range(height):
        d = reach
        for c in range(width):
            d = 0.0 if state[r, c] == LETHAL else min(d + 1.0, reach)
            in_row[r, c] = d
        d = reach
        for c in range(width - 1, -1, -1):
            d = 0.0 if state[r, c] == LETHAL else min(d + 1.0, reach)
            in_row[r, c] = min(in_row[r, c], d)
    out = np.empty((height, width), dtype=np.float32)
    apex = np.empty(height, dtype=np.int64)
    start = np.empty(height + 1, dtype=np.float64)
    value = np.empty(height, dtype=np.float64)
    for c in range(width):
        k = -1
        for r in range(height):
            f = in_row[r, c]
            if f >= reach:
                continue
            f = f * f
            s = -1e18
            while k >= 0:
                q = apex[k]
                s = (f + r * r - value[k] - q * q) / (2.0 * (r - q))
                if s > start[k]:
                    break
                k -= 1
                s = -1e18
            k += 1
            apex[k] = r
            value[k] = f
            start[k] = s
        last = k
        if last < 0:
            for r in range(height):
                out[r, c] = reach
            continue
        k = 0
        for r in range(height):
            while k < last and start[k + 1] < r:
                k += 1
            d2 = (r - apex[k]) * (r - apex[k]) + value[k]
            out[r, c] = np.sqrt(d2) if d2 < cap2 else reach
    return out


@njit(nogil=True, cache=True)
def traversal_cost(
    state: U1, clearance: F4, body: float, near_cost: float, falloff: float, unknown_factor: float
) -> F4:
    """Return float32 cost per cell of way: inf where the body (radius in cells) does not fit."""
    height, width = state.shape
    cost = np.empty((height, width), dtype=np.float32)
    for r in range(height):
        for c in range(width):
            d = clearance[r, c]
            if d < body:
                cost[r, c] = np.inf
                continue
            x = (d - body) / falloff
            value = 1.0 + (near_cost * np.exp(-x) if x < 6.0 else 0.0)
            cost[r, c] = value * unknown_factor if state[r, c] == UNKNOWN else value
    return cost


@njit(nogil=True, cache=True)
def open_start(cost: F4, clearance: F4, row: float, col: float, radius: float, price: float) -> None:
    """Let the search leave a place where the body overlaps the margin: cells near it, but no obstacle."""
    height, width = cost.shape
    for r in range(max(0, int(row - radius)), min(height, int(row + radius) + 2)):
        for c in range(max(0, int(col - radius)), min(width, int(col + radius) + 2)):
            dr, dc = r + 0.5 - row, c + 0.5 - col
            if dr * dr + dc * dc <= radius * radius and np.isinf(cost[r, c]) and clearance[r, c] >= 1.0:
                cost[r, c] = price


@njit(nogil=True, cache=True)
def flood(cost: F4, state: U1, row: int, col: int, queue: I4) -> U1:
    """Return uint8 reach from one cell: 0 not reachable, 1 over seen floor, 2 only over unseen floor."""
    height, width = cost.shape
    reach = np.zeros((height, width), dtype=np.uint8)
    if row < 0 or col < 0 or row >= height or col >= width or np.isinf(cost[row, col]):
        return reach
    reach[row, col] = 1
    queue[0] = row * width + col
    head, tail = 0, 1
    for level in range(1, 3):
        if level == 2:
            head = 0  # everything found so far may lead over unseen floor
        while head < tail:
            cell = queue[head]
            head += 1
            r, c = cell // width, cell % width
            for k in range(4):
                rr = r + (1 if k == 0 else -1 if k == 1 else 0)
                cc = c + (1 if k == 2 else -1 if k == 3 else 0)
                if rr < 0 or cc < 0 or rr >= height or cc >= width or reach[rr, cc] != 0:
                    continue
                if np.isinf(cost[rr, cc]) or (level == 1 and state[rr, cc] == UNKNOWN):
                    continue
                reach[rr, cc] = level
                queue[tail] = rr * width + cc
                tail += 1
    return reach


@njit(nogil=True, cache=True)
def _link(cell: int, slot: int, following: I4, preceding: I4, slot_of: I4, head: I4) -> None:
    following[cell] = head[slot]
    preceding[cell] = -1
    slot_of[cell] = slot
    if head[slot] >= 0:
        preceding[head[slot]] = cell
    head[slot] = cell


@njit(nogil=True, cache=True)
def _unlink(cell: int, following: I4, preceding: I4, slot_of: I4, head: I4) -> None:
    p, n = preceding[cell], following[cell]
    if p >= 0:
        following[p] = n
    else:
        head[slot_of[cell]] = n
    if n >= 0:
        preceding[n] = p
    slot_of[cell] = -1


@njit(nogil=True, cache=True)
def march(cost: F4, seeds: I8, seed_values: F8, stop_cell: int, margin: float, top_cost: float) -> F4:
    """Return float32 cost-to-go (cells) to the seeds: the Eikonal equation |grad T| = cost (Sethian, 1996).

    Cells wait in a ring of buckets half a cell wide (Yatziv, Bartesaghi and Sapiro, 2006) and are corrected
    when a better way to them shows up late. Ends `margin` after the stop cell (flat index; -1: none) is
    settled; what was not reached by then is inf. No finite cost may be above top_cost.
    """
    height, width = cost.shape
    value = np.full(height * width, np.inf, dtype=np.float32)
    following = np.empty(height * width, dtype=np.int32)
    preceding = np.empty(height * width, dtype=np.int32)
    slot_of = np.full(height * width, -1, dtype=np.int32)
    bucket = 0.5
    first, last = seed_values.min(), seed_values.max()
    slots = int((top_cost + last - first) / bucket) + 4
    head = np.full(slots, -1, dtype=np.int32)
    flat = cost.ravel()
    waiting = 0
    for i in range(seeds.size):
        if slot_of[seeds[i]] < 0:
            value[seeds[i]] = seed_values[i]
            _link(seeds[i], int(seed_values[i] / bucket) % slots, following, preceding, slot_of, head)
            waiting += 1
    limit = np.inf
    level = int(first / bucket)
    while waiting > 0 and level * bucket <= limit:
        cell = head[level % slots]
        if cell < 0:
            level += 1
            continue
        _unlink(cell, following, preceding, slot_of, head)
        waiting -= 1
        if cell == stop_cell:
            limit = value[cell] + margin
        r, c = cell // width, cell % width
        for k in range(4):
            rr = r + (1 if k == 0 else -1 if k == 1 else 0)
            cc = c + (1 if k == 2 else -1 if k == 3 else 0)
            if rr < 0 or cc < 0 or rr >= height or cc >= width:
                continue
            other = rr * width + cc
            f = flat[other]
            if np.isinf(f) or value[other] <= value[cell]:
                continue
            a = min(value[other - 1] if cc > 0 else np.inf, value[other + 1] if cc < width - 1 else np.inf)
            b = min(
                value[other - width] if rr > 0 else np.inf,
                value[other + width] if rr < height - 1 else np.inf,
            )
            low, high = min(a, b), max(a, b)
            if high - low >= f:
                t = low + f
            else:
                t = 0.5 * (low + high + np.sqrt(2.0 * f * f - (high - low) * (high - low)))
            if t >= value[other] - 1e-3:
                continue
            if slot_of[other] >= 0:
                _unlink(other, following, preceding, slot_of, head)
                waiting -= 1
            value[other] = t
            _link(other, max(int(t / bucket), level) % slots, following, preceding, slot_of, head)
            waiting += 1
    return value.reshape((height, width))


@njit(nogil=True, cache=True)
def descend(field: F4, row: float, col: float, step: float, max_steps: int) -> F8:
    """Return float64 (N, 2) [row, col] points from (row, col) down the field to its least value.

    Follows the gradient; where the gradient is not defined (beside walls) goes to the best neighbour.
    """
    height, width = field.shape
    path = np.empty((max_steps + 1, 2), dtype=np.float64)
    path[0, 0], path[0, 1] = row, col
    count = 1
    for _ in range(max_steps):
        r, c = int(np.floor(row)), int(np.floor(col))
        if r < 1 or c < 1 or r >= height - 1 or c >= width - 1:
            break
        best, br, bc = field[r, c], r, c
        for dr in range(-1, 2):
            for dc in range(-1, 2):
                t = field[r + dr, c + dc]
                if t < best:
                    best, br, bc = t, r + dr, c + dc
        if br == r and bc == c:
            break
        up, down = field[r + 1, c], field[r - 1, c]
        right, left = field[r, c + 1], field[r, c - 1]
        moved = False
        if np.isfinite(up) and np.isfinite(down) and np.isfinite(right) and np.isfinite(left):
            gr, gc = up - down, right - left
            norm = np.sqrt(gr * gr + gc * gc)
            if norm > 1e-9:
                nr, nc = row - step * gr / norm, col - step * gc / norm
                t = field[int(np.floor(nr)), int(np.floor(nc))]
                if t <= field[r, c]:
                    row, col = nr, nc
                    moved = True
        if not moved or (
            count > 4 and (path[count - 3, 0] - row) ** 2 + (path[count - 3, 1] - col) ** 2 < step * step
        ):
            row, col = br + 0.5, bc + 0.5
        path[count, 0], path[count, 1] = row, col
        count += 1
    return path[:count]


@njit(nogil=True, cache=True)
def worst_on_line(cost: F4, state: U1, row0: float, col0: float, row1: float, col1: float) -> int:
    """Return the worst on a straight line: 0 seen floor all along, 1 unseen floor, 2 body does not fit."""
    height, width = cost.shape
    dr, dc = row1 - row0, col1 - col0
    steps = int(np.ceil(2.0 * max(abs(dr), abs(dc)))) + 1
    worst = 0
    for k in range(steps + 1):
        r = int(np.floor(row0 + dr * k / steps))
        c = int(np.floor(col0 + dc * k / steps))
        if r < 0 or c < 0 or r >= height or c >= width:
            return 2
        if np.isinf(cost[r, c]):
            return 2
        if state[r, c] == UNKNOWN:
            worst = 1
    return worst
