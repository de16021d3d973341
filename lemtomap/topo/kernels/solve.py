"""Jitted least squares over poses in the plane: residuals, analytic Jacobians, envelope Cholesky.

Residual of an edge with measurement r between poses i and j: log(r^-1 * (i^-1 * j)), in the axes of j, as
gtsam has it (for small yaw the same as g2o's). A doubted edge is scaled by dynamic covariance scaling
(Agarwal et al. 2013).
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Values = NDArray[np.float64]
Indices = NDArray[np.int64]


@njit(nogil=True, cache=True)
def half_cot(turn: float) -> tuple[float, float]:
    """Return (turn / 2) * cot(turn / 2) and its derivative."""
    if abs(turn) < 1e-3:
        return 1.0 - turn * turn / 12.0, -turn / 6.0
    sin, cos = math.sin(0.5 * turn), math.cos(0.5 * turn)
    return 0.5 * turn * cos / sin, 0.5 * cos / sin - 0.25 * turn / (sin * sin)


@njit(nogil=True, cache=True)
def residual(a: Values, b: Values, r: Values, out: Values) -> None:
    """Put log(r^-1 * (a^-1 * b)) into out (3,)."""
    ca, sa, cr, sr = math.cos(a[2]), math.sin(a[2]), math.cos(r[2]), math.sin(r[2])
    dx, dy = b[0] - a[0], b[1] - a[1]
    x, y = ca * dx + sa * dy - r[0], -sa * dx + ca * dy - r[1]
    turn = b[2] - a[2] - r[2]
    turn -= 2.0 * math.pi * math.floor((turn + math.pi) / (2.0 * math.pi))
    along, _ = half_cot(turn)
    x, y = cr * x + sr * y, -sr * x + cr * y
    out[0] = along * x + 0.5 * turn * y
    out[1] = -0.5 * turn * x + along * y
    out[2] = turn


@njit(nogil=True, cache=True)
def squared(e: Values, information: Values) -> float:
    """Return e' * information * e."""
    total = 0.0
    for p in range(3):
        for q in range(3):
            total += e[p] * information[p, q] * e[q]
    return total


@njit(nogil=True, cache=True)
def robust_cost(chi2: float, phi: float) -> float:
    """Return the cost of one edge: chi2 below phi, bounded by 3 * phi above (the kernel of the scaling)."""
    if phi <= 0.0 or chi2 <= phi:
        return chi2
    return phi * (3.0 * chi2 - phi) / (chi2 + phi)


@njit(nogil=True, cache=True)
def costs(poses: Values, ends: Indices, measured: Values, information: Values, phi: Values) -> Values:
    """Return the robust cost of each edge, float64 (M,)."""
    out = np.empty(ends.shape[0])
    e = np.empty(3)
    for k in range(ends.shape[0]):
        residual(poses[ends[k, 0]], poses[ends[k, 1]], measured[k], e)
        out[k] = robust_cost(squared(e, information[k]), phi[k])
    return out


@njit(nogil=True, cache=True)
def linearise(
    poses: Values, ends: Indices, measured: Values, information: Values, phi: Values
) -> tuple[Values, Values, Values]:
    """Return normal equations by blocks: diagonal (N, 3, 3), per edge i-j (M, 3, 3), gradient (N, 3)."""
    diagonal = np.zeros((poses.shape[0], 3, 3))
    across = np.zeros((ends.shape[0], 3, 3))
    gradient = np.zeros((poses.shape[0], 3))
    e = np.empty(3)
    A, B, wA, wB = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3))
    for k in range(ends.shape[0]):
        i, j = ends[k, 0], ends[k, 1]
        residual(poses[i], poses[j], measured[k], e)
        chi2 = squared(e, information[k])
        weight = 1.0
        if phi[k] > 0.0 and chi2 > phi[k]:
            weight = (2.0 * phi[k] / (phi[k] + chi2)) ** 2
        turn = poses[i, 2] + measured[k, 2]
        c, s = math.cos(turn), math.sin(turn)
        dx, dy = poses[j, 0] - poses[i, 0], poses[j, 1] - poses[i, 1]
        along, slope = half_cot(e[2])
        half = 0.5 * e[2]
        # e = L t with L = [[along, half], [-half, along]]; t rotates by -turn what lies between i and j
        B[0, 0], B[0, 1] = along * c - half * s, along * s + half * c
        B[1, 0], B[1, 1] = -half * c - along * s, -half * s + along * c
        scale = 1.0 / (along * along + half * half)
        tx, ty = scale * (along * e[0] - half * e[1]), scale * (half * e[0] + along * e[1])
        B[0, 2], B[1, 2], B[2, 2] = slope * tx + 0.5 * ty, -0.5 * tx + slope * ty, 1.0
        ux, uy = -s * dx + c * dy, -c * dx - s * dy
        for p in range(2):
            A[p, 0], A[p, 1] = -B[p, 0], -B[p, 1]
        A[0, 2], A[1, 2] = along * ux + half * uy - B[0, 2], -half * ux + along * uy - B[1, 2]
        A[2, 2] = -1.0
        for p in range(3):
            for q in range(3):
                total_a, total_b = 0.0, 0.0
                for m in range(3):
                    total_a += information[k, p, m] * A[m, q]
                    total_b += information[k, p, m] * B[m, q]
                wA[p, q] = weight * total_a
                wB[p, q] = weight * total_b
        for p in range(3):
            for q in range(3):
                aa, bb, ab = 0.0, 0.0, 0.0
                for m in range(3):
                    aa += A[m, p] * wA[m, q]
                    bb += B[m, p] * wB[m, q]
                    ab += A[m, p] * wB[m, q]
                diagonal[i, p, q] += aa
                diagonal[j, p, q] += bb
                across[k, p, q] = ab
            ga, gb = 0.0, 0.0
            for m in range(3):
                ga += wA[m, p] * e[m]
                gb += wB[m, p] * e[m]
            gradient[i, p] += ga
            gradient[j, p] += gb
    return diagonal, across, gradient


@njit(nogil=True, cache=True)
def envelope(ends: Indices, slot: Indices, unknowns: int) -> Indices:
    """Return for each unknown node the first unknown node its row of the normal matrix reaches back to."""
    first = np.arange(unknowns)
    for k in range(ends.shape[0]):
        a, b = slot[ends[k, 0]], slot[ends[k, 1]]
        if a < 0 or b < 0:
            continue
        low, high = min(a, b), max(a, b)
        first[high] = min(first[high], low)
    return first


@njit(nogil=True, cache=True)
def solve_envelope(
    diagonal: Values,
    across: Values,
    gradient: Values,
    ends: Indices,
    slot: Indices,
    first: Indices,
    damping: float,
) -> tuple[bool, Values]:
    """Return (positive definite, step (N, 3)) of (H + damping * diag H) step = -gradient.

    `slot` gives each node's place among the unknowns, -1 for a fixed node. Row-wise Cholesky inside the
    envelope of H (George and Liu 1981); cheap because nodes come nearest first.
    """
    unknowns = first.shape[0]
    size = 3 * unknowns
    start = np.empty(size, np.int64)
    offset = np.empty(size + 1, np.int64)
    offset[0] = 0
    for row in range(size):
        start[row] = 3 * first[row // 3]
        offset[row + 1] = offset[row] + row - start[row] + 1
    low = np.zeros(offset[size])
    right = np.zeros(size)
    for node in range(slot.shape[0]):
        u = slot[node]
        if u < 0:
            continue
        for p in range(3):
            row = 3 * u + p
            right[row] = -gradient[node, p]
            for q in range(p + 1):
                value = diagonal[node, p, q]
                if p == q:
                    value += damping * value + 1e-12
                low[offset[row] + 3 * u + q - start[row]] += value
    for k in range(ends.shape[0]):
        a, b = slot[ends[k, 0]], slot[ends[k, 1]]
        if a < 0 or b < 0:
            continue
        for p in range(3):
            for q in range(3):
                row, col = 3 * a + p, 3 * b + q
                if row < col:
                    row, col = col, row
                low[offset[row] + col - start[row]] += across[k, p, q]
    for row in range(size):
        base = offset[row] - start[row]
        for col in range(start[row], row):
            other = offset[col] - start[col]
            total = low[base + col]
            for m in range(max(start[row], start[col]), col):
                total -= low[base + m] * low[other + m]
            low[base + col] = total / low[other + col]
        total = low[base + row]
        for m in range(start[row], row):
            total -= low[base + m] ** 2
        if total <= 0.0:
            return False, np.zeros((slot.shape[0], 3))
        low[base + row] = math.sqrt(total)
    for row in range(size):
        base = offset[row] - start[row]
        total = right[row]
        for m in range(start[row], row):
            total -= low[base + m] * right[m]
        right[row] = total / low[base + row]
    for row in range(size - 1, -1, -1):
        base = offset[row] - start[row]
        right[row] /= low[base + row]
        for m in range(start[row], row):
            right[m] -= low[base + m] * right[row]
    step = np.zeros((slot.shape[0], 3))
    for node in range(slot.shape[0]):
        if slot[node] >= 0:
            for p in range(3):
                step[node, p] = right[3 * slot[node] + p]
    return True, step
