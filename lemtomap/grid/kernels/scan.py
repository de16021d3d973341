"""Kernels of the scan: ranges in, points in base out. Plain arrays, no classes."""

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[Any]

NEIGHBOURS = 64  # beams to either side in which an arm is looked for: a wall a hand away needs so many
LEAST_ARM_M, MOST_ARM_M = 0.1, 2.0
MOST_ARM_RATIO = 3.0  # a jump in depth makes one arm far longer than the other
MOST_OFF_M = 0.03  # from the line through its neighbours


@njit(nogil=True, cache=True)
def prepare_scan(
    ranges: Array,
    directions: Array,
    T_base_laser: Array,
    T_base_beams: Array,
    limits: tuple[float, float, float],
    hits: Array,
    cuts: Array,
) -> tuple[int, int]:
    """Turn beams into points in base at the first beam's time; return (number of hits, number of cuts).

    T_base_beams: float64 (N, 3), where the base was at each beam, or (0, 3) when it did not move.
    limits: least range, usable range, and how far a beam that met nothing (+inf) proves free space; a beam
    that goes beyond the usable range is cut there.
    directions, hits, cuts: (N, 2).
    """
    cos_l, sin_l = math.cos(T_base_laser[2]), math.sin(T_base_laser[2])
    skewed = T_base_beams.shape[0] > 0
    hit_count = cut_count = 0
    for i in range(ranges.shape[0]):
        r = ranges[i]
        if math.isnan(r) or r < limits[0]:
            continue
        is_hit = r < limits[1]
        if not is_hit:
            r = min(limits[1], limits[2]) if math.isinf(r) else limits[1]
        lx, ly = r * directions[i, 0], r * directions[i, 1]
        x = T_base_laser[0] + cos_l * lx - sin_l * ly
        y = T_base_laser[1] + sin_l * lx + cos_l * ly
        if skewed:
            c, s = math.cos(T_base_beams[i, 2]), math.sin(T_base_beams[i, 2])
            x, y = T_base_beams[i, 0] + c * x - s * y, T_base_beams[i, 1] + s * x + c * y
        if is_hit:
            hits[hit_count, 0], hits[hit_count, 1] = x, y
            hit_count += 1
        else:
            cuts[cut_count, 0], cuts[cut_count, 1] = x, y
            cut_count += 1
    return hit_count, cut_count


@njit(nogil=True, cache=True)
def surface_normals(hits: Array, normals: Array) -> None:
    """Write the direction (0..pi, base) across the surface at each hit, NaN where its neighbours do not lie
    on one line with it at like distances.
    """
    count = hits.shape[0]
    for i in range(count):
        normals[i] = math.nan
        x, y = hits[i, 0], hits[i, 1]
        left = right = -1.0
        lx = ly = rx = ry = 0.0
        for j in range(i - 1, max(i - NEIGHBOURS, 0) - 1, -1):
            lx, ly = hits[j, 0] - x, hits[j, 1] - y
            left = math.hypot(lx, ly)
            if left >= LEAST_ARM_M:
                break
        for j in range(i + 1, min(i + NEIGHBOURS, count - 1) + 1):
            rx, ry = hits[j, 0] - x, hits[j, 1] - y
            right = math.hypot(rx, ry)
            if right >= LEAST_ARM_M:
                break
        if min(left, right) < LEAST_ARM_M or max(left, right) > MOST_ARM_RATIO * min(left, right):
            continue
        along_x, along_y = rx - lx, ry - ly
        chord = math.hypot(along_x, along_y)
        if max(left, right) > MOST_ARM_M or chord <= max(left, right):
            continue
        if abs(lx * ry - ly * rx) > MOST_OFF_M * chord:
            continue
        normals[i] = (math.atan2(along_y, along_x) + 0.5 * math.pi) % math.pi


@njit(nogil=True, cache=True)
def in_front(hits: Array, gap: float, compact: float) -> Array:
    """Return bool (N,): which hits, (N, 2) in the order of their beams, belong to things of at most `compact`
    from end to end in front of what is seen on both sides of them.

    gap: between neighbouring hits, at which one thing ends and another begins.
    """
    count = hits.shape[0]
    front = np.zeros(count, np.bool_)
    first = 0
    for i in range(1, count + 1):
        if i < count and math.hypot(hits[i, 0] - hits[i - 1, 0], hits[i, 1] - hits[i - 1, 1]) <= gap:
            continue
        last = i - 1
        if first > 0 and i < count:
            extent = math.hypot(hits[last, 0] - hits[first, 0], hits[last, 1] - hits[first, 1])
            front[first:i] = (
                extent <= compact
                and math.hypot(hits[first - 1, 0], hits[first - 1, 1])
                > math.hypot(hits[first, 0], hits[first, 1])
                and math.hypot(hits[i, 0], hits[i, 1]) > math.hypot(hits[last, 0], hits[last, 1])
            )
        first = i
    return front


@njit(nogil=True, cache=True)
def outside(points: Array, pose: Array, origin: Array, n: int, resolution: float) -> bool:
    """Return True if the robot or a point falls outside the window."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for i in range(points.shape[0]):
        x = pose[0] + c * points[i, 0] - s * points[i, 1]
        y = pose[1] + s * points[i, 0] + c * points[i, 1]
        col = math.floor(x / resolution) - origin[0]
        row = math.floor(y / resolution) - origin[1]
        if col < 0 or row < 0 or col >= n or row >= n:
            return True
    col = math.floor(pose[0] / resolution) - origin[0]
    row = math.floor(pose[1] / resolution) - origin[1]
    return bool(col < 0 or row < 0 or col >= n or row >= n)
