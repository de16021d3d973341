"""Jitted functions of exploration on plain arrays: frontiers of the window and what a node has seen."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lemtomap.kernels.lines import first_on_line

F4 = NDArray[np.float32]
I4 = NDArray[np.int32]
U1 = NDArray[np.uint8]

FREE, UNKNOWN, LETHAL = 0, 1, 2  # as in lemtomap.nav.kernels.fields


@njit(nogil=True, cache=True)
def large_unknown(seen: U1, depth: int) -> U1:
    """Return 1 on the unseen ground that squares of 2 * depth + 1 unseen cells cover.

    Dark seams (along walls, between beams, behind a desk, where a forgotten picture does not quite fit) are
    too thin for that. They do not count for leading to a patch either: each leads out of doors by some gap.
    """
    height, width = seen.shape
    side = 2 * depth + 1
    dark = _sums(1 - seen)
    middles = np.zeros((height, width), dtype=np.uint8)
    for r in range(height - side + 1):
        for c in range(width - side + 1):
            if _sum_of(dark, r, c, r + side, c + side) == side * side:
                middles[r + depth, c + depth] = 1
    total = _sums(middles)
    large = np.zeros((height, width), dtype=np.uint8)
    for r in range(height):
        for c in range(width):
            r0, c0 = max(0, r - depth), max(0, c - depth)
            r1, c1 = min(height, r + depth + 1), min(width, c + depth + 1)
            large[r, c] = _sum_of(total, r0, c0, r1, c1) > 0
    return large


@njit(nogil=True, cache=True)
def _sums(marks: U1) -> I4:
    """Return int32 (rows + 1, cols + 1): the sum over all cells above and left of each corner."""
    height, width = marks.shape
    total = np.zeros((height + 1, width + 1), dtype=np.int32)
    for r in range(height):
        row = 0
        for c in range(width):
            row += marks[r, c]
            total[r + 1, c + 1] = total[r, c + 1] + row
    return total


@njit(nogil=True, cache=True)
def _sum_of(total: I4, r0: int, c0: int, r1: int, c1: int) -> int:
    """Return the sum over the rows from r0 to before r1 and the columns from c0 to before c1."""
    return int(total[r1, c1] - total[r0, c1] - total[r1, c0] + total[r0, c0])


@njit(nogil=True, cache=True)
def leading_on(
    state: U1, seen: U1, clearance: F4, large: U1, body: float, unseen_steps: int, known_steps: int
) -> U1:
    """Return 1 on the ground, hidden now, from which a body gets to a large unseen patch.

    body: its radius, cells. At most so many steps from cell to cell lead over ground that was never seen, and
    so many more, at the end that is nearer to the floor, over ground that is only remembered: that is drawn
    too large, and its walls are forgotten.
    """
    height, width = state.shape
    out = np.zeros((height, width), dtype=np.uint8)
    queue = np.empty(height * width, dtype=np.int32)
    count = 0
    for r in range(height):
        for c in range(width):
            if large[r, c] and clearance[r, c] >= body:
                out[r, c] = 1
                queue[count] = r * width + c
                count += 1
    begin = 0
    for step in range(unseen_steps + known_steps):
        if step == unseen_steps:
            begin = 0
        end = count
        for k in range(begin, end):
            r, c = queue[k] // width, queue[k] % width
            for dr, dc in ((-1, 0), (1, 0), (0, -1), (0, 1)):
                rr, cc = r + dr, c + dc
                if rr < 0 or cc < 0 or rr >= height or cc >= width or out[rr, cc]:
                    continue
                hidden = state[rr, cc] == UNKNOWN and (step >= unseen_steps or seen[rr, cc] == 0)
                if hidden and clearance[rr, cc] >= body:
                    out[rr, cc] = 1
                    queue[count] = rr * width + cc
                    count += 1
        begin = end
    return out


@njit(nogil=True, cache=True)
def frontier_cells(reach: U1, state: U1, leads: U1) -> U1:
    """Return 1 where the robot can stand on known floor beside unseen ground that leads on."""
    height, width = reach.shape
    out = np.zeros((height, width), dtype=np.uint8)
    for r in range(1, height - 1):
        for c in range(1, width - 1):
            if reach[r, c] != 1:
                continue
            for dr, dc in ((-1, 0), (1, 0), (0, -1), (0, 1)):
                if state[r + dr, c + dc] == UNKNOWN and leads[r + dr, c + dc]:
                    out[r, c] = 1
    return out


@njit(nogil=True, cache=True)
def fits_between(
    cost: F4, state: U1, row0: float, col0: float, row1: float, col1: float, ends: float
) -> bool:
    """Return True if the body fits all along a straight line over known floor.

    Within `ends` (cells) of either end the floor need only be known: both may stand close to a wall.
    """
    height, width = state.shape
    length = max(abs(row1 - row0), abs(col1 - col0))
    steps = int(2.0 * length) + 1
    for k in range(steps + 1):
        r, c = int(row0 + (row1 - row0) * k / steps), int(col0 + (col1 - col0) * k / steps)
        if r < 0 or c < 0 or r >= height or c >= width or state[r, c] != FREE:
            return False
        from_end = length * min(k, steps - k) / steps
        if from_end > ends and not np.isfinite(cost[r, c]):
            return False
    return True


@njit(nogil=True, cache=True)
def dark_in_sight(state: U1, large: U1, row: float, col: float, radius: float) -> bool:
    """Return True if a large unseen patch lies within radius (cells) of a place, not behind an obstacle.

    The place is moved to the nearest free cell within the radius; without one nothing can be told: True.
    """
    height, width = state.shape
    r0, r1 = max(0, int(row - radius)), min(height, int(row + radius) + 2)
    c0, c1 = max(0, int(col - radius)), min(width, int(col + radius) + 2)
    here_r, here_c, away = -1, -1, radius * radius
    for r in range(r0, r1):
        for c in range(c0, c1):
            d2 = (r + 0.5 - row) ** 2 + (c + 0.5 - col) ** 2
            if state[r, c] == FREE and d2 <= away:
                here_r, here_c, away = r, c, d2
    if here_r < 0:
        return True
    for r in range(r0, r1):
        for c in range(c0, c1):
            if not large[r, c] or (r - here_r) ** 2 + (c - here_c) ** 2 > radius * radius:
                continue
            line = (here_r + 0.5, here_c + 0.5, r + 0.5, c + 0.5)
            if np.isinf(first_on_line(state, *line, LETHAL, UNKNOWN)):
                return True
    return False


@njit(nogil=True, cache=True)
def barely_shown(state: U1, large: U1, row: float, col: float, radius: float) -> bool:
    """Return True if of the ground in sight within radius (cells) of a place less is shown than hidden.

    Large unseen patches count as neither, but one must be in sight.
    """
    height, width = state.shape
    dark, shown, hidden = False, 0, 0
    for r in range(max(0, int(row - radius)), min(height, int(row + radius) + 2)):
        for c in range(max(0, int(col - radius)), min(width, int(col + radius) + 2)):
            if (r + 0.5 - row) ** 2 + (c + 0.5 - col) ** 2 > radius * radius:
                continue
            if np.isfinite(first_on_line(state, row, col, r + 0.5, c + 0.5, LETHAL, UNKNOWN)):
                continue
            if large[r, c]:
                dark = True
            elif state[r, c] == UNKNOWN:
                hidden += 1
            else:
                shown += 1
    return dark and hidden > shown


@njit(nogil=True, cache=True)
def label_clusters(mask: U1, label: I4, reach_cells: int) -> int:
    """Number the clusters of marked cells from 1; cells up to reach_cells apart belong together."""
    height, width = mask.shape
    queue = np.empty(height * width, dtype=np.int32)
    count = 0
    for start in range(height * width):
        if mask[start // width, start % width] == 0 or label[start // width, start % width] != 0:
            continue
        count += 1
        label[start // width, start % width] = count
        queue[0] = start
        head, tail = 0, 1
        while head < tail:
            r, c = queue[head] // width, queue[head] % width
            head += 1
            for rr in range(max(0, r - reach_cells), min(height, r + reach_cells + 1)):
                for cc in range(max(0, c - reach_cells), min(width, c + reach_cells + 1)):
                    if mask[rr, cc] and label[rr, cc] == 0:
                        label[rr, cc] = count
                        queue[tail] = rr * width + cc
                        tail += 1
    return count


@njit(nogil=True, cache=True)
def remember(state: U1, row: float, col: float, yaw: float, cell: float, bits: U1) -> None:
    """Set the bits of a node's picture (node at its middle, turned by yaw) whose ground is known all over."""
    height, width = state.shape
    side = bits.shape[0]
    cos, sin = np.cos(yaw), np.sin(yaw)
    for i in range(side):
        for j in range(side):
            if bits[i, j]:
                continue
            known = True
            for k in range(5):
                y = (i + 0.5 - 0.5 * side + (0.35 if k == 1 else -0.35 if k == 2 else 0.0)) * cell
                x = (j + 0.5 - 0.5 * side + (0.35 if k == 3 else -0.35 if k == 4 else 0.0)) * cell
                r = int(np.floor(row + sin * x + cos * y))
                c = int(np.floor(col + cos * x - sin * y))
                if r < 0 or c < 0 or r >= height or c >= width or state[r, c] == UNKNOWN:
                    known = False
                    break
            if known:
                bits[i, j] = 1


@njit(nogil=True, cache=True)
def recall(seen: U1, row: float, col: float, yaw: float, cell: float, bits: U1, stamp: float) -> None:
    """Set seen around each cell of a node's picture, in squares `stamp` cells wide."""
    height, width = seen.shape
    side = bits.shape[0]
    cos, sin = np.cos(yaw), np.sin(yaw)
    half = 0.5 * stamp
    for i in range(side):
        for j in range(side):
            if bits[i, j] == 0:
                continue
            y, x = (i + 0.5 - 0.5 * side) * cell, (j + 0.5 - 0.5 * side) * cell
            r, c = row + sin * x + cos * y, col + cos * x - sin * y
            for rr in range(max(0, int(r - half)), min(height, int(r + half) + 1)):
                for cc in range(max(0, int(c - half)), min(width, int(c + half) + 1)):
                    seen[rr, cc] = 1
