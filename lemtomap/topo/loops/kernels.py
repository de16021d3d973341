"""Flat loops of place recognition on plain arrays: score pyramid, exact correlative search, fine alignment.

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
            layer = stack[child_level + 1] if child_level > 0 else stack[0]
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
                    child = total(layer, cells, child_col, child_row)
                    work += 1
                    if child >= least:
                        size = _push(
                            heap_key, heap_block, size, child, child_level, child_col, child_row, child_angle
                        )
    return 0, size, 0, 0, 0, 0, work


@njit(nogil=True, cache=True)
def nearest_index(
    points_cells: Values,
    rows: int,
    cols: int,
    reach: float,
) -> Blocks:
    """Return int32 (rows, cols): the index of the nearest point whose distance to the cell's centre is at
    most
    `reach` cells, else -1. points_cells: float64 (N, 2), x and y in cells.
    """
    index = np.full((rows, cols), -1, dtype=np.int32)
    best = np.full((rows, cols), np.float32(reach * reach), dtype=np.float32)
    span = int(np.ceil(reach))
    for i in range(points_cells.shape[0]):
        x, y = points_cells[i, 0], points_cells[i, 1]
        c0, r0 = int(np.floor(x)), int(np.floor(y))
        for r in range(max(0, r0 - span), min(rows, r0 + span + 1)):
            for c in range(max(0, c0 - span), min(cols, c0 + span + 1)):
                dx, dy = c + 0.5 - x, r + 0.5 - y
                gap = dx * dx + dy * dy
                if gap < best[r, c]:
                    best[r, c] = gap
                    index[r, c] = i
    return index


@njit(nogil=True, cache=True)
def line_normals(
    points_m: Values,
    reach_m: float,
) -> Values:
    """Return float64 (N, 3): unit normal x, y of the line through each point's neighbourhood and how thin
    that
    neighbourhood is (1 a line, 0 round or alone).
    """
    n = points_m.shape[0]
    order = np.argsort(points_m[:, 0])
    result = np.zeros((n, 3))
    reach2 = reach_m * reach_m
    for k in range(n):
        i = order[k]
        x, y = points_m[i, 0], points_m[i, 1]
        count, sx, sy, sxx, sxy, syy = 0, 0.0, 0.0, 0.0, 0.0, 0.0
        for way in range(2):
            step = 1 if way == 0 else -1
            m = k if way == 0 else k - 1
            while 0 <= m < n:
                j = order[m]
                dx, dy = points_m[j, 0] - x, points_m[j, 1] - y
                if abs(dx) > reach_m:
                    break
                if dx * dx + dy * dy <= reach2:
                    count += 1
                    sx += dx
                    sy += dy
                    sxx += dx * dx
                    sxy += dx * dy
                    syy += dy * dy
                m += step
        if count < 3:
            continue
        mx, my = sx / count, sy / count
        cxx, cxy, cyy = sxx / count - mx * mx, sxy / count - mx * my, syy / count - my * my
        half, root = 0.5 * (cxx + cyy), np.sqrt(0.25 * (cxx - cyy) ** 2 + cxy * cxy)
        large, small = half + root, half - root
        angle = 0.5 * np.arctan2(2.0 * cxy, cxx - cyy)
        result[i, 0] = -np.sin(angle)
        result[i, 1] = np.cos(angle)
        result[i, 2] = 1.0 - max(small, 0.0) / large if large > 1e-12 else 0.0
    return result


@njit(nogil=True, cache=True)
def align(
    points_m: Values,
    targets_m: Values,
    normals: Values,
    index: Blocks,
    origin_x: float,
    origin_y: float,
    resolution_m: float,
    pose: Values,
    gate_m: float,
    sigma_m: float,
    rounds: int,
) -> tuple[Values, Values, int, float]:
    """Move `pose` so that points fall on the lines through their nearest targets; Gauss-Newton,
    Geman-McClure weights.

    points_m: float64 (N, 2) in the moving frame; targets_m (M, 2) and normals (M, 3) in the fixed frame;
    index from
    nearest_index over that frame's cells. Returns (pose (3,), information (3, 3) in the fixed frame about
    the moved
    origin, explained points, root mean square residual m).
    """
    x, y, yaw = pose[0], pose[1], pose[2]
    rows, cols = index.shape
    info = np.zeros((3, 3))
    used = 0
    squares = 0.0
    scale2 = sigma_m * sigma_m
    for turn in range(rounds):
        info[:, :] = 0.0
        b0, b1, b2 = 0.0, 0.0, 0.0
        used = 0
        squares = 0.0
        weight_sum = 0.0
        cos, sin = np.cos(yaw), np.sin(yaw)
        for i in range(points_m.shape[0]):
            rx = cos * points_m[i, 0] - sin * points_m[i, 1]
            ry = sin * points_m[i, 0] + cos * points_m[i, 1]
            px, py = rx + x, ry + y
            c = int(np.floor((px - origin_x) / resolution_m))
            r = int(np.floor((py - origin_y) / resolution_m))
            if r < 0 or r >= rows or c < 0 or c >= cols:
                continue
            j = index[r, c]
            if j < 0:
                continue
            dx, dy = px - targets_m[j, 0], py - targets_m[j, 1]
            gap2 = dx * dx + dy * dy
            if gap2 > gate_m * gate_m:
                continue
            thin = normals[j, 2]
            nx, ny = normals[j, 0], normals[j, 1]
            if thin < 0.8:
                gap = np.sqrt(gap2)
                if gap < 1e-9:
                    used += 1
                    continue
                nx, ny = dx / gap, dy / gap
            e = dx * nx + dy * ny
            w = scale2 / (scale2 + e * e)
            w = w * w
            j2 = -ry * nx + rx * ny
            info[0, 0] += w * nx * nx
            info[0, 1] += w * nx * ny
            info[0, 2] += w * nx * j2
            info[1, 1] += w * ny * ny
            info[1, 2] += w * ny * j2
            info[2, 2] += w * j2 * j2
            b0 += w * nx * e
            b1 += w * ny * e
            b2 += w * j2 * e
            used += 1
            squares += w * e * e
            weight_sum += w
        info[1, 0], info[2, 0], info[2, 1] = info[0, 1], info[0, 2], info[1, 2]
        if weight_sum > 0.0:
            squares /= weight_sum
        if used < 6 or turn == rounds - 1:
            break
        damped = info.copy()
        for k in range(3):
            damped[k, k] += 1e-3 * info[k, k] + 1e-6
        step = np.linalg.solve(damped, np.array([-b0, -b1, -b2]))
        x += step[0]
        y += step[1]
        yaw += step[2]
    return np.array([x, y, yaw]), info, used, np.sqrt(squares)


@njit(nogil=True, cache=True)
def tally(
    points_m: Values,
    pose: Values,
    occupancy_score: Scores,
    origin_x: float,
    origin_y: float,
    resolution_m: float,
) -> tuple[int, int, int]:
    """Count a node's points by what the window says of them: (explained, contradicted, unknown).

    occupancy_score: a score field (see score_field).
    """
    rows, cols = occupancy_score.shape
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    hit, against, unknown = 0, 0, 0
    for i in range(points_m.shape[0]):
        px = cos * points_m[i, 0] - sin * points_m[i, 1] + pose[0]
        py = sin * points_m[i, 0] + cos * points_m[i, 1] + pose[1]
        c = int(np.floor((px - origin_x) / resolution_m))
        r = int(np.floor((py - origin_y) / resolution_m))
        value = occupancy_score[r, c] if 0 <= r < rows and 0 <= c < cols else 0
        if value > 0:
            hit += 1
        elif value < 0:
            against += 1
        else:
            unknown += 1
    return hit, against, unknown


@njit(nogil=True, cache=True)
def share_near(
    points_m: Values,
    targets_m: Values,
    reach_m: float,
    cell_m: float,
) -> float:
    """Return the share of points that have a target in their cell or one of the two rings around it.

    points_m: float64 (N, 2), targets_m: float64 (M, 2), one frame; targets further than `reach_m` and two
    cells from the origin (Chebyshev) are not needed. 1 when there are no points.
    """
    half = int(np.ceil(reach_m / cell_m)) + 3
    taken = np.zeros((2 * half + 1, 2 * half + 1), dtype=np.bool_)
    for i in range(targets_m.shape[0]):
        c = int(np.floor(targets_m[i, 0] / cell_m)) + half
        r = int(np.floor(targets_m[i, 1] / cell_m)) + half
        if 2 <= c < 2 * half - 1 and 2 <= r < 2 * half - 1:
            taken[r - 2 : r + 3, c - 2 : c + 3] = True
    if points_m.shape[0] == 0:
        return 1.0
    count = 0
    for i in range(points_m.shape[0]):
        c = int(np.floor(points_m[i, 0] / cell_m)) + half
        r = int(np.floor(points_m[i, 1] / cell_m)) + half
        if 0 <= c < 2 * half + 1 and 0 <= r < 2 * half + 1 and taken[r, c]:
            count += 1
    return float(count / points_m.shape[0])
