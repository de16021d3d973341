"""Accuracy, spread and CPU on recorded logs."""

import argparse
from dataclasses import replace
from pathlib import Path

from lemtomap.grid import SLAMS, SlamConfig
from lemtomap.robot.logs import open_log
from tools.bench.slam_parts.feeding import Pairs, accuracy, feed
from tools.bench.slam_parts.figures import Figure
from tools.truth.relations import read_relations

START_STEP = 7  # seed s begins at scan 7 s, so that single-hypothesis runs differ too
MEDIAN_M = {("intel", 10.0): 0.0185, ("intel", 5.6): 0.020, ("aces", 10.0): 0.030, ("aces", 5.6): 0.032}
MEAN_M = {"intel": 0.023, "aces": 0.048}  # of the growing map
CPU_S = {("intel", "window"): 2.4, ("intel", "rolling"): 8.0}
GROWN_PARTICLES = 30


def figures(options: argparse.Namespace) -> list[Figure]:
    """Return the rows of every log, range and layer."""
    rows: list[Figure] = []
    for name in options.logs:
        pairs = list(open_log(options.data / f"{name}.clf.xz"))
        for range_m in options.ranges:
            for kind in options.slam:
                rows += _of(name, range_m, kind, pairs, options)
    return rows


def _of(name: str, range_m: float, kind: str, pairs: Pairs, options: argparse.Namespace) -> list[Figure]:
    relations = read_relations(Path(options.data) / f"{name}.relations")
    grown = kind == "gmapping"
    config = SlamConfig(max_range_m=range_m)
    config = replace(config, particles=options.particles or (GROWN_PARTICLES if grown else config.particles))
    feed(SLAMS[kind](config, 0), pairs[:50])  # compiles
    seeds = min(options.seeds, options.grown_seeds) if grown else options.seeds
    got, cpu_s = [], []
    for seed in range(seeds):
        part = pairs[START_STEP * seed :]
        done = feed(SLAMS[kind](config, seed), part)
        got.append(accuracy(done, part, relations))
        cpu_s.append(float(done.took_s.sum()))
    where = f"{name} {range_m:g} m, {kind}"
    mean_m = MEAN_M.get(name) if grown and range_m == 10.0 else None
    median_m = None if grown else MEDIAN_M.get((name, range_m))
    return [
        Figure(f"{where}: median error", [a.median_m for a in got], "m", median_m),
        Figure(f"{where}: mean error", [a.mean_m for a in got], "m", mean_m),
        Figure(f"{where}: worst within 10 m", [a.local_worst_m for a in got], "m", 0.25),
        Figure(f"{where}: relations that wheels and scan deny", [float(a.doubtful) for a in got], ""),
        Figure(f"{where}: CPU, every scan", cpu_s, "s", CPU_S.get((name, kind)) if range_m == 10.0 else None),
    ]
