"""Covariances that go along with poses: the laws of se2, for the loops that cannot call it."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Values = NDArray[np.float64]


@njit(nogil=True, cache=True)
def drifted(drift: Values, before: Values, after: Values, step_covariance: Values) -> Values:
    """Return the covariance of the base relative to a node, axes of base, after one more step.

    `before` and `after` are T_grid_base; the step's covariance is in axes of the base before it. Same as
    turning that into axes of the base after it and adding the carried drift (graph.chain_covariance).
    """
    c0, s0 = math.cos(before[2]), math.sin(before[2])
    dx, dy = after[0] - before[0], after[1] - before[1]
    x, y = c0 * dx + s0 * dy, -s0 * dx + c0 * dy
    turn = after[2] - before[2]
    c, s = math.cos(turn), math.sin(turn)
    carry = np.array([[c, s, s * x - c * y], [-s, c, c * x + s * y], [0.0, 0.0, 1.0]])
    rotate = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    out = np.zeros((3, 3))
    for p in range(3):
        for q in range(3):
            total = 0.0
            for m in range(3):
                for n in range(3):
                    total += carry[p, m] * drift[m, n] * carry[q, n]
                    total += rotate[p, m] * step_covariance[m, n] * rotate[q, n]
            out[p, q] = total
    return out


@njit(nogil=True, cache=True)
def carried(
    pose: Values, covariance: Values, r: Values, spread: Values, backwards: int
) -> tuple[Values, Values]:
    """Return a pose and its covariance after going along an edge (r, spread), or backwards along it.

    Same as se2.compose, graph.Edge.seen_from and graph.chain_covariance; covariances in axes of their poses.
    """
    c, s = math.cos(r[2]), math.sin(r[2])
    x, y, turn = r[0], r[1], r[2]
    own = np.empty((3, 3))
    own[:, :] = spread
    if backwards:
        own = sandwiched(np.array([[c, -s, y], [s, c, -x], [0.0, 0.0, 1.0]]), spread)
        x, y, turn = -c * r[0] - s * r[1], s * r[0] - c * r[1], -r[2]
        s = -s
    cp, sp = math.cos(pose[2]), math.sin(pose[2])
    yaw = pose[2] + turn
    yaw -= 2.0 * math.pi * math.floor((yaw + math.pi) / (2.0 * math.pi))
    out = np.array([pose[0] + cp * x - sp * y, pose[1] + sp * x + cp * y, yaw])
    carry = np.array([[c, s, s * x - c * y], [-s, c, c * x + s * y], [0.0, 0.0, 1.0]])
    return out, sandwiched(carry, covariance) + own


@njit(nogil=True, cache=True)
def sandwiched(outer: Values, inner: Values) -> Values:
    """Return outer * inner * outer' of 3x3 matrices."""
    out = np.zeros((3, 3))
    for p in range(3):
        for q in range(3):
            for m in range(3):
                for n in range(3):
                    out[p, q] += outer[p, m] * inner[m, n] * outer[q, n]
    return out
