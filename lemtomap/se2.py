"""Poses in the plane, SE(2), as float64 arrays whose last axis is [x m, y m, yaw rad].

`T_a_b` is the pose of frame b in frame a; in a product the middle letters cancel:
`T_a_c = compose(T_a_b, T_b_c)` (thesis, section 3-2, equations 3-1 to 3-5). All functions broadcast
over leading axes and never change their arguments. Single poses take a path of their own, in plain numbers:
every scan multiplies some dozen, in a tenth of the time that arrays would take. The jitted loops of `kernels`
cannot call this module: what they do with poses stands in topo/kernels/poses.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Pose = NDArray[np.float64]
"""float64 (..., 3): x m, y m, yaw rad."""

IDENTITY: Pose = np.zeros(3)
IDENTITY.setflags(write=False)

Numbers = tuple[float, float, float]
"""One pose in plain numbers: x m, y m, yaw rad; products of several cost a third of what arrays do."""


def numbers(T_a_b: Pose) -> Numbers:
    """Return a single pose in plain numbers."""
    x, y, yaw = T_a_b.tolist()
    return x, y, yaw


def product(T_a_b: Numbers, T_b_c: Numbers) -> Numbers:
    """Return T_a_c of single poses, yaw in [-pi, pi); as compose."""
    (x, y, yaw), (u, v, turn) = T_a_b, T_b_c
    c, s = math.cos(yaw), math.sin(yaw)
    total = (yaw + turn + math.pi) % (2.0 * math.pi) - math.pi
    return x + c * u - s * v, y + s * u + c * v, total


def quotient(T_w_a: Numbers, T_w_b: Numbers) -> Numbers:
    """Return T_a_b of single poses in one frame; as between."""
    (x, y, yaw), (u, v, turn) = T_w_a, T_w_b
    c, s = math.cos(yaw), math.sin(yaw)
    total = (turn - yaw + math.pi) % (2.0 * math.pi) - math.pi
    return c * (u - x) + s * (v - y), -s * (u - x) + c * (v - y), total


def pose(x_m: float, y_m: float, yaw_rad: float) -> Pose:
    """Return one pose, float64 (3,)."""
    return np.array([x_m, y_m, yaw_rad], dtype=np.float64)


def wrap_angle(angle_rad: ArrayLike) -> NDArray[np.float64]:
    """Return the same angle in [-pi, pi)."""
    angle = np.asarray(angle_rad, dtype=np.float64)
    return np.asarray((angle + np.pi) % (2.0 * np.pi) - np.pi)


def compose(T_a_b: ArrayLike, T_b_c: ArrayLike) -> Pose:
    """Return T_a_c, yaw in [-pi, pi)."""
    a, b = np.asarray(T_a_b, dtype=np.float64), np.asarray(T_b_c, dtype=np.float64)
    if a.ndim == b.ndim == 1:
        return np.array(product(numbers(a), numbers(b)))
    cos, sin = np.cos(a[..., 2]), np.sin(a[..., 2])
    x = a[..., 0] + cos * b[..., 0] - sin * b[..., 1]
    y = a[..., 1] + sin * b[..., 0] + cos * b[..., 1]
    return np.stack([x, y, wrap_angle(a[..., 2] + b[..., 2])], axis=-1)


def inverse(T_a_b: ArrayLike) -> Pose:
    """Return T_b_a."""
    a = np.asarray(T_a_b, dtype=np.float64)
    if a.ndim == 1:
        return np.array(quotient(numbers(a), numbers(IDENTITY)))
    cos, sin = np.cos(a[..., 2]), np.sin(a[..., 2])
    x = -cos * a[..., 0] - sin * a[..., 1]
    y = sin * a[..., 0] - cos * a[..., 1]
    return np.stack([x, y, wrap_angle(-a[..., 2])], axis=-1)


def between(T_w_a: ArrayLike, T_w_b: ArrayLike) -> Pose:
    """Return T_a_b from two poses in one frame. Holds: between(a, a) == identity."""
    a, b = np.asarray(T_w_a, dtype=np.float64), np.asarray(T_w_b, dtype=np.float64)
    if a.ndim == b.ndim == 1:
        return np.array(quotient(numbers(a), numbers(b)))
    return compose(inverse(a), b)


def transform(T_a_b: ArrayLike, points_b: ArrayLike) -> NDArray[np.float64]:
    """Return points_a, float64 (..., 2), metres, of points_b by one pose (3,)."""
    a, points = np.asarray(T_a_b, dtype=np.float64), np.asarray(points_b, dtype=np.float64)
    x, y, yaw = a.tolist()
    cos, sin = math.cos(yaw), math.sin(yaw)
    out = np.empty_like(points)
    out[..., 0] = x + cos * points[..., 0] - sin * points[..., 1]
    out[..., 1] = y + sin * points[..., 0] + cos * points[..., 1]
    return out


def adjoint(T_a_b: ArrayLike) -> NDArray[np.float64]:
    """Return the 3x3 matrix that carries a small motion written in b into a (both [dx, dy, dyaw])."""
    x, y, yaw = np.asarray(T_a_b, dtype=np.float64)
    cos, sin = np.cos(yaw), np.sin(yaw)
    return np.array([[cos, -sin, y], [sin, cos, -x], [0.0, 0.0, 1.0]])


def interpolate(T_w_a: ArrayLike, T_w_b: ArrayLike, share: ArrayLike) -> Pose:
    """Return the pose at `share` (0 at a, 1 at b) of the way, turning the short way round."""
    a, b = np.asarray(T_w_a, dtype=np.float64), np.asarray(T_w_b, dtype=np.float64)
    s = np.asarray(share, dtype=np.float64)
    delta = b - a
    delta[..., 2] = wrap_angle(delta[..., 2])
    result = a + s[..., None] * delta
    result[..., 2] = wrap_angle(result[..., 2])
    return result
