"""Kernels of the scan match: points in base against the averaged hit points of one window. Plain arrays,
no classes.

Point to line, robust, Gauss-Newton with the odometry prior; before it a hill climb where the guess is poor.
Arrays as in lemtomap.grid.kernels.
"""

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[Any]

NONE = 255


@njit(nogil=True, cache=True)
def _linearise(
    points: Array, pose: Array, window: Any, tables: Any, rules: Any, sigma: float, H: Array, b: Array
) -> tuple[float, float, float, float]:
    """Sum the normal equations of the match at pose; return (weight of matched points, weighted surface
    spread).
    """
    mean, nearest, normal, origin = window.mean, window.nearest, window.normal, window.origin
    offsets, normals = tables.offsets, tables.normals
    resolution, point_share = rules.resolution_m, rules.point_share
    n = nearest.shape[0]
    H[:] = 0.0
    b[:] = 0.0
    c, s = math.cos(pose[2]), math.sin(pose[2])
    total = 0.0
    corner_x, corner_y = origin[0] * resolution, origin[1] * resolution
    ring_x, ring_y = origin[0] % n, origin[1] % n
    base_x, base_y = pose[0] - corner_x, pose[1] - corner_y
    per_metre = 1.0 / resolution
    scale = -0.5 / (sigma * sigma)
    hxx = hxy = hyy = hxt = hyt = htt = bx = by = bt = 0.0
    nxx = nxy = nyy = 0.0
    for i in range(points.shape[0]):
        rx = c * points[i, 0] - s * points[i, 1]
        ry = s * points[i, 0] + c * points[i, 1]
        x, y = base_x + rx, base_y + ry
        if x < 0.0 or y < 0.0:
            continue
        col, row = int(x * per_metre), int(y * per_metre)
        if col >= n or row >= n:
            continue
        at_col = col + ring_x
        if at_col >= n:
            at_col -= n
        at_row = row + ring_y
        if at_row >= n:
            at_row -= n
        o = nearest[at_row, at_col]
        if o == NONE:
            continue
        dx, dy = offsets[o, 0], offsets[o, 1]
        at_col += dx
        at_row += dy
        if at_col >= n:
            at_col -= n
        elif at_col < 0:
            at_col += n
        if at_row >= n:
            at_row -= n
        elif at_row < 0:
            at_row += n
        ex = (col + dx) * resolution + mean[at_row, at_col, 0] - x
        ey = (row + dy) * resolution + mean[at_row, at_col, 1] - y
        k = normal[at_row, at_col]
        w = math.exp(scale * (ex * ex + ey * ey))
        total += w
        if k != NONE:
            nx, ny = normals[k, 0], normals[k, 1]
            wxx = w * (nx * nx + point_share * ny * ny)
            wxy = w * (nx * ny - point_share * nx * ny)
            wyy = w * (ny * ny + point_share * nx * nx)
            nxx += w * nx * nx
            nxy += w * nx * ny
            nyy += w * ny * ny
        else:
            wxx = wyy = 0.5 * w
            wxy = 0.0
            nxx += 0.5 * w
            nyy += 0.5 * w
        jx, jy = -ry, rx
        gx, gy = wxx * ex + wxy * ey, wxy * ex + wyy * ey
        hxx += wxx
        hxy += wxy
        hyy += wyy
        hxt += wxx * jx + wxy * jy
        hyt += wxy * jx + wyy * jy
        htt += wxx * jx * jx + 2.0 * wxy * jx * jy + wyy * jy * jy
        bx += gx
        by += gy
        bt += jx * gx + jy * gy
    H[0, 0], H[0, 1], H[0, 2] = hxx, hxy, hxt
    H[1, 0], H[1, 1], H[1, 2] = hxy, hyy, hyt
    H[2, 0], H[2, 1], H[2, 2] = hxt, hyt, htt
    b[0], b[1], b[2] = bx, by, bt
    return total, nxx, nxy, nyy


@njit(nogil=True, cache=True)
def _gate(H: Array, b: Array, nxx: float, nxy: float, nyy: float, gate: float) -> float:
    """Drop what the match says along the weak axis of the surfaces; return the diversity 0..1."""
    middle = 0.5 * (nxx + nyy)
    half = 0.5 * (nxx - nyy)
    root = math.sqrt(half * half + nxy * nxy)
    if middle <= 0.0:
        return 0.0
    diversity = (middle - root) / middle
    if diversity < gate:
        weak = 0.5 * math.atan2(nxy, half) + 0.5 * math.pi
        ux, uy = math.cos(weak), math.sin(weak)
        pxx, pxy, pyy = 1.0 - ux * ux, -ux * uy, 1.0 - uy * uy
        h00 = pxx * H[0, 0] + pxy * H[1, 0]
        h01 = pxx * H[0, 1] + pxy * H[1, 1]
        h02 = pxx * H[0, 2] + pxy * H[1, 2]
        h10 = pxy * H[0, 0] + pyy * H[1, 0]
        h11 = pxy * H[0, 1] + pyy * H[1, 1]
        h12 = pxy * H[0, 2] + pyy * H[1, 2]
        H[0, 0] = h00 * pxx + h01 * pxy
        H[0, 1] = h00 * pxy + h01 * pyy
        H[1, 0] = H[0, 1]
        H[1, 1] = h10 * pxy + h11 * pyy
        H[0, 2], H[1, 2] = h02, h12
        H[2, 0], H[2, 1] = h02, h12
        b0, b1 = b[0], b[1]
        b[0], b[1] = pxx * b0 + pxy * b1, pxy * b0 + pyy * b1
    return diversity


@njit(nogil=True, cache=True)
def _solve(A: Array, b: Array, x: Array) -> bool:
    """Solve the symmetric positive definite 3 x 3 system A x = b; return False when it is singular."""
    l00 = A[0, 0]
    if l00 <= 0.0:
        return False
    l00 = math.sqrt(l00)
    l10, l20 = A[1, 0] / l00, A[2, 0] / l00
    l11 = A[1, 1] - l10 * l10
    if l11 <= 0.0:
        return False
    l11 = math.sqrt(l11)
    l21 = (A[2, 1] - l20 * l10) / l11
    l22 = A[2, 2] - l20 * l20 - l21 * l21
    if l22 <= 0.0:
        return False
    l22 = math.sqrt(l22)
    y0 = b[0] / l00
    y1 = (b[1] - l10 * y0) / l11
    y2 = (b[2] - l20 * y0 - l21 * y1) / l22
    x[2] = y2 / l22
    x[1] = (y1 - l21 * x[2]) / l11
    x[0] = (y0 - l10 * x[1] - l20 * x[2]) / l00
    return True


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
def _unlikelihood(x: float, y: float, yaw: float, prior: Array, prior_info: Array) -> float:
    """Return the squared Mahalanobis distance of a pose from the prior."""
    dx, dy = x - prior[0], y - prior[1]
    dt = (yaw - prior[2] + math.pi) % (2.0 * math.pi) - math.pi
    return float(
        prior_info[0, 0] * dx * dx
        + prior_info[1, 1] * dy * dy
        + prior_info[2, 2] * dt * dt
        + 2.0 * (prior_info[0, 1] * dx * dy + prior_info[0, 2] * dx * dt + prior_info[1, 2] * dy * dt)
    )


@njit(nogil=True, cache=True)
def _climb(
    points: Array, pose: Array, prior: Array, prior_info: Array, window: Any, tables: Any, rules: Any
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
def _sweep(
    points: Array,
    pose: Array,
    prior: Array,
    prior_info: Array,
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


@njit(nogil=True, cache=True)
def _refine(
    points: Array,
    pose: Array,
    prior: Array,
    prior_info: Array,
    window: Any,
    tables: Any,
    rules: Any,
    H: Array,
) -> tuple[float, float]:
    """Gauss-Newton from pose (changed in place); H gets the match's own information; return (quality,
    diversity).
    """
    b = np.empty(3)
    A = np.empty((3, 3))
    g = np.empty(3)
    step = np.empty(3)
    per_variance = 1.0 / (rules.noise_m * rules.noise_m)
    sigma = rules.sigma_m
    width = 2.0 * sigma
    for _ in range(rules.newton_rounds):
        total, nxx, nxy, nyy = _linearise(points, pose, window, tables, rules, width, H, b)
        _gate(H, b, nxx, nxy, nyy, rules.degenerate_below)
        dx, dy = prior[0] - pose[0], prior[1] - pose[1]
        dt = (prior[2] - pose[2] + math.pi) % (2.0 * math.pi) - math.pi
        for i in range(3):
            g[i] = b[i] * per_variance + prior_info[i, 0] * dx + prior_info[i, 1] * dy + prior_info[i, 2] * dt
            for j in range(3):
                A[i, j] = H[i, j] * per_variance + prior_info[i, j]
        if not _solve(A, g, step):
            break
        pose[0] += step[0]
        pose[1] += step[1]
        pose[2] += step[2]
        small = abs(step[0]) + abs(step[1]) < 3e-4 and abs(step[2]) < 2e-4
        if width > sigma:
            width = max(sigma, 0.5 * width)
        elif small:
            break
    total, nxx, nxy, nyy = _linearise(points, pose, window, tables, rules, sigma, H, b)
    diversity = _gate(H, b, nxx, nxy, nyy, rules.degenerate_below)
    for i in range(3):
        for j in range(3):
            H[i, j] *= per_variance
    return total / points.shape[0], diversity


@njit(nogil=True, cache=True)
def match(
    points: Array,
    prior: Array,
    prior_info: Array,
    window: Any,
    tables: Any,
    rules: Any,
    reach_rad: float,
    reach_m: float,
    out: Array,
) -> None:
    """Match points (N, 2) of base against a window.

    prior (3,) T_grid_base, prior_info (3, 3) its information. reach > 0 asks for a search that wide when
    the plain match is poor. out (14,): pose, the match's own information (9), quality, diversity.
    """
    pose, H = out[0:3], out[3:12].reshape(3, 3)
    pose[:] = prior
    quality, diversity = _refine(points, pose, prior, prior_info, window, tables, rules, H)
    if quality < rules.climb_below or reach_rad > 0.0:
        rival = prior.copy()
        rival_H = np.empty((3, 3))
        if reach_rad > 0.0:
            _sweep(points, rival, prior, prior_info, window, tables, rules, reach_rad, reach_m)
        _climb(points, rival, prior, prior_info, window, tables, rules)
        rival_quality, rival_diversity = _refine(
            points, rival, prior, prior_info, window, tables, rules, rival_H
        )
        if rival_quality > quality:
            pose[:] = rival
            H[:] = rival_H
            quality, diversity = rival_quality, rival_diversity
    out[12], out[13] = quality, diversity
