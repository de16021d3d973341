"""Drives through any simulated building with the truth beside them: rays on its raster, no physics.

Another laser, other wheels, another building than those of the recorded logs: nothing may be tuned to these.
"""

import argparse
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lemtomap import se2
from lemtomap.grid import SLAMS, SlamConfig
from lemtomap.se2 import Pose
from lemtomap.sim import worlds
from lemtomap.sim.tours import plan_tour
from lemtomap.sim.world import Raster, World
from lemtomap.types import Odometry, Scan
from tools.bench.slam_parts.feeding import Pairs, feed
from tools.bench.slam_parts.figures import Figure

RAY_STEP_M, BISECTIONS = 0.03, 5
RANGE_SIGMA_M = 0.01
LOCAL_M = 10.0


@dataclass(frozen=True, slots=True)
class Laser:
    """Where the beams go and how far."""

    beams: int
    field_rad: float
    range_m: float


@dataclass(frozen=True, slots=True)
class Wheels:
    """Errors of a robot's odometry: scale of the way, of turns, per step, and of its stamps."""

    scale: float
    turn_scale: float
    turn_sigma_rad: float
    stamp_sigma_s: float


SICK, URG = Laser(180, math.pi, 10.0), Laser(683, math.radians(240.0), 5.6)
GOOD, POOR = Wheels(0.01, 0.01, 0.001, 0.0), Wheels(0.05, 0.1, 0.01, 0.05)
KINDS = {
    "SICK, good wheels": (SICK, GOOD),
    "SICK, poor wheels": (SICK, POOR),
    "URG, poor wheels": (URG, POOR),
}
WORLDS = ("loop", "offices:30:2", "campus")


def cast(
    raster: Raster, T_world_laser: Pose, angles_rad: NDArray[np.float64], range_m: float
) -> NDArray[np.float64]:
    """Return the ranges of beams, float64 (N,), metres; infinity where nothing is in range."""
    x, y, yaw = T_world_laser
    heading = np.stack([np.cos(angles_rad + yaw), np.sin(angles_rad + yaw)])

    def blocked(ranges_m: NDArray[np.float64]) -> NDArray[np.bool_]:
        px, py = x + ranges_m * heading[0][:, None], y + ranges_m * heading[1][:, None]
        col = ((px - raster.origin_m[0]) / raster.resolution_m).astype(np.int64)
        row = ((py - raster.origin_m[1]) / raster.resolution_m).astype(np.int64)
        rows, cols = raster.occupied.shape
        inside = (row >= 0) & (col >= 0) & (row < rows) & (col < cols)
        return np.asarray(inside & raster.occupied[row.clip(0, rows - 1), col.clip(0, cols - 1)])

    steps_m = np.arange(RAY_STEP_M, range_m, RAY_STEP_M)
    hit = blocked(np.broadcast_to(steps_m, (len(angles_rad), len(steps_m))))
    far = np.where(hit.any(axis=1), steps_m[hit.argmax(axis=1)], np.inf)
    near = far - RAY_STEP_M
    seen = np.isfinite(far)
    for _ in range(BISECTIONS):
        middle = np.where(seen, 0.5 * (near + far), 0.0)
        inside = blocked(middle[:, None])[:, 0]
        far, near = np.where(inside & seen, middle, far), np.where(inside | ~seen, near, middle)
    return np.where(seen, far, np.inf)


def drive(
    world_name: str, laser: Laser, wheels: Wheels, seconds: float, seed: int, period_s: float = 0.1
) -> tuple[Pairs, NDArray[np.float64]]:
    """Return a drive and the true poses, float64 (scans, 3), in the frame of the first."""
    world, rng = worlds.load(world_name), np.random.default_rng(seed)
    truths = _tour(world, seconds, seed, period_s)
    angles = (np.arange(laser.beams) - 0.5 * (laser.beams - 1)) * laser.field_rad / laser.beams
    scale, turn_scale = 1.0 + np.array([wheels.scale, wheels.turn_scale]) * rng.standard_normal(2)
    steps = se2.between(truths[:-1], truths[1:])
    late = np.diff(wheels.stamp_sigma_s * rng.standard_normal(len(truths)), prepend=0.0)
    T_odom_base, pairs = np.zeros(3), []
    for index, truth in enumerate(truths):
        if index:
            step = steps[index - 1] * [scale, scale, turn_scale]
            step = step * (1.0 + late[index] / period_s)
            step[2] += wheels.turn_sigma_rad * rng.standard_normal() * (abs(step[0]) > 0.0)
            T_odom_base = se2.compose(T_odom_base, step)
        ranges = cast(world.raster, truth, angles, laser.range_m) + RANGE_SIGMA_M * rng.standard_normal(
            len(angles)
        )
        stamp_s = period_s * index
        pairs.append(
            (
                Odometry(stamp_s, T_odom_base),
                Scan(
                    stamp_s,
                    ranges.astype(np.float32),
                    float(angles[0]),
                    float(angles[1] - angles[0]),
                    range_max_m=laser.range_m,
                ),
            )
        )
    return pairs, se2.between(truths[0], truths)


def _tour(world: World, seconds: float, seed: int, period_s: float) -> NDArray[np.float64]:
    """Return true poses at every scan of a tour, float64 (N, 3), world."""
    tour, pose = plan_tour(world, seconds, seed=seed), np.array(world.spawn)
    truths: list[Pose] = []
    ticks = round(period_s / 0.02)
    while not tour.done and len(truths) < 2 * seconds / period_s:
        truths.append(pose)
        for _ in range(ticks):
            v, w = tour.command(pose)
            pose = se2.compose(pose, se2.pose(0.02 * v, 0.0, 0.02 * w))
    return np.array(truths)


def local_errors(poses: NDArray[np.float64], truths: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return metres by which the motion over LOCAL_M of travel is missed, from every tenth scan on."""
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(truths[:, :2], axis=0).T))])
    first = np.arange(0, len(way), 10)
    second = np.minimum(np.searchsorted(way, way[first] + LOCAL_M), len(way) - 1)
    errors = se2.between(se2.between(truths[first], truths[second]), se2.between(poses[first], poses[second]))
    return np.asarray(np.hypot(errors[:, 0], errors[:, 1]))


def figures(options: argparse.Namespace) -> list[Figure]:
    """Return the rows of every building, laser and quality of wheels."""
    rows = []
    for label, (laser, wheels) in KINDS.items():
        for world in options.worlds:
            errors = []
            for seed in range(options.drive_seeds):
                pairs, truths = drive(world, laser, wheels, options.drive_s, seed)
                done = feed(SLAMS["window"](SlamConfig(), seed), pairs)
                errors.append(local_errors(done.poses, truths))
            medians, worst = [float(np.median(e)) for e in errors], [float(e.max()) for e in errors]
            rows.append(Figure(f"{world}, {label}: median error over 10 m", medians, "m"))
            rows.append(Figure(f"{world}, {label}: worst error over 10 m", worst, "m", 0.25))
    return rows
