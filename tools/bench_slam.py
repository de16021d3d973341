"""Accuracy, CPU and memory of the rolling-window SLAM on real logs, every figure with its spread.

    python -m tools.bench_slam logs DATA [--slam window rolling gmapping] [--logs intel aces] [--seeds 10]
    python -m tools.bench_slam corridor [--seeds 10]     40 m without features: who knows how far it drove?
    python -m tools.bench_slam kernels                   one match, one integration, windows in memory

DATA is the folder that holds LOG.clf.xz and LOG.relations. A seed also moves the start: seed s begins at
scan 7 s, so that single-hypothesis runs differ too. Poses are the online ones; large loops are the
topological layer's work.
"""

import argparse
import math
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lemtomap import se2
from lemtomap.grid import SLAMS, GridSlam, RollingGmapping, SlamConfig, WindowMatcher
from lemtomap.se2 import Pose
from lemtomap.types import Odometry, Scan
from robot.logs import open_log
from tools.relations import read_relations, relation_errors

START_STEP = 7
LOCAL_M, BROKEN_M = 10.0, 0.25
PASSES = 200


@dataclass(frozen=True, slots=True)
class Run:
    """What one pass over one log gave."""

    median_m: float
    mean_m: float
    local_worst_m: float
    broken: int
    cpu_s: float
    worst_update_ms: float


def run_log(slam: GridSlam, pairs: list[tuple[Odometry, Scan]], relations: Pose) -> Run:
    """Feed a log and compare the online poses with the relations."""
    stamps, poses, took = [], [], []
    for odometry, scan in pairs:
        before = time.thread_time()
        update = slam.update(scan, odometry)
        took.append(time.thread_time() - before)
        stamps.append(scan.stamp_s)
        poses.append(update.T_grid_base)
    errors, ways_m, _ = relation_errors(relations, np.array(stamps), np.array(poses))
    metres = np.hypot(errors[:, 0], errors[:, 1])
    local = metres[ways_m < LOCAL_M]
    return Run(
        float(np.median(metres)),
        float(metres.mean()),
        float(local.max()),
        int((local > BROKEN_M).sum()),
        sum(took),
        1000.0 * float(np.percentile(took, 99)),
    )


def bench_logs(options: argparse.Namespace) -> None:
    head = "log     range  slam      runs  median m (worst)   mean m (worst)"
    print(head, "  <10 m worst  broken  CPU s  p99 ms")
    for name in options.logs:
        pairs = list(open_log(options.data / f"{name}.clf.xz"))
        relations = read_relations(options.data / f"{name}.relations")
        for range_m in options.ranges:
            for kind in options.slam:
                particles = options.particles or SlamConfig().particles
                config = SlamConfig(particles=particles, max_range_m=range_m)
                SLAMS[kind](config, 0).update(pairs[0][1], pairs[0][0])  # compile outside the clock
                runs = [
                    run_log(SLAMS[kind](config, seed), pairs[START_STEP * seed :], relations)
                    for seed in range(options.seeds)
                ]
                print(f"{name:7s} {range_m:4.1f}m  {kind:8s} {_row(runs)}", flush=True)


def _row(runs: list[Run]) -> str:
    medians, means = [r.median_m for r in runs], [r.mean_m for r in runs]
    return (
        f"{len(runs):5d}  {np.median(medians):.4f} ({max(medians):.4f})"
        f"  {np.median(means):.4f} ({max(means):.4f})"
        f"  {max(r.local_worst_m for r in runs):11.3f}  {max(r.broken for r in runs):6d}"
        f"  {np.median([r.cpu_s for r in runs]):5.2f}  {max(r.worst_update_ms for r in runs):6.2f}"
    )


def corridor_scan(
    T_world_base: Pose, rng: np.random.Generator, stamp_s: float, half_width_m: float = 1.0
) -> Scan:
    """Return what a URG-04LX (240 degrees, 5.6 m) sees between two endless walls."""
    angles = np.linspace(-math.pi * 2 / 3, math.pi * 2 / 3, 683)
    along = np.sin(angles + T_world_base[2])
    with np.errstate(divide="ignore", invalid="ignore"):
        ranges = (np.sign(along) * half_width_m - T_world_base[1]) / along
    ranges += 0.01 * rng.standard_normal(len(angles))
    ranges[ranges > 5.6] = np.inf
    return Scan(stamp_s, ranges.astype(np.float32), float(angles[0]), float(angles[1] - angles[0]))


def drive_corridor(slam: GridSlam, seed: int) -> tuple[float, float, float, float]:
    """Return errors in m: along at the end by SLAM and by the wheels, across at the worst; median mu."""
    rng = np.random.default_rng(seed)
    before = T_odom_base = se2.pose(0.0, 0.0, 0.05)
    scale = 1.0 + 0.02 * rng.standard_normal()
    diversities, across = [], []
    wheels_m = driven_m = 0.0
    for i, x in enumerate(np.arange(0.0, 40.0, 0.03)):
        here = se2.pose(x, 0.15 * math.sin(x / 3.0), 0.05 * math.cos(x / 3.0))
        step = se2.between(before, here)
        driven_m += step[0]
        if i:  # the frame begins where the robot stands: no error yet
            step = step * [scale, 1.0, 1.0]
            step[0] += 0.002 * rng.standard_normal()
            step[2] += 0.002 * rng.standard_normal()
        wheels_m += step[0]
        T_odom_base, before = se2.compose(T_odom_base, step), here
        update = slam.update(corridor_scan(here, rng, 0.1 * i), Odometry(0.1 * i, T_odom_base))
        diversities.append(update.diversity)
        across.append(abs(update.T_grid_base[1] - here[1]))
    end = update.T_grid_base[0] - before[0]
    return float(end), wheels_m - driven_m, max(across), float(np.median(diversities[10:]))


def bench_corridor(options: argparse.Namespace) -> None:
    print("slam      gate   along m (odometry)   across worst m   mu   per seed")
    for kind in options.slam:
        for gate in (SlamConfig().degenerate_below, 0.0):
            config = replace(SlamConfig(), degenerate_below=gate)
            for seed in range(options.seeds):
                along, odometry, across, mu = drive_corridor(SLAMS[kind](config, seed), seed)
                figures = f"{along:8.3f} ({odometry:6.3f})  {across:14.3f}  {mu:.3f}"
                print(f"{kind:8s} {gate:5.2f}  {figures}", flush=True)


def bench_kernels(options: argparse.Namespace) -> None:
    del options
    rng = np.random.default_rng(0)
    slam = WindowMatcher(SlamConfig(integrate_period_s=1e9))
    scans = [corridor_scan(se2.pose(0.03 * i, 0.0, 0.0), rng, 0.1 * i) for i in range(PASSES)]
    clocks = {"match": 0.0, "match and integrate": 0.0}
    counts = dict.fromkeys(clocks, 0)
    for i, scan in enumerate(scans):
        before = time.thread_time()
        update = slam.update(scan, Odometry(0.1 * i, se2.pose(0.03 * i, 0.0, 0.0)))
        if i > 2 and update.matched:
            name = "match and integrate" if update.integrated else "match"
            clocks[name] += time.thread_time() - before
            counts[name] += 1
    for name, clock in clocks.items():
        print(f"683 beams, {name}: {1e6 * clock / max(1, counts[name]):.0f} us over {counts[name]} updates")
    print(f"windows of 5 particles: {RollingGmapping(SlamConfig()).nbytes / 1e6:.2f} MB")


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("what", choices=["logs", "corridor", "kernels"])
    parser.add_argument("data", type=Path, nargs="?", default=Path("../shared/data/carmen"))
    parser.add_argument("--slam", nargs="+", choices=sorted(SLAMS), default=["window", "rolling"])
    parser.add_argument("--logs", nargs="+", default=["intel", "aces"])
    parser.add_argument("--ranges", nargs="+", type=float, default=[10.0, 5.6])
    parser.add_argument("--particles", type=int)
    parser.add_argument("--seeds", type=int, default=10)
    options = parser.parse_args(arguments)
    {"logs": bench_logs, "corridor": bench_corridor, "kernels": bench_kernels}[options.what](options)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
