"""CARMEN logs of drives nobody drove: a SICK-like laser led through a simulated building, truth beside it.

    python -m tools.truth.sick_logs WORLD OUT.clf [--seed N] [--length M] [--odometry good|poor|sparse]

For buildings that no recorded log shows. 180 beams over 180 degrees, as FLASER lines have them; the relations
file has the form of the official ones, from the truth: each metre to the next, and each place to its other
visits. Rays follow the raster's distance field, so a scan is right to a fraction of its cell.
"""

import argparse
import sys
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from lemtomap.errors import BadInput
from lemtomap.se2 import (
    Pose,
    between,
    compose,
    wrap_angle,
)
from lemtomap.sim import worlds
from lemtomap.sim.errors import BadWorld
from lemtomap.sim.route import FloorRoutePlanner, path_length_m
from lemtomap.sim.world import Raster, World

BEAMS = 180
RANGE_M = 30.0
NO_RETURN_M = 81.9
NOISE_M = 0.012  # SICK LMS 200: 10 to 15 mm, statistical
TICK_M = 0.01
SPEED_MPS = 0.5
SPACING_M = 3.0  # between the places a tour calls at
NEAR_M = 1.0  # two visits nearer than this are a relation
APART_M = 15.0  # ... when so much way lies between them


@dataclass(frozen=True, slots=True)
class OdometryQuality:
    """Errors of dead reckoning, and how often it reports."""

    scale: float
    """Systematic share of the way."""
    turn_scale: float
    """Systematic share of turning."""
    shift_per_sqrt_m: float
    turn_per_sqrt_m: float
    turn_per_sqrt_rad: float
    step_m: float = 0.1
    """Way between scans."""
    step_rad: float = 0.1


QUALITIES = {
    "good": OdometryQuality(0.01, 0.01, 0.01, 0.01, 0.02),
    "poor": OdometryQuality(-0.04, 0.06, 0.03, 0.04, 0.08),
    "sparse": OdometryQuality(0.02, -0.02, 0.02, 0.02, 0.04, step_m=0.35, step_rad=0.3),
}


def tour(world: World, length_m: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return a way through random places of a building and back, float64 (N, 2), metres."""
    planner = FloorRoutePlanner(world.raster)
    start = (world.spawn[0], world.spawn[1])
    places = planner.places(start, SPACING_M)
    way: list[NDArray[np.float64]] = []
    at, gone_m = start, 0.0
    while gone_m < length_m:
        goal = places[int(rng.integers(len(places)))]
        leg = planner.path(at, goal)
        if len(leg) < 2:
            continue
        way.append(leg)
        gone_m += path_length_m(leg)
        at = goal
    way.append(planner.path(at, start))
    return np.concatenate(way)


def poses_along(way: NDArray[np.float64], quality: OdometryQuality) -> Pose:
    """Return where scans are taken, float64 (N, 3): turning on the spot where the way bends."""
    steps = np.hypot(*np.diff(way, axis=0).T)
    keep = np.concatenate([[True], steps > 1e-6])
    way = way[keep]
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(way, axis=0).T))])
    marks = np.arange(0.0, along[-1], quality.step_m)
    x, y = np.interp(marks, along, way[:, 0]), np.interp(marks, along, way[:, 1])
    ahead = np.minimum(marks + 0.3, along[-1])
    heading = np.arctan2(np.interp(ahead, along, way[:, 1]) - y, np.interp(ahead, along, way[:, 0]) - x)
    poses: list[Pose] = []
    yaw = float(heading[0])
    for k in range(len(marks)):
        turn = float(wrap_angle(heading[k] - yaw))
        count = max(1, int(np.ceil(abs(turn) / quality.step_rad)))
        poses += [np.array([x[k], y[k], yaw + turn * i / count]) for i in range(1, count + 1)]
        yaw += turn
    found = np.array(poses)
    found[:, 2] = wrap_angle(found[:, 2])
    return found


def odometry_of(truth: Pose, quality: OdometryQuality, rng: np.random.Generator) -> Pose:
    """Return dead reckoning along true poses, float64 (N, 3)."""
    estimate = np.zeros((len(truth), 3))
    for k in range(1, len(truth)):
        step = between(truth[k - 1], truth[k])
        gone_m, turned = float(np.hypot(step[0], step[1])), abs(float(step[2]))
        shift = quality.shift_per_sqrt_m * np.sqrt(gone_m) * rng.standard_normal(2)
        turn = np.sqrt(quality.turn_per_sqrt_m**2 * gone_m + quality.turn_per_sqrt_rad**2 * turned)
        noisy = step * (1.0 + np.array([quality.scale, quality.scale, quality.turn_scale]))
        noisy += np.array([*shift, turn * rng.standard_normal()])
        estimate[k] = compose(estimate[k - 1], noisy)
    return estimate


class Laser:
    """Casts rays through a raster by its distance field."""

    def __init__(self, raster: Raster) -> None:
        self._raster = raster
        padded = np.pad(raster.occupied, 1, constant_values=False)
        self._gap_m = ndimage.distance_transform_edt(~padded)[1:-1, 1:-1] * raster.resolution_m

    def scan(self, pose: Pose, rng: np.random.Generator) -> NDArray[np.float64]:
        """Return ranges, float64 (180,), metres, NO_RETURN_M where nothing is met."""
        angles = pose[2] + np.deg2rad(-90.0 + np.arange(BEAMS) * 180.0 / BEAMS)
        dx, dy = np.cos(angles), np.sin(angles)
        ranges, alive = np.full(BEAMS, 0.05), np.ones(BEAMS, dtype=bool)
        x0, y0 = self._raster.origin_m
        rows, cols = self._gap_m.shape
        half = 0.5 * self._raster.resolution_m
        for _ in range(400):
            col = np.floor((pose[0] + ranges * dx - x0) / self._raster.resolution_m).astype(int)
            row = np.floor((pose[1] + ranges * dy - y0) / self._raster.resolution_m).astype(int)
            inside = (col >= 0) & (row >= 0) & (col < cols) & (row < rows) & (ranges < RANGE_M)
            gap = np.where(inside, self._gap_m[np.clip(row, 0, rows - 1), np.clip(col, 0, cols - 1)], np.inf)
            alive &= gap > 0.0
            if not (alive & inside).any():
                break
            ranges = np.where(alive & inside, ranges + np.maximum(gap - 2.0 * half, 0.4 * half), ranges)
        noisy = np.round((ranges + NOISE_M * rng.standard_normal(BEAMS)) / TICK_M) * TICK_M
        return np.where(alive, NO_RETURN_M, noisy)


def write_log(world: World, out: Path, seed: int, length_m: float, quality: OdometryQuality) -> int:
    """Write a log and, beside it, its relations; return the number of scans."""
    rng = np.random.default_rng(seed)
    truth = poses_along(tour(world, length_m, rng), quality)
    odometry = odometry_of(truth, quality, rng)
    steps = np.hypot(*np.diff(truth[:, :2], axis=0).T) / SPEED_MPS + np.abs(wrap_angle(np.diff(truth[:, 2])))
    stamps = 1000.0 + np.concatenate([[0.0], np.cumsum(np.maximum(steps, 0.05))])
    laser = Laser(world.raster)
    with out.open("w", encoding="ascii") as file:
        for k in range(len(truth)):
            ranges = " ".join(f"{r:.2f}" for r in laser.scan(truth[k], rng))
            x, y, yaw = odometry[k]
            pose = f"{x:.6f} {y:.6f} {yaw:.6f}"
            file.write(f"FLASER {BEAMS} {ranges} {pose} {pose} {stamps[k]:.6f} sick {stamps[k]:.6f}\n")
    rows = [
        f"{stamps[a]:.6f} {stamps[b]:.6f} {x:.6f} {y:.6f} 0.0 0.0 0.0 {yaw:.6f}\n"
        for a, b in _pairs(truth, rng)
        for x, y, yaw in [between(truth[a], truth[b]).tolist()]
    ]
    out.with_suffix(".relations").write_text("".join(rows), encoding="ascii")
    return len(truth)


def _pairs(truth: Pose, rng: np.random.Generator) -> list[tuple[int, int]]:
    """Return pairs of scans: each metre of way with the next, and with other visits to the same place."""
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(truth[:, :2], axis=0).T))])
    keys = np.searchsorted(way, np.arange(0.0, way[-1], 1.0))
    pairs = [(int(a), int(b)) for a, b in pairwise(keys.tolist()) if b > a]
    for key in keys:
        gap = np.hypot(*(truth[keys, :2] - truth[key, :2]).T)
        others = keys[(gap < NEAR_M) & (way[keys] - way[key] > APART_M)]
        if len(others):
            pairs.append((int(key), int(rng.choice(others))))
    return pairs


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m tools.truth.sick_logs",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("world")
    parser.add_argument("out", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--length", type=float, default=300.0, metavar="M")
    parser.add_argument("--odometry", choices=QUALITIES, default="good")
    options = parser.parse_args(arguments)
    try:
        world = worlds.load(options.world)
        quality = QUALITIES[options.odometry]
        scans = write_log(world, options.out, options.seed, options.length, quality)
    except (BadWorld, BadInput, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    print(f"{options.out}: {scans:,} scans")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
