"""One pass of a metric layer over scans: its poses, what each update took, how far relations are missed."""

import time
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lemtomap.grid import GridSlam, GrowingGmapping
from lemtomap.types import Odometry, Scan
from tools.truth.relations import relation_errors

LOCAL_M, BROKEN_M = 10.0, 0.25
WHEELS_AGREE_M = 0.1
Pairs = list[tuple[Odometry, Scan]]


@dataclass(frozen=True, slots=True)
class Pass:
    """Poses float64 (scans, 3) in grid, stamps and CPU seconds (scans,), mu of each scan."""

    stamps_s: NDArray[np.float64]
    poses: NDArray[np.float64]
    took_s: NDArray[np.float64]
    diversity: NDArray[np.float64]


def feed(slam: GridSlam, pairs: Iterable[tuple[Odometry, Scan]]) -> Pass:
    """Feed every scan. A layer that keeps the whole path answers with it, others with what they said then."""
    stamps, poses, took, diversity = [], [], [], []
    for odometry, scan in pairs:
        before = time.thread_time()
        update = slam.update(scan, odometry)
        took.append(time.thread_time() - before)
        stamps.append(scan.stamp_s)
        poses.append(update.T_grid_base)
        diversity.append(update.diversity)
    path = slam.path() if isinstance(slam, GrowingGmapping) else np.array(poses)
    return Pass(np.array(stamps), path, np.array(took), np.array(diversity))


@dataclass(frozen=True, slots=True)
class Accuracy:
    """How far one pass misses the relations of its log, metres."""

    median_m: float
    mean_m: float
    local_worst_m: float
    """Among relations less than LOCAL_M of travel apart."""
    broken: int
    """Local relations that are wrong by more than BROKEN_M, and that the wheels do not contradict: where
    scan and wheels agree on another motion than the relation, they are believed.
    """
    doubtful: int
    """The others of the local relations missed by more than BROKEN_M."""


def accuracy(done: Pass, pairs: Pairs, relations: NDArray[np.float64]) -> Accuracy:
    """Compare with relations as tools.truth.relations reads them."""
    errors, ways_m, _ = relation_errors(relations, done.stamps_s, done.poses)
    wheels = np.array([odometry.T_odom_base for odometry, _ in pairs])
    by_wheels, _, _ = relation_errors(relations, done.stamps_s, wheels)
    metres = np.hypot(errors[:, 0], errors[:, 1])
    apart = np.hypot(*(errors - by_wheels)[:, :2].T)
    local = ways_m < LOCAL_M
    missed = local & (metres > BROKEN_M)
    agree = apart < WHEELS_AGREE_M
    return Accuracy(
        float(np.median(metres)),
        float(metres.mean()),
        float(metres[local & ~(missed & agree)].max()),
        int((missed & ~agree).sum()),
        int((missed & agree).sum()),
    )
