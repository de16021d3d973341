"""40 m of corridor without features, a laser of 5.6 m: who knows how far he drove? (Appendix D)"""

import argparse
import math
from dataclasses import dataclass, replace

import numpy as np

from lemtomap import se2
from lemtomap.grid import SLAMS, GridSlam, SlamConfig
from lemtomap.se2 import Pose
from lemtomap.types import Odometry, Scan
from tools.bench.slam_parts.figures import Figure

ANGLES_RAD = np.linspace(-math.pi * 2 / 3, math.pi * 2 / 3, 683)  # URG-04LX
HALF_WIDTH_M, LENGTH_M, STEP_M = 1.0, 40.0, 0.03
SCALE_SIGMA, STEP_SIGMA_M, TURN_SIGMA_RAD = 0.02, 0.002, 0.002  # of the wheels
SLANT_RAD = 0.37  # from one seed to the next, how the corridor lies in the grid


@dataclass(frozen=True, slots=True)
class Drive:
    """Errors in metres."""

    along_m: float
    wheels_m: float
    across_m: float
    """The worst on the way; the others at the end."""
    diversity: float


def scan(T_corridor_base: Pose, rng: np.random.Generator, stamp_s: float) -> Scan:
    """Return what the laser sees between two endless walls."""
    along = np.sin(ANGLES_RAD + T_corridor_base[2])
    with np.errstate(divide="ignore", invalid="ignore"):
        ranges = (np.sign(along) * HALF_WIDTH_M - T_corridor_base[1]) / along
    ranges += 0.01 * rng.standard_normal(len(ANGLES_RAD))
    ranges[ranges > 5.6] = np.inf
    step_rad = float(ANGLES_RAD[1] - ANGLES_RAD[0])
    return Scan(stamp_s, ranges.astype(np.float32), float(ANGLES_RAD[0]), step_rad)


def drive(slam: GridSlam, seed: int) -> Drive:
    """Drive down the corridor in a gentle weave."""
    rng = np.random.default_rng(seed)
    T_grid_corridor = se2.pose(0.0, 0.0, SLANT_RAD * seed)
    before = se2.pose(0.0, 0.0, 0.05)
    T_odom_base = se2.compose(T_grid_corridor, before)
    scale = 1.0 + SCALE_SIGMA * rng.standard_normal()
    diversities, across = [], []
    wheels_m = driven_m = 0.0
    for i, x in enumerate(np.arange(0.0, LENGTH_M, STEP_M)):
        here = se2.pose(x, 0.15 * math.sin(x / 3.0), 0.05 * math.cos(x / 3.0))
        step = se2.between(before, here)
        driven_m += step[0]
        if i:  # the frame begins where the robot stands: no error yet
            noise = np.array([STEP_SIGMA_M, 0.0, TURN_SIGMA_RAD]) * rng.standard_normal(3)
            step = step * [scale, 1.0, 1.0] + noise
        wheels_m += step[0]
        T_odom_base, before = se2.compose(T_odom_base, step), here
        update = slam.update(scan(here, rng, 0.1 * i), Odometry(0.1 * i, T_odom_base))
        T_corridor_base = se2.between(T_grid_corridor, update.T_grid_base)
        diversities.append(update.diversity)
        across.append(abs(float(T_corridor_base[1] - here[1])))
    along_m = float(T_corridor_base[0] - before[0])
    return Drive(along_m, wheels_m - driven_m, max(across), float(np.median(diversities[10:])))


def figures(options: argparse.Namespace) -> list[Figure]:
    """Return the rows with the diversity gate, and with it switched off."""
    rows = []
    for kind in ("window", "rolling"):
        gated = [drive(SLAMS[kind](SlamConfig(), seed), seed) for seed in range(options.seeds)]
        ratio = _rms([d.along_m for d in gated]) / _rms([d.wheels_m for d in gated])
        slipped = [abs(d.along_m) - abs(d.wheels_m) for d in gated]
        rows += [
            Figure(f"corridor, {kind}: error along over that of the wheels, rms", [ratio], "", 1.1),
            Figure(f"corridor, {kind}: error along beyond that of the wheels", slipped, "m"),
            Figure(
                f"corridor, {kind}: error across, worst on the way", [d.across_m for d in gated], "m", 0.03
            ),
            Figure(f"corridor, {kind}: diversity mu", [d.diversity for d in gated], "", 0.2),
        ]
    blind = replace(SlamConfig(), degenerate_below=0.0)
    drives = [drive(SLAMS["window"](blind, seed), seed) for seed in range(options.seeds)]
    rows.append(
        Figure("corridor, window, mu off: error along (slips)", [abs(d.along_m) for d in drives], "m")
    )
    return rows


def _rms(values: list[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
