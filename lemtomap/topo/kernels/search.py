"""Flat loops of place recognition on plain arrays: score pyramid and exact correlative search.

Score fields are int16 (rows, cols): 100 on an obstacle, falling off with distance, 0 where nothing is known,
negative where free space contradicts an obstacle. Cell [r, c] covers x in [c, c + 1), y in [r, r + 1) cells.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Cells = NDArray[np.int8]
Scores = NDArray[np.int16]
Values = NDArray[np.float64]
Indices = NDArray[np.int64]
Blocks = NDArray[np.int32]

MOST_SCORE = 100  # of one point


@njit(nogil=True, cache=True)
def pool(
    occupancy: Cells,
    block: int,
    occupied_from: int,
) -> Cells:
    """Return the grid with `block` times larger cells, int8: an obstacle wins, then mostly unknown, then
    free.
    """
    rows, cols = occupancy.shape[0] // block, occupancy.shape[1] // block
    result = np.empty((rows, cols), dtype=np.int8)
    for r in range(rows):
        for c in range(cols):
            most, unknown = np.int8(-1), 0
            for i in range(r * block, (r + 1) * block):
                for j in range(c * block, (c + 1) * block):
                    most = max(most, occupancy[i, j])
                    unknown += occupancy[i, j] < 0
            if most < occupied_from and unknown > block:
                most = np.int8(-1)
            result[r, c] = most
    return result


@njit(nogil=True, cache=True)
def score_field(
    occupancy: Cells,
    occupied_from: int,
    free_below: int,
    falloff: Scores,
    contradiction: int,
) -> Scores:
    """Return the int16 score of finding an obstacle in each cell.

    occupancy: int8 (rows, cols), -1 unknown, else 0..100. falloff: int16 (k, k) stamp, k odd, 100 in the
    middle.
    contradiction: score (negative) of a free cell that no stamp reaches.
    """
    rows, cols = occupancy.shape
    field = np.zeros((rows, cols), dtype=np.int16)
    half = falloff.shape[0] // 2
    for r in range(rows):
        for c in range(cols):
            if occupancy[r, c] >= occupied_from:
                for i in range(max(0, r - half), min(rows, r + half + 1)):
                    for j in range(max(0, c - half), min(cols, c + half + 1)):
                        value = falloff[i - r + half, j - c + half]
                        field[i, j] = max(field[i, j], value)
    for r in range(rows):
        for c in range(cols):
            if field[r, c] == 0 and 0 <= occupancy[r, c] < free_below:
                field[r, c] = contradiction
    return field


@njit(nogil=True, cache=True)
def pyramid(
    field: Scores,
    levels: int,
) -> Scores:
    """Return int16 (levels, rows, cols): level h, cell [r, c] is the greatest of field[r:r + 2**h, c:c +
    2**h].

    Cells beyond the border count as unknown (0), so a bound is valid for windows that stick out on either
    side: rows and columns are shifted by `pad` = 2**(levels - 1), the first 2**(levels - 1) lie before the
    field.
    """
    pad = 1 << (levels - 1)
    rows, cols = field.shape[0] + pad, field.shape[1] + pad
    result = np.zeros((levels, rows, cols), dtype=np.int16)
    result[0, pad:, pad:] = field
    for h in range(1, levels):
        step = 1 << (h - 1)
        below = result[h - 1]
        above = result[h]
        for r in range(rows):
            r2 = r + step
            for c in range(cols):
                c2 = c + step
                best = below[r, c]
                right = below[r, c2] if c2 < cols else 0
                best = max(best, right)
                if r2 < rows:
                    best = max(best, below[r2, c])
                    diagonal = below[r2, c2] if c2 < cols else 0
                    best = max(best, diagonal)
                else:
                    best = max(best, 0)
                above[r, c] = best
    return result


@njit(nogil=True, cache=True)
def turned(points_cells: Values, angle_rad: float, slack: float, pad: int, cells: Blocks) -> None:
    """Put the cell of each point, turned and moved back by `slack` cells, into cells, int32 (N, 2)."""
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    for i in range(points_cells.shape[0]):
        x, y = points_cells[i, 0], points_cells[i, 1]
        cells[i, 0] = int(np.floor(cos * x - sin * y - slack)) + pad
        cells[i, 1] = int(np.floor(sin * x + cos * y - slack)) + pad


@njit(nogil=True, cache=True)
def total(layer: Scores, cells: Blocks, col: int, row: int) -> int:
    """Return the sum of a layer's scores at cells moved by (col, row)."""
    rows, cols = layer.shape
    result = 0
    for i in range(cells.shape[0]):
        c, r = cells[i, 0] + col, cells[i, 1] + row
        if 0 <= c < cols and 0 <= r < rows:
            result += layer[r, c]
    return result


@njit(nogil=True, cache=True)
def totals(layer: Scores, cells: Blocks, col: int, row: int, side: int, least: int, keys: Indices) -> None:
    """Put the sums of a layer's scores at cells moved by (col, row), and by `side` more, into keys, int64
    (2, 2): [0, 1] is that at (col + side, row). Where none of the four can reach `least` anything below it.
    """
    rows, cols = layer.shape
    count = cells.shape[0]
    a, b, c, d = 0, 0, 0, 0
    for i in range(count):
        x, y = cells[i, 0] + col, cells[i, 1] + row
        x2, y2 = x + side, y + side
        if x >= 0 and x2 < cols and y >= 0 and y2 < rows:
            a += layer[y, x]
            b += layer[y, x2]
            c += layer[y2, x]
            d += layer[y2, x2]
        else:
            left, right = 0 <= x < cols, 0 <= x2 < cols
            if 0 <= y < rows:
                a += layer[y, x] if left else 0
                b += layer[y, x2] if right else 0
            if 0 <= y2 < rows:
                c += layer[y2, x] if left else 0
                d += layer[y2, x2] if right else 0
        if i % 16 == 15 and max(a, b, c, d) + MOST_SCORE * (count - 1 - i) < least:
            a = b = c = d = least - 1
            break
    keys[0, 0], keys[0, 1], keys[1, 0], keys[1, 1] = a, b, c, d


@njit(nogil=True, cache=True)
def bound(
    stack: Scores,
    points_cells: Values,
    level: int,
    col: int,
    row: int,
    angle_rad: float,
    slack: float,
) -> int:
    """Return the greatest sum of scores any pose of a block can have (level 0: the score of the pose).

    A block holds the translations [col, col + 2**level) x [row, row + 2**level) and the angles whose rotation
    moves no point by more than `slack` cells from where `angle_rad` puts it.
    """
    cells = np.empty((points_cells.shape[0], 2), np.int32)
    turned(points_cells, angle_rad, slack, 1 << (stack.shape[0] - 1), cells)
    return total(stack[level + 1] if level > 0 else stack[0], cells, col, row)


@njit(nogil=True, cache=True)
def _push(
    heap_key: Indices,
    heap_block: Blocks,
    size: int,
    key: int,
    level: int,
    col: int,
    row: int,
    angle: int,
) -> int:
    at = size
    while at > 0:
        parent = (at - 1) // 2
        if heap_key[parent] >= key:
            break
        heap_key[at] = heap_key[parent]
        heap_block[at, :] = heap_block[parent, :]
        at = parent
    heap_key[at] = key
    heap_block[at, 0] = level
    heap_block[at, 1] = col
    heap_block[at, 2] = row
    heap_block[at, 3] = angle
    return size + 1


@njit(nogil=True, cache=True)
def _drop_first(
    heap_key: Indices,
    heap_block: Blocks,
    size: int,
) -> int:
    size -= 1
    key = heap_key[size]
    level, col, row, angle = heap_block[size]
    at = 0
    while True:
        child = 2 * at + 1
        if child >= size:
            break
        if child + 1 < size and heap_key[child + 1] > heap_key[child]:
            child += 1
        if heap_key[child] <= key:
            break
        heap_key[at] = heap_key[child]
        heap_block[at, :] = heap_block[child, :]
        at = child
    heap_key[at] = key
    heap_block[at, 0] = level
    heap_block[at, 1] = col
    heap_block[at, 2] = row
    heap_block[at, 3] = angle
    return size


@njit(nogil=True, cache=True)
def plant(
    stack: Scores,
    points_cells: Values,
    level: int,
    box: Indices,
    angle_0_rad: float,
    angle_step_rad: float,
    least: int,
    heap_key: Indices,
    heap_block: Blocks,
    size: int,
    begin: int,
    budget: int,
) -> tuple[int, int, int]:
    """Add the root blocks of a search whose bound reaches `least` to the heap, from block number `begin` on.

    box: int64 (6,): col from, col to, row from, row to, angle index from, angle index to (exclusive).
    Returns (heap size, work done, block number to go on with, -1 when all are in).
    """
    side = 1 << level
    slack = 0.5 * (side - 1)
    cols = (box[1] - box[0] + side - 1) // side
    rows = (box[3] - box[2] + side - 1) // side
    angles = (box[5] - box[4] + side - 1) // side
    end = min(cols * rows * angles, begin + budget)
    pad = 1 << (stack.shape[0] - 1)
    cells = np.empty((points_cells.shape[0], 2), np.int32)
    at_angle = -1
    for block in range(begin, end):
        col = box[0] + side * (block % cols)
        row = box[2] + side * (block // cols % rows)
        angle = box[4] + side * (block // (cols * rows))
        if at_angle != angle:
            at_angle = angle
            turned(points_cells, angle_0_rad + (angle + slack) * angle_step_rad, slack, pad, cells)
        key = total(stack[level + 1], cells, col, row)
        if key >= least and size < heap_key.shape[0]:
            size = _push(heap_key, heap_block, size, key, level, col, row, angle)
    return size, max(0, end - begin), end if end < cols * rows * angles else -1


@njit(nogil=True, cache=True)
def dig(
    stack: Scores,
    points_cells: Values,
    box: Indices,
    away: Indices,
    angle_0_rad: float,
    angle_step_rad: float,
    least: int,
    heap_key: Indices,
    heap_block: Blocks,
    size: int,
    budget: int,
) -> tuple[int, int, int, int, int, int, int]:
    """Open blocks best first until a pose is on top: no other pose of the search scores more.

    away: int64 (6,): poses inside this box are passed over (col, row, angle index; from, to); empty: none.
    Returns (state, heap size, key, col, row, angle index, work): state 1 found, 0 nothing reaches `least`,
    2 budget spent, call again, 3 heap full. The pose found stays off the heap, so calling again gives the
    next best.
    """
    work = 0
    pad = 1 << (stack.shape[0] - 1)
    cells = np.empty((points_cells.shape[0], 2), np.int32)
    keys = np.empty((2, 2), np.int64)
    room = heap_key.shape[0] - 8
    while size > 0:
        key = heap_key[0]
        level, col, row, angle = heap_block[0]
        if key < least:
            return 0, size, 0, 0, 0, 0, work
        if work >= budget:
            return 2, size, 0, 0, 0, 0, work
        size = _drop_first(heap_key, heap_block, size)
        if level == 0:
            inside = away[0] <= col < away[1] and away[2] <= row < away[3] and away[4] <= angle < away[5]
            if inside:
                continue
            return 1, size, key, col, row, angle, work
        if size > room:
            return 3, size, 0, 0, 0, 0, work
        child_level = level - 1
        side = 1 << child_level
        slack = 0.5 * (side - 1)
        for k in range(2):
            child_angle = angle + k * side
            if child_angle >= box[5]:
                continue
            turned(points_cells, angle_0_rad + (child_angle + slack) * angle_step_rad, slack, pad, cells)
            totals(
                stack[child_level + 1] if child_level > 0 else stack[0], cells, col, row, side, least, keys
            )
            for i in range(2):
                child_row = row + i * side
                if child_row >= box[3]:
                    continue
                for j in range(2):
                    child_col = col + j * side
                    if child_col >= box[1]:
                        continue
                    covered = (
                        away[0] <= child_col
                        and child_col + side <= away[1]
                        and away[2] <= child_row
                        and child_row + side <= away[3]
                        and away[4] <= child_angle
                        and child_angle + side <= away[5]
                    )
                    if covered:
                        continue
                    work += 1
                    if keys[i, j] >= least:
                        size = _push(
                            heap_key,
                            heap_block,
                            size,
                            keys[i, j],
                            child_level,
                            child_col,
                            child_row,
                            child_angle,
                        )
    return 0, size, 0, 0, 0, 0, work
