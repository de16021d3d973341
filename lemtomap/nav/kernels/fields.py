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
MOST_HITS = 4  # of a live obstacle: so many looks at the floor where it stood, and it is gone


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
def clear_cells(last_hit_s: F8, hits: U1, cells: I8, now_s: float) -> None:
    """Believe live obstacles in these cells (N, 2) one hit less, but not those just hit.

    A thin bar, or the edge of any thing, leaves floor to be seen in its cell, or in the next look beside it.
    """
    height, width = last_hit_s.shape
    for i in range(cells.shape[0]):
        r, c = cells[i, 0], cells[i, 1]
        if r < 0 or c < 0 or r >= height or c >= width or last_hit_s[r, c] == now_s or hits[r, c] == 0:
            continue
        hits[r, c] -= 1
        if hits[r, c] == 0:
            last_hit_s[r, c] = -np.inf


@njit(nogil=True, cache=True)
def mark_hits(last_hit_s: F8, hits: U1, rows: F8, cols: F8, now_s: float) -> None:
    """Count one hit per cell and scan; a cell that is believed for longer anyway stays so."""
    height, width = last_hit_s.shape
    for i in range(rows.size):
        r, c = int(np.floor(rows[i])), int(np.floor(cols[i]))
        if r < 0 or c < 0 or r >= height or c >= width or last_hit_s[r, c] >= now_s:
            continue
        last_hit_s[r, c] = now_s
        if hits[r, c] < MOST_HITS:
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
def raise_cost(cost: F4, row: float, col: float, flat: float, radius: float, price: float) -> None:
    """Let cells within `flat` cells of (row, col) cost at least `price`, less and less so out to radius."""
    height, width = cost.shape
    for r in range(max(0, int(row - radius) - 1), min(height, int(row + radius) + 2)):
        for c in range(max(0, int(col - radius) - 1), min(width, int(col + radius) + 2)):
            away = np.hypot(r + 0.5 - row, c + 0.5 - col)
            if away < radius:
                share = min(1.0, (radius - away) / (radius - flat))
                cost[r, c] = max(cost[r, c], price * share)


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
def add_live(
    state: U1, last_hit_s: F8, hits: U1, now_s: float, decay_s: float, live_hits: int, grow: int
) -> None:
    """Mark live obstacles that are fresh and seen often enough, and `grow` cells on every side of them.

    Those that are stale are forgotten.
    """
    height, width = state.shape
    for r in range(height):
        for c in range(width):
            if hits[r, c] == 0:
                continue
            if now_s - last_hit_s[r, c] > decay_s:
                hits[r, c] = 0
                last_hit_s[r, c] = -np.inf
            elif hits[r, c] >= live_hits:
                for k in range(-grow, grow + 1):
                    state[min(max(r + k, 0), height - 1), c] = LETHAL
                    state[r, min(max(c + k, 0), width - 1)] = LETHAL


@njit(nogil=True, cache=True)
def _lower(best: F4, other: F4, aside: float) -> None:
    """Keep the lesser of best and other + aside, cell by cell."""
    further = np.float32(aside)
    for c in range(best.size):
        best[c] = min(best[c], other[c] + further)


@njit(nogil=True, cache=True)
def clearance_transform(state: U1, reach: float) -> F4:
    """Return float32 distance in cells from each cell centre to the nearest LETHAL centre, capped at reach.

    First along columns, then the best of each row within reach: both inner loops run along memory, which
    beats the lower envelopes of Felzenszwalb and Huttenlocher (2012) for a reach of some dozen cells.
    """
    height, width = state.shape
    cap = np.float32(reach)
    down = np.full((height, width), cap, dtype=np.float32)
    for r in range(height):
        above = down[max(r - 1, 0)]
        for c in range(width):
            further = above[c] + np.float32(1.0)
            further = min(cap, further)
            down[r, c] = np.float32(0.0) if state[r, c] == LETHAL else further
    for r in range(height - 2, -1, -1):
        for c in range(width):
            further = down[r + 1, c] + np.float32(1.0)
            down[r, c] = min(down[r, c], further)
    out = np.full((height, width), cap, dtype=np.float32)
    square = np.empty(width, dtype=np.float32)
    best = np.empty(width, dtype=np.float32)
    for r in range(height):
        empty = True
        for c in range(width):
            empty &= down[r, c] >= cap
            square[c] = down[r, c] * down[r, c]
            best[c] = square[c]
        if empty:
            continue
        for k in range(1, min(int(reach), width - 1) + 1):
            _lower(best[:-k], square[k:], float(k * k))
            _lower(best[k:], square[:-k], float(k * k))
        for c in range(width):
            away = np.sqrt(best[c])
            out[r, c] = min(cap, away)
    return out


@njit(nogil=True, cache=True)
def traversal_cost(
    state: U1, clearance: F4, body: float, near_cost: float, falloff: float, unknown_factor: float
) -> F4:
    """Return float32 cost per cell of way: inf where the body (radius in cells) does not fit."""
    height, width = state.shape
    cost = np.empty((height, width), dtype=np.float32)
    before, value = -1.0, 1.0  # most cells are as far from everything as the one before
    for r in range(height):
        for c in range(width):
            d = clearance[r, c]
            if d < body:
                cost[r, c] = np.inf
                continue
            if d != before:
                before, x = d, (d - body) / falloff
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
    """Return uint8 reach from one cell: 0 not reachable, 1 over seen floor, 2 only over unseen floor.

    queue: int32, room for one index a cell.
    """
    height, width = cost.shape
    wide = width + 2
    closed, unseen, seen = 0, 3, 4  # until the flood gives a cell its level
    reach = np.zeros((height + 2) * wide, dtype=np.uint8)  # with a closed border one cell wide
    if row < 0 or col < 0 or row >= height or col >= width or np.isinf(cost[row, col]):
        return np.zeros((height, width), dtype=np.uint8)
    for r in range(height):
        for c in range(width):
            if cost[r, c] < np.inf:
                reach[(r + 1) * wide + c + 1] = unseen if state[r, c] == UNKNOWN else seen
    start = (row + 1) * wide + col + 1
    reach[start] = 1
    queue[0] = start
    tail = 1
    for level in range(1, 3):
        head = 0  # at level 2 everything found so far may lead over unseen floor
        least = seen if level == 1 else unseen
        while head < tail:
            cell = queue[head]
            head += 1
            for k in range(4):
                other = cell + (1 if k == 0 else -1 if k == 1 else wide if k == 2 else -wide)
                if reach[other] >= least:
                    reach[other] = level
                    queue[tail] = other
                    tail += 1
    out = np.empty((height, width), dtype=np.uint8)
    for r in range(height):
        for c in range(width):
            found = reach[(r + 1) * wide + c + 1]
            out[r, c] = found if found < unseen else closed
    return out


@njit(nogil=True, cache=True)
def _framed(layer: F4, fill: float) -> F4:
    """Return a layer, flat, with a border of `fill` one cell wide: its neighbours need no bounds."""
    height, width = layer.shape
    out = np.full((height + 2, width + 2), fill, dtype=np.float32)
    for r in range(height):
        for c in range(width):
            out[r + 1, c + 1] = layer[r, c]
    return out.ravel()


@njit(nogil=True, cache=True)
def march(cost: F4, seeds: I8, seed_values: F8, stop_cell: int, margin: float, top_cost: float) -> F4:
    """Return float32 cost-to-go (cells) to the seeds: the Eikonal equation |grad T| = cost (Sethian, 1996).

    Cells wait in a ring of buckets half a cell wide (Yatziv, Bartesaghi and Sapiro, 2006); one that is found
    a better way to waits again, and its older entry is passed over. Ends `margin` after the stop cell (flat
    index; -1: none) is settled; what was not reached by then is inf. No finite cost may be above top_cost.
    """
    height, width = cost.shape
    wide = width + 2
    inf, half, two = np.float32(np.inf), np.float32(0.5), np.float32(2.0)
    price = _framed(cost, np.inf)
    value = np.full(price.size, inf, dtype=np.float32)
    stop = (stop_cell // width + 1) * wide + stop_cell % width + 1 if stop_cell >= 0 else -1
    slots = 16
    while slots < 2.0 * (top_cost + seed_values.max() - seed_values.min()) + 4.0:
        slots *= 2
    head = np.full(slots, -1, dtype=np.int32)  # of each bucket's chain of entries
    entry_cell = np.empty(price.size // 4 + seeds.size, dtype=np.int32)
    entry_next = np.empty(entry_cell.size, dtype=np.int32)
    entry_value = np.empty(entry_cell.size, dtype=np.float32)
    spare, used, waiting = -1, 0, 0
    for i in range(seeds.size):
        cell = (seeds[i] // width + 1) * wide + seeds[i] % width + 1
        t = np.float32(seed_values[i])
        if t < value[cell]:
            value[cell] = t
            slot = int(t * two) & (slots - 1)
            entry_cell[used], entry_value[used], entry_next[used] = cell, t, head[slot]
            head[slot] = used
            used += 1
            waiting += 1
    limit = np.inf
    level = int(two * seed_values.min())
    while waiting > 0 and level <= limit:
        entry = head[level & (slots - 1)]
        if entry < 0:
            level += 1
            continue
        head[level & (slots - 1)] = entry_next[entry]
        entry_next[entry] = spare
        spare = entry
        waiting -= 1
        cell, here = entry_cell[entry], entry_value[entry]
        if here > value[cell]:
            continue
        if cell == stop:
            limit = two * (here + margin)
        for k in range(4):
            other = cell + (1 if k == 0 else -1 if k == 1 else wide if k == 2 else -wide)
            f, before = price[other], value[other]
            if f == inf or before <= here:
                continue
            a = min(value[other - 1], value[other + 1])
            b = min(value[other - wide], value[other + wide])
            low, high = min(a, b), max(a, b)
            gap = high - low
            t = low + f if gap >= f else half * (low + high + np.sqrt(two * f * f - gap * gap))
            if t >= before - np.float32(1e-3):
                continue
            value[other] = t
            if spare >= 0:
                entry = spare
                spare = entry_next[entry]
            else:
                if used == entry_cell.size:
                    entry_cell = np.concatenate((entry_cell, entry_cell))
                    entry_next = np.concatenate((entry_next, entry_next))
                    entry_value = np.concatenate((entry_value, entry_value))
                entry = used
                used += 1
            slot = max(int(t * two), level) & (slots - 1)
            entry_cell[entry], entry_value[entry], entry_next[entry] = other, t, head[slot]
            head[slot] = entry
            waiting += 1
    return value.reshape((height + 2, wide))[1:-1, 1:-1].copy()


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
