"""Jitted coding of a place's boundary: a bitmap and sub-cell offsets through one adaptive arithmetic coder.

The coder keeps an interval [low, high] of 32-bit numbers and narrows it by each bit's probability (Witten,
Neal and Cleary 1987); a bit's probability is learnt in the context of the cells around it, as in JBIG.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Bits = NDArray[np.uint8]
Levels = NDArray[np.int8]
Table = NDArray[np.int64]
Values = NDArray[np.float64]

ONE_BITS = 16
ONE = 1 << ONE_BITS
LIMIT = 60  # how far back a context remembers: steady in a small picture
BITMAP_CONTEXTS = 128
LEVELS = 5  # offsets -2..2
STRAIGHT = 0.6  # only where the boundary has a direction there is an offset across it
LEVEL_CONTEXTS = (LEVELS + 1) * 8
SIDE_CONTEXTS = 6


@njit(nogil=True, cache=True)
def fresh_tables() -> Table:
    """Return [probability of a 1 in 65536ths, times seen] for every context before the first bit."""
    tables = np.zeros((BITMAP_CONTEXTS + LEVEL_CONTEXTS + SIDE_CONTEXTS, 2), np.int64)
    for k in range(tables.shape[0]):
        tables[k, 0] = ONE // 2
    for context in range(BITMAP_CONTEXTS):
        neighbours = 0
        for bit in range(7):
            neighbours += (context >> bit) & 1
        tables[context, 0] = 400 if neighbours == 0 else 20000
        tables[context, 1] = 20 if neighbours == 0 else 1
    return tables


@njit(nogil=True, cache=True, inline="always")
def learn(tables: Table, context: int, bit: int) -> None:
    """Move a context's probability towards what it has just seen."""
    seen, chance = tables[context, 1], tables[context, 0]
    chance += (bit * ONE - chance) // (seen + 2)
    tables[context, 0] = min(max(chance, 32), ONE - 32)
    if seen < LIMIT:
        tables[context, 1] = seen + 1


@njit(nogil=True, cache=True, inline="always")
def put_bit(
    low: int, high: int, at: int, out: Bits, tables: Table, context: int, bit: int
) -> tuple[int, int, int]:
    """Narrow the interval [low, high]; return it and the bytes written."""
    middle = low + ((high - low) * tables[context, 0] >> ONE_BITS)
    if bit:
        high = middle
    else:
        low = middle + 1
    learn(tables, context, bit)
    while (low ^ high) & 0xFF000000 == 0:
        out[at] = high >> 24
        at += 1
        low = (low << 8) & 0xFFFFFFFF
        high = ((high << 8) & 0xFFFFFFFF) | 255
    return low, high, at


@njit(nogil=True, cache=True, inline="always")
def get_bit(
    low: int, high: int, at: int, code: int, data: Bits, tables: Table, context: int
) -> tuple[int, int, int, int, int]:
    """Return the next bit, the interval, the bytes read and the code; zeros follow the end of the data."""
    middle = low + ((high - low) * tables[context, 0] >> ONE_BITS)
    bit = 1 if code <= middle else 0
    if bit:
        high = middle
    else:
        low = middle + 1
    learn(tables, context, bit)
    while (low ^ high) & 0xFF000000 == 0:
        low = (low << 8) & 0xFFFFFFFF
        high = ((high << 8) & 0xFFFFFFFF) | 255
        code = ((code << 8) & 0xFFFFFFFF) | (data[at] if at < data.shape[0] else 0)
        at += 1
    return bit, low, high, at, code


@njit(nogil=True, cache=True)
def cell_context(bitmap: Bits, row: int, col: int) -> int:
    """Return the seven cells above and to the left as a number; the bitmap's border is two empty cells."""
    return int(
        bitmap[row, col - 1]
        | bitmap[row, col - 2] << 1
        | bitmap[row - 1, col - 1] << 2
        | bitmap[row - 1, col] << 3
        | bitmap[row - 1, col + 1] << 4
        | bitmap[row - 2, col] << 5
        | bitmap[row - 1, col + 2] << 6
    )


@njit(nogil=True, cache=True)
def level_context(bitmap: Bits, levels: Levels, row: int, col: int) -> int:
    """Return 1 + the offset level of the cell before this one along the boundary, 0 when it starts here."""
    if bitmap[row, col - 1]:
        return int(1 + levels[row, col - 1] + LEVELS // 2)
    if bitmap[row - 1, col]:
        return int(1 + levels[row - 1, col] + LEVELS // 2)
    if bitmap[row - 1, col - 1]:
        return int(1 + levels[row - 1, col - 1] + LEVELS // 2)
    if bitmap[row - 1, col + 1]:
        return int(1 + levels[row - 1, col + 1] + LEVELS // 2)
    return 0


@njit(nogil=True, cache=True)
def side_guess(bitmap: Bits, fronts: Values, row: int, col: int, shape: Values) -> tuple[int, int]:
    """Return (context, side) to expect: that of the cell before this one, else towards the node.

    fronts (rows, cols, 2) holds the signed normals of the cells coded so far, zero where the front is not
    known; shape is this cell's row of cell_normals.
    """
    for dr, dc in ((0, -1), (-1, 0), (-1, -1), (-1, 1)):
        if bitmap[row + dr, col + dc]:
            fx, fy = fronts[row + dr, col + dc]
            if fx == 0.0 and fy == 0.0:
                return 0, 1 if shape[2] * shape[0] + shape[3] * shape[1] < 0.0 else -1
            return 1, 1 if fx * shape[2] + fy * shape[3] >= 0.0 else -1
    return 2, 1 if shape[2] * shape[0] + shape[3] * shape[1] < 0.0 else -1


@njit(nogil=True, cache=True)
def encode(bitmap: Bits, levels: Levels, sides: Levels, reach: int) -> Bits:
    """Return the coded bitmap and the offset levels and sides (-1, 0, 1) of its straight cells.

    All with a border of two.
    """
    rows, cols = bitmap.shape
    out = np.zeros(rows * cols + 16, np.uint8)
    low, high, at = 0, 0xFFFFFFFF, 0
    tables = fresh_tables()
    for row in range(2, rows - 2):
        for col in range(2, cols - 2):
            context = cell_context(bitmap, row, col)
            low, high, at = put_bit(low, high, at, out, tables, context, bitmap[row, col])
    shape = cell_normals(bitmap, 1.0, reach)
    fronts = np.zeros((rows, cols, 2))
    k = -1
    for row in range(2, rows - 2):
        for col in range(2, cols - 2):
            k += bitmap[row, col]
            if not bitmap[row, col] or shape[k, 4] < STRAIGHT:
                continue
            context, guess = side_guess(bitmap, fronts, row, col, shape[k])
            context = BITMAP_CONTEXTS + LEVEL_CONTEXTS + 2 * context
            side = sides[row, col]
            low, high, at = put_bit(low, high, at, out, tables, context, 1 if side == 0 else 0)
            if side != 0:
                turned = 1 if side != guess else 0
                low, high, at = put_bit(low, high, at, out, tables, context + 1, turned)
            fronts[row, col, 0], fronts[row, col, 1] = side * shape[k, 2], side * shape[k, 3]
            base = BITMAP_CONTEXTS + 8 * level_context(bitmap, levels, row, col)
            value = levels[row, col] + LEVELS // 2
            node = 1
            for shift in range(2, -1, -1):
                bit = (value >> shift) & 1
                low, high, at = put_bit(low, high, at, out, tables, base + node, bit)
                node = 2 * node + bit
    out[at] = (low >> 24) + 1
    end = at + 1
    while end > 0 and out[end - 1] == 0:
        end -= 1
    return out[:end].copy()


@njit(nogil=True, cache=True)
def decode(data: Bits, bitmap: Bits, levels: Levels, sides: Levels, reach: int) -> None:
    """Fill bitmap, levels and sides (all zero before) from coded data. Any data decodes to something."""
    rows, cols = bitmap.shape
    low, high, at, code = 0, 0xFFFFFFFF, 4, 0
    for k in range(4):
        code = (code << 8) | (data[k] if k < data.shape[0] else 0)
    tables = fresh_tables()
    for row in range(2, rows - 2):
        for col in range(2, cols - 2):
            context = cell_context(bitmap, row, col)
            bit, low, high, at, code = get_bit(low, high, at, code, data, tables, context)
            bitmap[row, col] = bit
    shape = cell_normals(bitmap, 1.0, reach)
    fronts = np.zeros((rows, cols, 2))
    k = -1
    for row in range(2, rows - 2):
        for col in range(2, cols - 2):
            k += bitmap[row, col]
            if not bitmap[row, col] or shape[k, 4] < STRAIGHT:
                continue
            context, guess = side_guess(bitmap, fronts, row, col, shape[k])
            context = BITMAP_CONTEXTS + LEVEL_CONTEXTS + 2 * context
            side = 0
            bit, low, high, at, code = get_bit(low, high, at, code, data, tables, context)
            if not bit:
                bit, low, high, at, code = get_bit(low, high, at, code, data, tables, context + 1)
                side = -guess if bit else guess
            sides[row, col] = side
            fronts[row, col, 0], fronts[row, col, 1] = side * shape[k, 2], side * shape[k, 3]
            base = BITMAP_CONTEXTS + 8 * level_context(bitmap, levels, row, col)
            node = 1
            for _ in range(3):
                bit, low, high, at, code = get_bit(low, high, at, code, data, tables, base + node)
                node = 2 * node + bit
            levels[row, col] = min(node - 8, LEVELS - 1) - LEVELS // 2


@njit(nogil=True, cache=True)
def fill_bitmap(points: Values, cell: float, bitmap: Bits, means: Values) -> None:
    """Set the cells that hold points and put the mean of each cell's points into means (rows, cols, 4).

    Points (N, 4) are metres from the picture's centre and whence they were seen; those outside are left out.
    """
    rows, cols = bitmap.shape
    half = (rows - 4) // 2
    counts = np.zeros((rows, cols))
    for k in range(points.shape[0]):
        x, y = points[k, 0], points[k, 1]
        if not (math.isfinite(x) and math.isfinite(y)):
            continue
        col = math.floor(x / cell) + half + 2
        row = math.floor(y / cell) + half + 2
        if row < 2 or col < 2 or row >= rows - 2 or col >= cols - 2:
            continue
        bitmap[row, col] = 1
        counts[row, col] += 1.0
        means[row, col] += points[k]
    for row in range(rows):
        for col in range(cols):
            if counts[row, col] > 0.0:
                means[row, col] /= counts[row, col]


@njit(nogil=True, cache=True)
def cell_normals(bitmap: Bits, cell: float, reach: int) -> Values:
    """Return [x, y, normal x, normal y, straightness] of each set cell from the set cells within `reach`.

    Straightness is 1 on a line and 0 where the neighbourhood has no direction.
    """
    rows, cols = bitmap.shape
    half = (rows - 4) // 2
    count = 0
    for row in range(rows):
        for col in range(cols):
            count += bitmap[row, col]
    out = np.zeros((count, 5))
    k = 0
    for row in range(2, rows - 2):
        for col in range(2, cols - 2):
            if not bitmap[row, col]:
                continue
            n, sx, sy, sxx, sxy, syy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for r in range(max(row - reach, 0), min(row + reach + 1, rows)):
                for c in range(max(col - reach, 0), min(col + reach + 1, cols)):
                    if bitmap[r, c]:
                        x, y = float(c - col), float(r - row)
                        n += 1.0
                        sx += x
                        sy += y
                        sxx += x * x
                        sxy += x * y
                        syy += y * y
            a, b, d = sxx - sx * sx / n, sxy - sx * sy / n, syy - sy * sy / n
            spread = math.hypot(a - d, 2.0 * b)
            along = 0.5 * math.atan2(2.0 * b, a - d)
            out[k, 0] = (col - 2 - half + 0.5) * cell
            out[k, 1] = (row - 2 - half + 0.5) * cell
            out[k, 2] = -math.sin(along)
            out[k, 3] = math.cos(along)
            out[k, 4] = spread / (a + d) if a + d > 0.0 else 0.0
            k += 1
    return out
