"""Jitted functions of exploration on plain arrays: frontiers of the window and what a node has seen."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

F8 = NDArray[np.float64]
I4 = NDArray[np.int32]
U1 = NDArray[np.uint8]

UNKNOWN, LETHAL = 1, 2


@njit(nogil=True, cache=True)
def large_unknown(state: U1, least: int) -> U1:
    """Return 1 where a cell belongs to a 4-connected unknown patch of at least that many cells."""
    height, width = state.shape
    large = np.zeros((height, width), dtype=np.uint8)
    seen = np.zeros((height, width), dtype=np.uint8)
    queue = np.empty(height * width, dtype=np.int32)
    for start in range(height * width):
        if state[start // width, start % width] != UNKNOWN or seen[start // width, start % width]:
            continue
        queue[0] = start
        seen[start // width, start % width] = 1
        head, tail = 0, 1
        while head < tail:
            r, c = queue[head] // width, queue[head] % width
            head += 1
            for k in range(4):
                rr = r + (1 if k == 0 else -1 if k == 1 else 0)
                cc = c + (1 if k == 2 else -1 if k == 3 else 0)
                if rr < 0 or cc < 0 or rr >= height or cc >= width:
                    continue
                if state[rr, cc] == UNKNOWN and seen[rr, cc] == 0:
                    seen[rr, cc] = 1
                    queue[tail] = rr * width + cc
                    tail += 1
        if tail >= least:
            for i in range(tail):
                large[queue[i] // width, queue[i] % width] = 1
    return large


@njit(nogil=True, cache=True)
def frontier_cells(reach: U1, large: U1) -> U1:
    """Return 1 where the robot can stand on seen floor beside a large unknown patch."""
    height, width = reach.shape
    out = np.zeros((height, width), dtype=np.uint8)
    for r in range(1, height - 1):
        for c in range(1, width - 1):
            if reach[r, c] == 1 and (
                large[r - 1, c] or large[r + 1, c] or large[r, c - 1] or large[r, c + 1]
            ):
                out[r, c] = 1
    return out


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
def sight_lengths(state: U1, row: float, col: float, yaw: float, lengths: F8) -> None:
    """Raise each direction's length (cells) to how far seen floor goes from (row, col), from yaw on."""
    height, width = state.shape
    n = lengths.size
    for i in range(n):
        angle = yaw + 2.0 * np.pi * i / n
        dr, dc = np.sin(angle), np.cos(angle)
        k = 0.0
        while True:
            r, c = int(np.floor(row + dr * k)), int(np.floor(col + dc * k))
            if r < 0 or c < 0 or r >= height or c >= width or state[r, c] != 0:
                break
            k += 0.5
        lengths[i] = max(lengths[i], k)
