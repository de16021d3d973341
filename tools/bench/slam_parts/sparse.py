"""Where little is in sight: a hall wider than the laser sees, a hedge, a glass front, a yard before a door.

What the window adds to good wheels' errors over 10 s, what it takes from poor wheels', and whether a map
starts at all. Rays are exact; nothing may be tuned to these worlds.
"""

import argparse
import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lemtomap import se2
from lemtomap.grid import SLAMS, SlamConfig
from lemtomap.types import Odometry, Scan
from tools.bench.slam_parts.figures import Figure

PERIOD_S, SPEED_MPS, OVER_S = 0.1, 0.4, 10.0
ANGLES_RAD = np.linspace(-math.pi * 2 / 3, math.pi * 2 / 3, 341)  # every second beam of a URG-04LX
RANGE_M, RANGE_SIGMA_M = 5.6, 0.01
GLANCE = math.cos(math.radians(25.0))  # a glass pane returns nothing that meets it flatter

Segments = NDArray[np.float64]
"""float64 (N, 4), metres: x, y of both ends."""


@dataclass(frozen=True, slots=True)
class Wheels:
    """Share of a step's length and turn, and radians per metre, one standard deviation; scales of a drive."""

    way: float
    turn: float
    drift_rad: float
    scale: float

    def scales(self, rng: np.random.Generator) -> NDArray[np.float64]:
        """Return by what one robot's wheels mistake x, y and yaw throughout a drive, float64 (3,)."""
        return 1.0 + np.array([self.scale, 0.0, self.scale]) * rng.standard_normal(3)

    def told(
        self, step: se2.Pose, scales: NDArray[np.float64], rng: np.random.Generator
    ) -> NDArray[np.float64]:
        """Return what the wheels tell of a step, float64 (3,)."""
        noise = np.array([self.way * abs(step[0]), 0.0, self.turn * abs(step[2])])
        noise[2] = math.hypot(noise[2], self.drift_rad * math.sqrt(abs(step[0])))
        return np.asarray(step * scales + noise * rng.standard_normal(3))


@dataclass(frozen=True, slots=True)
class Scene:
    """Walls, panes of glass, and a hedge's front that beams enter; the corners of the drive."""

    walls: Segments
    glass: Segments
    hedge: Segments
    corners: tuple[tuple[float, float], ...]


WHEELS = {"Kobuki": Wheels(0.01, 0.005, 0.001, 0.005), "poor wheels": Wheels(0.05, 0.1, 0.02, 0.03)}


def box(x0: float, y0: float, x1: float, y1: float) -> list[tuple[float, float, float, float]]:
    """Return the four walls of a box."""
    return [(x0, y0, x1, y0), (x1, y0, x1, y1), (x1, y1, x0, y1), (x0, y1, x0, y0)]


def scene(name: str, rng: np.random.Generator) -> Scene:
    """Return one of SCENES; the hedge's front is drawn anew for each seed."""
    none = np.empty((0, 4))
    pillars = [box(x, y, x + 0.5, y + 0.5) for x in (-22.5, -7.5, 7.5, 22.5) for y in (-12.0, 0.0, 12.0)]
    room = [(-4.0, -3.0, 4.0, -3.0), (-4.0, -3.0, -4.0, 3.0), (-4.0, 3.0, 4.0, 3.0)]
    door = [*room, (4.0, -3.0, 4.0, -0.6), (4.0, 0.6, 4.0, 3.0), *box(-2.0, 1.5, -1.0, 2.2)]
    x = np.arange(4.0, 40.0, 0.3)
    y = 4.0 + rng.uniform(-0.7, 0.7, len(x))
    hedge = np.column_stack([x[:-1], y[:-1], x[1:], y[1:]])
    out_and_back = ((-2.0, 0.0), (6.0, 0.0), (30.0, 0.0), (6.0, 0.0), (-2.0, 0.0))
    match name:
        case "hall":
            walls = [*box(-30.0, -20.0, 30.0, 20.0), *(wall for pillar in pillars for wall in pillar)]
            round_ = ((0.0, -6.0), (20.0, -6.0), (20.0, 8.0), (-20.0, 8.0), (-20.0, -6.0), (0.0, -6.0))
            return Scene(np.array(walls), none, none, round_)
        case "hedge":
            return Scene(np.array(door), none, hedge, out_and_back)
        case "glass":
            panes = [(at, 3.0, at + 1.9, 3.0) for at in np.arange(4.0, 40.0, 2.0)]
            return Scene(np.array(door), np.array(panes), none, out_and_back)
    return Scene(np.array(door), none, none, out_and_back)


SCENES = ("hall", "hedge", "glass", "yard")


def scan(here: se2.Pose, where: Scene, rng: np.random.Generator, stamp_s: float) -> Scan:
    """Return what the laser sees."""
    walls, _ = _meet(here, where.walls)
    panes, facing = _meet(here, where.glass)
    leaves, _ = _meet(here, where.hedge)
    ranges = np.minimum(walls, np.where(facing > GLANCE, panes, np.inf))
    ranges = np.minimum(ranges, leaves + rng.exponential(0.15, len(ranges)))
    ranges = ranges + RANGE_SIGMA_M * rng.standard_normal(len(ranges))
    ranges = np.where(ranges > RANGE_M, np.inf, ranges).astype(np.float32)
    step_rad = float(ANGLES_RAD[1] - ANGLES_RAD[0])
    return Scan(stamp_s, ranges, float(ANGLES_RAD[0]), step_rad, range_max_m=RANGE_M)


def _meet(here: se2.Pose, segments: Segments) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the range of each beam to the nearest segment, and the cosine at which it meets it."""
    nearest, facing = np.full(len(ANGLES_RAD), np.inf), np.zeros(len(ANGLES_RAD))
    if not len(segments):
        return nearest, facing
    dx, dy = np.cos(ANGLES_RAD + here[2])[:, None], np.sin(ANGLES_RAD + here[2])[:, None]
    x, y = segments[:, 0] - here[0], segments[:, 1] - here[1]
    ex, ey = segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1]
    across = dx * ey - dy * ex
    with np.errstate(divide="ignore", invalid="ignore"):
        range_m, share = (x * ey - y * ex) / across, (x * dy - y * dx) / across
    range_m = np.where((range_m > 0.0) & (share >= 0.0) & (share <= 1.0), range_m, np.inf)
    at = range_m.argmin(axis=1)
    beams = np.arange(len(at))
    return range_m[beams, at], np.abs(across[beams, at]) / np.hypot(ex, ey)[at]


def path(corners: tuple[tuple[float, float], ...]) -> NDArray[np.float64]:
    """Return true poses float64 (N, 3): straight from corner to corner, turning on the spot."""
    poses: list[tuple[float, float, float]] = []
    yaw = 0.0
    for (x0, y0), (x1, y1) in pairwise(corners):
        wanted, way_m = math.atan2(y1 - y0, x1 - x0), math.hypot(x1 - x0, y1 - y0)
        turn = float(se2.wrap_angle(np.float64(wanted - yaw)))
        poses += [(x0, y0, yaw + t) for t in np.linspace(0.0, turn, max(2, round(abs(turn) / 0.05)))]
        yaw = wanted
        share = np.linspace(0.0, 1.0, round(way_m / (SPEED_MPS * PERIOD_S)))
        poses += [(x0 + s * (x1 - x0), y0 + s * (y1 - y0), yaw) for s in share]
    return np.array(poses)


@dataclass(frozen=True, slots=True)
class Drive:
    """Mean errors over OVER_S, metres, of the window and of the wheels; share of scans that matched."""

    window_m: float
    wheels_m: float
    matched: float


def drive(name: str, wheels: Wheels, seed: int) -> Drive:
    """Drive through one scene."""
    rng = np.random.default_rng(seed)
    where = scene(name, rng)
    truths = path(where.corners)
    scales = wheels.scales(rng)
    slam, T_odom_base = SLAMS["window"](SlamConfig(), seed), truths[0]
    shown, wheeled, matched = [], [], 0
    for index, here in enumerate(truths):
        if index:
            step = wheels.told(se2.between(truths[index - 1], here), scales, rng)
            T_odom_base = se2.compose(T_odom_base, step)
        stamp_s = PERIOD_S * index
        update = slam.update(scan(here, where, rng, stamp_s), Odometry(stamp_s, T_odom_base))
        shown.append(update.T_grid_base)
        wheeled.append(T_odom_base)
        matched += update.matched
    errors = [_over(np.array(poses), truths) for poses in (shown, wheeled)]
    return Drive(errors[0], errors[1], matched / len(truths))


def _over(poses: NDArray[np.float64], truths: NDArray[np.float64]) -> float:
    gap = round(OVER_S / PERIOD_S)
    true, told = se2.between(truths[:-gap], truths[gap:]), se2.between(poses[:-gap], poses[gap:])
    return float(np.hypot(*se2.between(true, told)[:, :2].T).mean())


def figures(options: argparse.Namespace) -> list[Figure]:
    """Return the rows of every scene and quality of wheels."""
    rows = []
    for kind, wheels in WHEELS.items():
        for name in SCENES:
            drives = [drive(name, wheels, seed) for seed in range(options.seeds)]
            ratios = [each.window_m / each.wheels_m for each in drives]
            rows += [
                Figure(f"{name}, {kind}: error over 10 s against the wheels'", ratios, "", 1.1),
                Figure(f"{name}, {kind}: scans not matched", [1.0 - each.matched for each in drives], ""),
            ]
    return rows
