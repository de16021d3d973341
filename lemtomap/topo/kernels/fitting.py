"""Flat loops of fitting places finely: nearest points, point-to-line alignment, tallies."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Scores = NDArray[np.int16]
Values = NDArray[np.float64]
Blocks = NDArray[np.int32]


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
def told_apart(
    points_m: Values,
    one_pose: Values,
    one_score: Scores,
    one_frame: Values,
    other_pose: Values,
    other_score: Scores,
    other_frame: Values,
) -> tuple[int, int]:
    """Count the points that only one of two pictures explains: (by the one, by the other).

    one_score, other_score: score fields; frames: float64 (3,), x and y of the field's corner and its cell, m.
    """
    own, alien = 0, 0
    for i in range(points_m.shape[0]):
        by_one = _explains(points_m[i, 0], points_m[i, 1], one_pose, one_score, one_frame)
        by_other = _explains(points_m[i, 0], points_m[i, 1], other_pose, other_score, other_frame)
        own += by_one and not by_other
        alien += by_other and not by_one
    return own, alien


@njit(nogil=True, cache=True)
def _explains(x_m: float, y_m: float, pose: Values, score: Scores, frame: Values) -> bool:
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    c = int(np.floor((cos * x_m - sin * y_m + pose[0] - frame[0]) / frame[2]))
    r = int(np.floor((sin * x_m + cos * y_m + pose[1] - frame[1]) / frame[2]))
    return bool(0 <= r < score.shape[0] and 0 <= c < score.shape[1] and score[r, c] > 0)


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
