"""Kernels of the scan match: points in base against the averaged hit points of one window. Plain arrays,
no classes.

Point to line, robust, Gauss-Newton with the odometry prior; before it a hill climb where the guess is poor.
Arrays as in lemtomap.grid.kernels.window.
"""

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lemtomap.grid.kernels.planes import is_other_face
from lemtomap.grid.kernels.searching import climb, sweep

Array = NDArray[Any]
Pair = tuple[float, float]

NONE = 255
WHOLE = 65535.0
LIFTS = 254.0
CORRELATED = 4.0  # beams err together: so many count as one
VAGUE = 100.0  # times a beam's variance: a scan that says next to nothing


@njit(nogil=True, cache=True)
def _linearise(
    points: Array,
    normals_rad: Array,
    laser: Array,
    pose: Array,
    window: Any,
    tables: Any,
    rules: Any,
    sigma: float,
    H: Array,
    b: Array,
) -> float:
    """Sum the normal equations of the match at pose; return the weight of matched points.

    b (4,): the right-hand side, and the variance of one point.
    """
    mean, nearest, normal, origin = window.mean, window.nearest, window.normal, window.origin
    whence = window.whence
    offsets, normals = tables.offsets, tables.normals
    resolution, point_weight = rules.resolution_m, rules.point_weight
    n = nearest.shape[0]
    H[:] = 0.0
    b[:] = 0.0
    c, s = math.cos(pose[2]), math.sin(pose[2])
    laser_x, laser_y = c * laser[0] - s * laser[1], s * laser[0] + c * laser[1]
    total = 0.0
    corner_x, corner_y = origin[0] * resolution, origin[1] * resolution
    ring_x, ring_y = origin[0] % n, origin[1] % n
    base_x, base_y = pose[0] - corner_x, pose[1] - corner_y
    per_metre, per_whole, per_lift = 1.0 / resolution, resolution / WHOLE, resolution / LIFTS
    scale = -0.5 / (sigma * sigma)
    hxx = hxy = hyy = hxt = hyt = htt = bx = by = bt = bend = pull = 0.0
    per_square = 1.0 / (sigma * sigma)
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
        ex = (col + dx) * resolution + mean[at_row, at_col, 0] * per_whole - x
        ey = (row + dy) * resolution + mean[at_row, at_col, 1] * per_whole - y
        k = normal[at_row, at_col]
        w = math.exp(scale * (ex * ex + ey * ey))
        if k != NONE:
            nx, ny = normals[k, 0], normals[k, 1]
            if is_other_face(nx, ny, whence[at_row, at_col], laser_x - rx, laser_y - ry):
                continue
            off = window.lift[at_row, at_col] * per_lift
            ex += off * nx
            ey += off * ny
            wxx, wxy, wyy = w * nx * nx, w * nx * ny, w * ny * ny
            square = (nx * ex + ny * ey) ** 2
        elif not math.isnan(normals_rad[i]):
            nx, ny = math.cos(normals_rad[i] + pose[2]), math.sin(normals_rad[i] + pose[2])
            if is_other_face(nx, ny, whence[at_row, at_col], laser_x - rx, laser_y - ry):
                continue
            wxx, wxy, wyy = w * nx * nx, w * nx * ny, w * ny * ny
            square = (nx * ex + ny * ey) ** 2
        else:
            wxx = wyy = point_weight * w
            wxy = 0.0
            square = 0.5 * (ex * ex + ey * ey)
        total += w
        bend += w * (1.0 - square * per_square)
        pull += w * w * square
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
    b[3] = variance(total, bend, pull, rules.noise_m)
    return total


@njit(nogil=True, cache=True)
def variance(total: float, bend: float, pull: float, noise_m: float) -> float:
    """Return the variance, m^2, that makes the information of a match honest: of a robust estimate it is the
    squared pull of all points over the square of their slope (Huber 1981). total: sum of weights.

    Where the window explains what is seen, that is the noise of a beam. Before a hedge most points lie on the
    far side of the robust weight, where the slope fades and then turns: little is left of what they say.
    """
    least, most = noise_m * noise_m, VAGUE * noise_m * noise_m
    if bend <= 0.0:
        return most
    return min(max(CORRELATED * pull * total / (bend * bend), least), most)


@njit(nogil=True, cache=True)
def _gate(H: Array, b: Array, gate: float) -> float:
    """Drop what the match says along the weak axis of the surfaces, part of it up to twice the gate.

    Returns the diversity 0..1.
    """
    nxx, nxy, nyy = H[0, 0], H[0, 1], H[1, 1]  # the spread of surface directions
    middle = 0.5 * (nxx + nyy)
    half = 0.5 * (nxx - nyy)
    root = math.sqrt(half * half + nxy * nxy)
    if middle <= 0.0:
        return 0.0
    diversity = (middle - root) / middle
    if diversity < 2.0 * gate:
        kept = max(diversity / gate - 1.0, 0.0)
        drop, drop_b = 1.0 - math.sqrt(kept), 1.0 - kept
        weak = 0.5 * math.atan2(nxy, half) + 0.5 * math.pi
        ux, uy = math.cos(weak), math.sin(weak)
        pxx, pxy, pyy = 1.0 - drop * ux * ux, -drop * ux * uy, 1.0 - drop * uy * uy
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
        along = drop_b * (ux * b0 + uy * b1)
        b[0], b[1] = b0 - along * ux, b1 - along * uy
    return float(diversity)


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
def _refine(
    points: Array,
    normals_rad: Array,
    laser: Array,
    pose: Array,
    prior: Array,
    prior_info: Pair,
    window: Any,
    tables: Any,
    rules: Any,
    H: Array,
) -> tuple[float, float]:
    """Gauss-Newton from pose (changed in place); H gets the match's own information; return (quality,
    diversity).
    """
    b = np.empty(4)
    A = np.empty((3, 3))
    g = np.empty(3)
    step = np.empty(3)
    sigma = rules.sigma_m
    width = 2.0 * sigma
    for _ in range(rules.newton_rounds):
        total = _linearise(points, normals_rad, laser, pose, window, tables, rules, width, H, b)
        per_variance = 1.0 / b[3]
        _gate(H, b, rules.degenerate_below)
        dx, dy = prior[0] - pose[0], prior[1] - pose[1]
        dt = (prior[2] - pose[2] + math.pi) % (2.0 * math.pi) - math.pi
        for i in range(3):
            g[i] = b[i] * per_variance
            for j in range(3):
                A[i, j] = H[i, j] * per_variance
        g[0] += prior_info[0] * dx
        g[1] += prior_info[0] * dy
        g[2] += prior_info[1] * dt
        A[0, 0] += prior_info[0]
        A[1, 1] += prior_info[0]
        A[2, 2] += prior_info[1]
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
    total = _linearise(points, normals_rad, laser, pose, window, tables, rules, sigma, H, b)
    per_variance = 1.0 / b[3]
    diversity = _gate(H, b, rules.degenerate_below)
    for i in range(3):
        for j in range(3):
            H[i, j] *= per_variance
    return total / points.shape[0], diversity


@njit(nogil=True, cache=True)
def match(
    points: Array,
    normals_rad: Array,
    laser: Array,
    prior: Array,
    prior_info: Pair,
    window: Any,
    tables: Any,
    rules: Any,
    reach_rad: float,
    reach_m: float,
    out: Array,
) -> None:
    """Match points (N, 2) of base against a window.

    prior (3,) T_grid_base; prior_info: its information along x and y (1/m^2) and in yaw (1/rad^2). reach > 0
    asks for a search that wide before the climb. out (23,): pose, the match's own information (9), covariance
    with the prior (9), quality, diversity.
    """
    pose, H, covariance = out[0:3], out[3:12].reshape(3, 3), out[12:21].reshape(3, 3)
    pose[:] = prior
    quality, diversity = _refine(
        points, normals_rad, laser, pose, prior, prior_info, window, tables, rules, H
    )
    if quality < rules.climb_below or reach_rad > 0.0:
        rival = prior.copy()
        rival_H = np.empty((3, 3))
        if reach_rad > 0.0:
            sweep(points, rival, prior, prior_info, window, tables, rules, reach_rad, reach_m)
        climb(points, rival, prior, prior_info, window, tables, rules)
        rival_quality, rival_diversity = _refine(
            points, normals_rad, laser, rival, prior, prior_info, window, tables, rules, rival_H
        )
        if rival_quality > quality:
            pose[:] = rival
            H[:] = rival_H
            quality, diversity = rival_quality, rival_diversity
    A = H.copy()
    A[0, 0] += prior_info[0]
    A[1, 1] += prior_info[0]
    A[2, 2] += prior_info[1]
    invert(A, covariance)
    out[21], out[22] = quality, diversity


@njit(nogil=True, cache=True)
def invert(A: Array, out: Array) -> None:
    """Write the inverse of a symmetric positive definite 3 x 3 matrix."""
    unit = np.zeros(3)
    for i in range(3):
        unit[:] = 0.0
        unit[i] = 1.0
        _solve(A, unit, out[i])


@njit(nogil=True, cache=True)
def drift(step: Array, yaw: float, information: Array, rates: Array, out: Array) -> None:
    """Write the covariance (3, 3) of one step, axes of the base before it.

    information (3, 3) of the latest match, grid axes; yaw of that base in grid. rates (6,): metres of travel
    and radians of turn after which the window is new ground; odometry's variance in place per metre and per
    radian, and in yaw per metre and per radian.
    """
    way, turn = math.hypot(step[0], step[1]), abs(step[2])
    A = np.zeros((3, 3))
    renewed = max(way / rates[0] + turn / rates[1], 1e-9)
    c, s = math.cos(yaw), math.sin(yaw)
    for i in range(3):
        for j in range(3):
            A[i, j] = information[i, j] / renewed
    ax = c * A[0, 0] + s * A[1, 0], c * A[0, 1] + s * A[1, 1]
    ay = c * A[1, 0] - s * A[0, 0], c * A[1, 1] - s * A[0, 1]
    tx, ty = A[0, 2], A[1, 2]
    A[0, 0], A[0, 1] = ax[0] * c + ax[1] * s, ax[1] * c - ax[0] * s
    A[1, 0], A[1, 1] = A[0, 1], ay[1] * c - ay[0] * s
    A[0, 2], A[1, 2] = c * tx + s * ty, c * ty - s * tx
    A[2, 0], A[2, 1] = A[0, 2], A[1, 2]
    place = 1.0 / max(rates[2] * way + rates[3] * turn, 1e-12)
    A[0, 0] += place
    A[1, 1] += place
    A[2, 2] += 1.0 / max(rates[4] * way + rates[5] * turn, 1e-12)
    invert(A, out)
