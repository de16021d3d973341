"""Time of the kernels, load in real time, memory, first use, and the same bytes for any number of threads."""

import argparse
import hashlib
import os
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator

import numpy as np

from lemtomap.grid import (
    SLAMS,
    GrowingGmapping,
    RollingGmapping,
    SlamConfig,
    WindowMatcher,
)
from lemtomap.grid.beams import ScanPreparer
from lemtomap.grid.motion import Uncertainty
from lemtomap.robot.child import python
from lemtomap.types import Odometry, Scan
from tools.bench.parts.measuring import resident_mb
from tools.bench.slam_parts.drives import (
    GOOD,
    SICK,
    URG,
    Laser,
    drive,
)
from tools.bench.slam_parts.feeding import Pairs, feed
from tools.bench.slam_parts.figures import Figure

WORLD, LARGE_WORLD = "offices:30:2", "campus"
SCAN_S = 0.1
PASSES = 100
SEEDS = 3
SETTLED_S = 300.0


def kernels(options: argparse.Namespace) -> list[Figure]:
    """Return the time of one match and one integration, from poses all along a drive."""
    rows = []
    for label, laser, match_us, integrate_us in (
        ("180 beams of a SICK", SICK, 100.0, 300.0),
        ("683 beams of a URG-04LX", URG, None, None),
    ):
        matches, integrations = [], []
        for seed in range(min(SEEDS, options.seeds)):
            got = _kernel_times(laser, seed)
            matches.append(got[0])
            integrations.append(got[1])
        rows += [
            Figure(f"one match, {label}", matches, "us", match_us),
            Figure(f"integrating one scan, {label}", integrations, "us", integrate_us),
        ]
    return rows


def _kernel_times(laser: Laser, seed: int) -> tuple[float, float]:
    pairs, truths = drive(WORLD, laser, GOOD, 40.0, seed)
    config = SlamConfig()
    slam, prepare = WindowMatcher(config), ScanPreparer()
    window, match, step = slam._window(), slam._match, Uncertainty(0.012, 0.02)  # noqa: SLF001
    match_s = integrate_s = 0.0
    counted = 0
    for index, ((odometry, scan), truth) in enumerate(zip(pairs, truths, strict=True)):
        beams = prepare(scan, odometry, config.usable_range_m(scan.range_max_m))
        if index and index % 5 == 0:
            begun = time.thread_time()
            match(beams, truth + np.array([0.01, -0.01, 0.01]), step, window)
            matched = time.thread_time()
            window.integrate(beams, truth)
            if index > 50:
                match_s += matched - begun
                integrate_s += time.thread_time() - matched
                counted += 1
        elif index == 0:
            window.integrate(beams, truth)
        if not window.holds(beams, truth):
            window.shift_to(window.centred_origin(truth))
    return 1e6 * match_s / counted, 1e6 * integrate_s / counted


def real_time(options: argparse.Namespace) -> list[Figure]:
    """Return the load of URG scans at 10 Hz."""
    rows = []
    for kind in ("window", "rolling"):
        shares, p99s = [], []
        for seed in range(min(SEEDS, options.seeds)):
            pairs, _ = drive(WORLD, URG, GOOD, options.drive_s, seed)
            took_s = feed(SLAMS[kind](SlamConfig(), seed), pairs).took_s[20:]
            shares.append(100.0 * float(took_s.mean()) / SCAN_S)
            p99s.append(1e3 * float(np.percentile(took_s, 99)))
        rows += [
            Figure(f"URG at 10 Hz, {kind}: share of a core", shares, "%", 10.0),
            Figure(f"URG at 10 Hz, {kind}: update p99", p99s, "ms", 20.0),
        ]
    return rows


def to_and_fro(pairs: Pairs, scans: int) -> Iterator[tuple[Odometry, Scan]]:
    """Yield a drive forwards, backwards, forwards, ... with stamps that go on."""
    last, index, step = len(pairs) - 1, 0, 1
    for count in range(scans):
        odometry, scan = pairs[index]
        stamp_s = SCAN_S * count
        yield (
            Odometry(stamp_s, odometry.T_odom_base),
            Scan(
                stamp_s, scan.ranges_m, scan.angle_min_rad, scan.angle_step_rad, range_max_m=scan.range_max_m
            ),
        )
        if not 0 <= index + step <= last:
            step = -step
        index += step


def memory(options: argparse.Namespace) -> list[Figure]:
    """Return what the layers hold: windows, after an hour of driving, and a grown map's many particles."""
    rows = [Figure("windows of 5 particles", [RollingGmapping(SlamConfig()).nbytes / 1e6], "MB", 10.0)]
    pairs, _ = drive(LARGE_WORLD, SICK, GOOD, 300.0, 0)
    for kind in ("window", "rolling"):
        slam, settled = SLAMS[kind](SlamConfig(), 0), 0.0
        for odometry, scan in to_and_fro(pairs, round(3600.0 * options.hours / SCAN_S)):
            slam.update(scan, odometry)
            slam.view()
            if abs(scan.stamp_s - SETTLED_S) < SCAN_S / 2.0:
                settled = resident_mb()
        grew = resident_mb() - settled
        rows.append(
            Figure(f"{kind}: memory after {options.hours:g} h over that after 5 min", [grew], "MB", 2.0)
        )
    return [*rows, *_grown_memory(options)]


def _grown_memory(options: argparse.Namespace) -> list[Figure]:
    pairs, _ = drive(LARGE_WORLD, SICK, GOOD, options.grown_s, 1)
    slam = GrowingGmapping(SlamConfig(particles=80), 0)
    feed(slam, pairs)
    return [
        Figure(
            f"growing map, 80 particles, {options.grown_s:.0f} s in {LARGE_WORLD}: process",
            [resident_mb()],
            "MB",
            600.0,
        )
    ]


FRESH = """
import time
begun = time.process_time()
from lemtomap.grid import SLAMS, SlamConfig
from tools.bench.slam_parts.costs import digest
from tools.bench.slam_parts.drives import GOOD, URG, drive
pairs, _ = drive({world!r}, URG, GOOD, 30.0, 0)
imported = time.process_time()
slam = SLAMS["rolling"](SlamConfig(), 0)
for odometry, scan in pairs[:30]:
    slam.update(scan, odometry)
print(time.process_time() - imported, digest(pairs))
"""


def digest(pairs: Pairs) -> str:
    """Return a hash of all poses, the windows and the particles after a drive of five particles."""
    slam = RollingGmapping(SlamConfig(), 0)
    done = feed(slam, pairs)
    parts = (done.poses, slam.view().occupancy, slam.particles(), slam.occupied_points())
    return hashlib.sha256(b"".join(np.ascontiguousarray(part).tobytes() for part in parts)).hexdigest()


def fresh_process(threads: int, cache: str) -> tuple[float, str]:
    """Return the CPU seconds until 30 scans were used in a new process, and the digest of its drive."""
    environment = {**os.environ, "NUMBA_NUM_THREADS": str(threads), "NUMBA_CACHE_DIR": cache}
    code = FRESH.format(world=WORLD)
    done = subprocess.run(  # noqa: S603
        python("-c", code), env=environment, capture_output=True, text=True, check=True
    )
    seconds, hashed = done.stdout.split()
    return float(seconds), hashed


def first_use(options: argparse.Namespace) -> list[Figure]:
    """Return how long the first and later uses take, and how many different results threads gave."""
    del options
    with tempfile.TemporaryDirectory(prefix="lemtomap-") as cache:
        runs = [fresh_process(threads, cache) for threads in (1, 2, 1, 2)]
    return [
        Figure("first use on a machine: compiling, CPU", [runs[0][0]], "s", 30.0),
        Figure("later uses: loading, CPU", [seconds for seconds, _ in runs[1:]], "s", 3.0),
        Figure(
            "different bytes from 1 and 2 threads", [float(len({hashed for _, hashed in runs}) - 1)], "", 0.0
        ),
    ]


PARTS: dict[str, Callable[[argparse.Namespace], list[Figure]]] = {
    "kernels": kernels,
    "real-time": real_time,
    "memory": memory,
    "first-use": first_use,
}
