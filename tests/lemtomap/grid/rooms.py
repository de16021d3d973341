"""Rooms of straight walls and a robot in them, exact: what scans should say, where the robot really is."""

import math

import numpy as np

from lemtomap import se2
from lemtomap.types import Odometry, Scan


def box(x0, y0, x1, y1):
    return [((x0, y0), (x1, y0)), ((x1, y0), (x1, y1)), ((x1, y1), (x0, y1)), ((x0, y1), (x0, y0))]


def scan_at(T_world_base, walls, stamp_s=0.0, beams=240, range_max_m=5.6, noise_m=0.0, rng=None):
    angles = np.linspace(-math.pi * 2 / 3, math.pi * 2 / 3, beams)
    x, y, yaw = T_world_base
    dx, dy = np.cos(angles + yaw), np.sin(angles + yaw)
    ranges = np.full(beams, np.inf)
    for (ax, ay), (bx, by) in walls:
        ex, ey = bx - ax, by - ay
        denominator = dx * ey - dy * ex
        with np.errstate(divide="ignore", invalid="ignore"):
            t = ((ax - x) * ey - (ay - y) * ex) / denominator
            u = ((ax - x) * dy - (ay - y) * dx) / denominator
        hit = (t > 0.0) & (u >= 0.0) & (u <= 1.0)
        ranges = np.where(hit & (t < ranges), t, ranges)
    if rng is not None:
        ranges = ranges + noise_m * rng.standard_normal(beams)
    ranges = np.where(ranges > range_max_m, np.inf, ranges).astype(np.float32)
    return Scan(stamp_s, ranges, float(angles[0]), float(angles[1] - angles[0]), range_max_m=range_max_m)


def drive(path, walls, seed=0, noise_m=0.01, odometry_noise=0.03, carried_at=(), **kinds):
    """Yield (true pose, Odometry, Scan) along poses; odometry drifts by a share of each step.

    `carried_at`: numbers of poses to which no wheel turned.
    """
    rng = np.random.default_rng(seed)
    T_odom_base = np.array(path[0], dtype=float)
    before = np.array(path[0], dtype=float)
    for i, here in enumerate(path):
        step = np.zeros(3) if i in carried_at else se2.between(before, here)
        T_odom_base = se2.compose(T_odom_base, step * (1.0 + odometry_noise * rng.standard_normal(3)))
        before = np.array(here, dtype=float)
        yield (
            before,
            Odometry(0.1 * i, T_odom_base),
            scan_at(here, walls, 0.1 * i, noise_m=noise_m, rng=rng, **kinds),
        )


def corridor_round(width_m, height_m, wide_m=2.4, seed=1):
    """A corridor once round a rectangle; cupboards at irregular places along its outer walls."""
    rng = np.random.default_rng(seed)
    walls = box(0, 0, width_m, height_m) + box(wide_m, wide_m, width_m - wide_m, height_m - wide_m)
    corners = np.array([(0, 0), (width_m, 0), (width_m, height_m), (0, height_m)], float)
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        length_m = float(np.hypot(*(b - a)))
        along = (b - a) / length_m
        inwards = np.array([-along[1], along[0]])
        at_m = rng.uniform(1.0, 2.0)
        while at_m < length_m - 2.0:
            cupboard_m, deep_m = rng.uniform(0.3, 1.2), rng.uniform(0.2, 0.5)
            near = a + along * at_m
            walls += box(*near, *(near + along * cupboard_m + inwards * deep_m))
            at_m += cupboard_m + rng.uniform(0.8, 2.5)
    return walls


def way_round(width_m, height_m, beside_m=1.4, laps=2, step_m=0.1):
    """Poses along the middle of such a corridor, anticlockwise, from its corner at the origin."""
    far_x, far_y = width_m - beside_m, height_m - beside_m
    corners = np.array([(beside_m, beside_m), (far_x, beside_m), (far_x, far_y), (beside_m, far_y)])
    path = []
    for k in range(4 * laps):
        a, b = corners[k % 4], corners[(k + 1) % 4]
        length_m = float(np.hypot(*(b - a)))
        yaw = math.atan2(*(b - a)[::-1])
        path += [(*(a + (b - a) * s / length_m), yaw) for s in np.arange(0.0, length_m, step_m)]
        path += [(*b, yaw + turn) for turn in np.linspace(0.0, math.pi / 2, 8)[1:-1]]
    return path
