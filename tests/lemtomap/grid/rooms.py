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


def drive(path, walls, seed=0, noise_m=0.01, odometry_noise=0.03, **kinds):
    """Yield (true pose, Odometry, Scan) along poses; odometry drifts by a share of each step."""
    rng = np.random.default_rng(seed)
    T_odom_base = np.array(path[0], dtype=float)
    before = np.array(path[0], dtype=float)
    for i, here in enumerate(path):
        step = se2.between(before, here)
        T_odom_base = se2.compose(T_odom_base, step * (1.0 + odometry_noise * rng.standard_normal(3)))
        before = np.array(here, dtype=float)
        yield (
            before,
            Odometry(0.1 * i, T_odom_base),
            scan_at(here, walls, 0.1 * i, noise_m=noise_m, rng=rng, **kinds),
        )
