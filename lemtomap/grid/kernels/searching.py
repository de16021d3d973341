"""Kernels of the search before a match: how close hits come to occupied cells, and poses where they come
closer. Plain arrays, no classes.

Arrays as in lemtomap.grid.kernels.window.
"""

import math
from typing import Any

from numba import njit
from numpy.typing import NDArray

Array = NDArray[Any]
Pair = tuple[float, float]


@njit(nogil=True, cache=True)
def score(
    points: Array, stride: int, x0: float, y0: float, yaw: float, window: Any, tables: Any, resolution: float
) -> float:
    """Return the mean closeness (0..1) of every stride-th point to the window's occupied cells."""
    nearest, origin, closeness = window.nearest, window.origin, tables.closeness
    n = nearest.shape[0]
    c, s = math.cos(yaw), math.sin(yaw)
    base_x, base_y = x0 - origin[0] * resolution, y0 - origin[1] * resolution
    ring_x, ring_y = origin[0] % n, origin[1] % n
    per_metre = 1.0 / resolution
    total = 0.0
    count = 0
    for i in range(0, points.shape[0], stride):
        count += 1
        x = base_x + c * points[i, 0] - s * points[i, 1]
        y = base_y + s * points[i, 0] + c * points[i, 1]
        if x < 0.0 or y < 0.0:
            continue
        col, row = int(x * per_metre), int(y * per_metre)
        if col >= n or row >= n:
            continue
        col += ring_x
        if col >= n:
            col -= n
        row += ring_y
        if row >= n:
            row -= n
        total += closeness[nearest[row, col]]
    return total / count


@njit(nogil=True, cache=True)
def _unlikelihood(x: float, y: float, yaw: float, prior: Array, prior_info: Pair) -> float:
    """Return the squared Mahalanobis distance of a pose from the prior."""
    dx, dy = x - prior[0], y - prior[1]
    dt = (yaw - prior[2] + math.pi) % (2.0 * math.pi) - math.pi
    return float(prior_info[0] * (dx * dx + dy * dy) + prior_info[1] * dt * dt)


@njit(nogil=True, cache=True)
def climb(
    points: Array, pose: Array, prior: Array, prior_info: Pair, window: Any, tables: Any, rules: Any
) -> None:
    """Walk uphill from pose (changed in place) in ever smaller steps."""
    resolution, trust = rules.resolution_m, rules.climb_trust
    step_m, step_rad = rules.climb_step_m, rules.climb_step_rad
    best = score(points, 1, pose[0], pose[1], pose[2], window, tables, resolution)
    best -= trust * _unlikelihood(pose[0], pose[1], pose[2], prior, prior_info)
    halvings = 0
    while halvings < rules.climb_rounds:
        from_x, from_y, from_yaw = pose[0], pose[1], pose[2]
        better = False
        for move in range(6):
            x, y, yaw = from_x, from_y, from_yaw
            sign = 1.0 if move % 2 == 0 else -1.0
            if move < 2:
                x += sign * step_m
            elif move < 4:
                y += sign * step_m
            else:
                yaw += sign * step_rad
            value = score(points, 1, x, y, yaw, window, tables, resolution)
            value -= trust * _unlikelihood(x, y, yaw, prior, prior_info)
            if value > best:
                best = value
                pose[0], pose[1], pose[2] = x, y, yaw
                better = True
        if not better:
            step_m *= 0.5
            step_rad *= 0.5
            halvings += 1


@njit(nogil=True, cache=True)
def sweep(
    points: Array,
    pose: Array,
    prior: Array,
    prior_info: Pair,
    window: Any,
    tables: Any,
    rules: Any,
    reach_rad: float,
    reach_m: float,
) -> None:
    """Try headings and places all round the prior with every third point; leave the best in pose."""
    best = -1e30
    yaw_steps, steps = int(reach_rad / rules.sweep_step_rad), int(reach_m / rules.sweep_step_m)
    for k in range(-yaw_steps, yaw_steps + 1):
        yaw = prior[2] + k * rules.sweep_step_rad
        for j in range(-steps, steps + 1):
            y = prior[1] + j * rules.sweep_step_m
            for i in range(-steps, steps + 1):
                x = prior[0] + i * rules.sweep_step_m
                value = score(points, 3, x, y, yaw, window, tables, rules.resolution_m)
                value -= rules.climb_trust * _unlikelihood(x, y, yaw, prior, prior_info)
                if value > best:
                    best = value
                    pose[0], pose[1], pose[2] = x, y, yaw
