"""How trustworthy and how fast the simulator is, in figures.

python -m tools.bench.sim speed [MAP.yaml]      times real time, start-up, memory, where the time goes
python -m tools.bench.sim odometry [OUT.png]    error of wheels and gyro over 100 m, 20 seeds
python -m tools.bench.sim laser EXP1.dat.xz [OUT.png]   the laser beside a real one
python -m tools.bench.sim rays [SCANS]          against an independent 2-D caster
"""

import cProfile
import lzma
import math
import pstats
import sys
import time
from pathlib import Path

import numpy as np
import psutil
from numpy.typing import NDArray

from lemtomap.sim import worlds
from lemtomap.sim.body import BodyState
from lemtomap.sim.carmen import DeadReckoning
from lemtomap.sim.hokuyo import FIRST_STEP, LAST_STEP, SLITS
from lemtomap.sim.raster import clearance_m
from lemtomap.sim.simulator import Simulator
from lemtomap.sim.tours import (
    ScriptedTour,
    TourConfig,
    base_command,
    drive,
    plan_tour,
)
from lemtomap.sim.urg import ANGLES_RAD
from lemtomap.sim.world import World

RANGE_BINS_M = np.arange(0.0, 5.51, 0.5)
STREAM = b"MD0044072501000\n"


def speed(names: list[str]) -> None:
    """Print times real time of a driving, scanning robot without mapping."""
    for name in names:
        before_mb = psutil.Process().memory_info().rss / 1e6
        begin = time.process_time()
        world = worlds.load(name)
        simulator = Simulator(world, 0)
        started_s = time.process_time() - begin
        tour = plan_tour(world, 120.0)
        simulator.hokuyo.write(STREAM)
        begin = time.process_time()
        _drain(simulator, tour)
        cpu_s = time.process_time() - begin
        memory_mb = psutil.Process().memory_info().rss / 1e6 - before_mb
        print(
            f"{world.name}: {len(world.boxes)} boxes, start-up {started_s:.2f} s, "
            f"{simulator.now_s / cpu_s:.1f} times real time, +{memory_mb:.0f} MB (with the tour's planner)"
        )
        simulator.close()
        _profile(world, tour)


def _drain(simulator: Simulator, tour: ScriptedTour) -> None:
    for _ in drive(simulator, tour):
        simulator.kobuki.read()
        simulator.hokuyo.read()


def _profile(world: World, tour: ScriptedTour) -> None:
    """Print which share of the time rays, contacts and the rest take."""
    profile = cProfile.Profile()
    simulator, again = Simulator(world, 0), ScriptedTour(tour.path[:300])
    simulator.hokuyo.write(STREAM)
    profile.enable()
    _drain(simulator, again)
    profile.disable()
    simulator.close()
    stats = pstats.Stats(profile).stats  # type: ignore[attr-defined]
    total = sum(entry[2] for entry in stats.values())
    rays = sum(entry[3] for key, entry in stats.items() if key[2] in {"_cast", "measure"})
    physics = sum(entry[3] for key, entry in stats.items() if "body.py" in key[0] and key[2] == "step")
    print(
        f"  laser {rays / total:.0%}, body and contacts {physics / total:.0%}, the rest is protocol and glue"
    )


def odometry(picture: str | None) -> None:
    """Print the error of dead reckoning after 100 m of mixed driving and after ten turns on the spot."""
    world = worlds.load("offices:40:1")
    ends, turns, wheel_ends = [], [], []
    for seed in range(20):
        tour = plan_tour(world, 270.0, TourConfig(), seed)
        gyro, wheels, driven_m = _reckon(world, tour, seed)
        ends.append(100.0 * gyro / driven_m)
        wheel_ends.append(100.0 * wheels / driven_m)
        turns.append(_turn_error_deg(world, seed))
    print(f"wheels + gyro, end error over {driven_m:.0f} m: {_spread(ends)} % of distance")
    print(f"wheels alone: {_spread(wheel_ends)} % of distance")
    print(f"gyro heading error per turn on the spot: {_spread([abs(turn) for turn in turns])} degrees")
    if picture is not None:
        columns = {
            "end error over 100 m, % of distance": np.array(ends),
            "heading error per turn, degrees": np.array(turns),
        }
        _histograms(picture, columns)


def _spread(values: list[float]) -> str:
    array = np.array(values)
    low, middle, high = np.percentile(array, [10, 50, 90])
    return f"median {middle:.2f}, 10-90 % {low:.2f}-{high:.2f}"


def _reckon(world: World, tour: ScriptedTour, seed: int) -> tuple[float, float, float]:
    """Return the end errors of gyro odometry and of wheel odometry, and the distance, metres."""
    simulator = Simulator(world, seed)
    gyro, wheels = DeadReckoning(), DeadReckoning()
    start = simulator.truth().T_world_base
    for _ in drive(simulator, tour):
        simulator.kobuki.read()
        sent = simulator.base.last
        if sent is not None:
            readings = sent.readings
            gyro.update(readings.left_ticks, readings.right_ticks, readings.angle_cdeg)
            turned_m = (readings.right_ticks - readings.left_ticks) / 11724.41658 / 0.23
            wheels.update(readings.left_ticks, readings.right_ticks, round(math.degrees(turned_m) * 100))
    truth = simulator.truth()
    dx, dy = truth.T_world_base[:2] - start[:2]
    cos, sin = math.cos(start[2]), math.sin(start[2])
    true = np.array([cos * dx + sin * dy, -sin * dx + cos * dy])
    simulator.close()
    return (
        float(np.hypot(*(gyro.pose[:2] - true))),
        float(np.hypot(*(wheels.pose[:2] - true))),
        truth.path_m,
    )


def _turn_error_deg(world: World, seed: int) -> float:
    """Return the gyro's error per turn after ten turns on the spot, degrees."""
    simulator = Simulator(world, seed)
    start, heading, last = simulator.base.body.state.yaw, 0.0, None
    while simulator.base.body.state.yaw - start < 20 * math.pi:
        simulator.kobuki.write(base_command(0.0, 1.0))
        simulator.advance(simulator.now_s + 0.02)
        simulator.kobuki.read()
        sent = simulator.base.last
        if sent is not None:
            angle = sent.readings.angle_cdeg / 100.0
            heading += 0.0 if last is None else (angle - last + 180.0) % 360.0 - 180.0
            last = angle
    true = math.degrees(simulator.base.body.state.yaw - start)
    simulator.close()
    return (heading - true) / 10.0


def laser(real_path: str, picture: str | None) -> None:
    """Print and draw share of missing answers, ranges, noise and reach beside those of a real log."""
    with lzma.open(real_path) as file:
        real = np.loadtxt(file)[:, 24:706]
    scans = {"exp1.dat (real)": real}
    for name in ("office", "offices:20:1", "loop:0:1"):
        scans[name] = _scans(name)
    print(f"{'':18s} missing   code 0   codes   noise mm at 1 m, 2 m   reach m at 75, 55, 20 degrees off")
    for name, ranges in scans.items():
        lost, zero = (ranges < 20).mean(), (ranges == 0).mean()
        noise = [_noise_mm(ranges, low, low + 500) for low in (750, 1750)]
        reach = [_reach_m(ranges, low, high) for low, high in ((0.2, 0.3), (0.5, 0.65), (0.9, 1.01))]
        numbers = "  ".join(f"{value:.1f}" for value in noise + reach)
        print(f"{name:18s} {lost:7.1%}  {zero:7.1%}  {lost - zero:6.1%}   {numbers}")
    if picture is not None:
        _laser_picture(picture, scans)


def _scans(name: str) -> NDArray[np.float64]:
    world = worlds.load(name)
    simulator = Simulator(world, 0)
    simulator.hokuyo.write(STREAM)
    found: list[NDArray[np.int64]] = []
    last_s = -1.0
    for _ in drive(simulator, plan_tour(world, 75.0)):
        simulator.kobuki.read()
        simulator.hokuyo.read()
        turn = simulator.last_scan
        if turn is not None and turn.started_s != last_s:
            last_s = turn.started_s
            found.append(turn.ranges_mm[FIRST_STEP : LAST_STEP + 1])
    simulator.close()
    return np.array(found, dtype=np.float64)


def _walls(ranges: NDArray[np.float64], half: int = 10) -> NDArray[np.float64]:
    """Return straight pieces of wall, float64 (M, 3): range mm, scatter mm along beams, cos of incidence."""
    angles = np.arange(ranges.shape[1]) * 2 * math.pi / SLITS
    pieces = []
    for row in ranges[::3]:
        for begin in range(0, len(row) - 2 * half, half):
            span = slice(begin, begin + 2 * half)
            if (row[span] < 20).any():
                continue
            points = np.stack([row[span] * np.cos(angles[span]), row[span] * np.sin(angles[span])], axis=1)
            centred = points - points.mean(axis=0)
            normal = np.linalg.eigh(centred.T @ centred)[1][:, 0]
            middle = angles[begin + half]
            cos = abs(normal[0] * math.cos(middle) + normal[1] * math.sin(middle))
            residual = centred @ normal
            if cos > 0.15 and np.abs(residual).max() < 0.03 * row[span].mean() + 10.0:
                pieces.append((row[span].mean(), residual.std() / cos * math.sqrt(20 / 18), cos))
    return np.array(pieces)


def _noise_mm(ranges: NDArray[np.float64], low: float, high: float) -> float:
    pieces = _walls(ranges)
    here = (pieces[:, 0] >= low) & (pieces[:, 0] < high) & (pieces[:, 2] > 0.7)
    return float(np.median(pieces[here, 1]))


def _reach_m(ranges: NDArray[np.float64], low: float, high: float) -> float:
    pieces = _walls(ranges, 5)
    here = (pieces[:, 2] >= low) & (pieces[:, 2] < high)
    return float(np.percentile(pieces[here, 0], 98)) / 1000.0


def _laser_picture(path: str, scans: dict[str, NDArray[np.float64]]) -> None:
    import matplotlib as mpl  # noqa: PLC0415 - only for the picture

    mpl.use("Agg")
    from matplotlib import pyplot as plt  # noqa: PLC0415

    figure, axes = plt.subplots(1, 3, figsize=(12, 3.6), layout="constrained")
    for name, ranges in scans.items():
        style = {"color": "black", "lw": 2} if "real" in name else {"lw": 1}
        share = np.histogram(ranges[ranges >= 20] / 1000.0, RANGE_BINS_M)[0] / (ranges >= 20).sum()
        axes[0].stairs(share, RANGE_BINS_M, label=name, **style)
        pieces = _walls(ranges)
        pieces = pieces[pieces[:, 2] > 0.7]
        middles = np.arange(500.0, 3500.0, 500.0)
        noise = [np.median(pieces[np.abs(pieces[:, 0] - middle) < 250.0, 1]) for middle in middles]
        axes[1].plot(middles / 1000.0, noise, marker="o", ms=3, label=name, **style)
    names = list(scans)
    axes[2].barh(names, [(scans[name] < 20).mean() for name in names], color=["black", "C0", "C1", "C2"])
    axes[0].set(xlabel="range, m", ylabel="share of answers", title="ranges")
    axes[1].set(xlabel="range, m", ylabel="mm", title="scatter about straight walls", ylim=(0, None))
    axes[2].set(xlabel="share of beams", title="beams without answer")
    axes[0].legend(fontsize=7)
    figure.savefig(path, dpi=90)


def _histograms(path: str, columns: dict[str, NDArray[np.float64]]) -> None:
    import matplotlib as mpl  # noqa: PLC0415 - only for the picture

    mpl.use("Agg")
    from matplotlib import pyplot as plt  # noqa: PLC0415

    figure, axes = plt.subplots(1, len(columns), figsize=(4.5 * len(columns), 3), layout="constrained")
    for axis, (title, values) in zip(axes, columns.items(), strict=True):
        axis.hist(values, bins=10)
        axis.set(xlabel=title, ylabel="seeds")
    figure.savefig(path, dpi=90)


def rays(scans: int) -> None:
    """Compare every scan at random places of a 60-room office with a caster that knows only line segments."""
    world = worlds.load("offices:60")
    simulator = Simulator(world, 0)
    segments = segments_of(world, simulator.config.urg.height_m)
    rng = np.random.default_rng(0)
    cells = np.argwhere(clearance_m(world.raster) > 0.25)
    compared = left_out = wrong = 0
    worst_m = 0.0
    for row, col in cells[rng.integers(0, len(cells), scans)]:
        x, y = world.raster.point(int(row), int(col))
        yaw = float(rng.uniform(-math.pi, math.pi))
        ours = simulator.perfect_scan_m(BodyState(x, y, yaw))
        theirs = cast_segments(segments, (x, y), yaw + ANGLES_RAD, 5.6)
        smooth = ~(edges(ours) | edges(theirs))
        both = smooth & np.isfinite(ours) & np.isfinite(theirs)
        error = np.abs(ours[both] - theirs[both])
        compared += int(smooth.sum())
        left_out += int((~smooth).sum())
        wrong += int((error > 0.01).sum()) + int((smooth & (np.isfinite(ours) != np.isfinite(theirs))).sum())
        worst_m = max(worst_m, float(error.max(initial=0.0)))
    simulator.close()
    print(f"{scans} scans, {compared} beams compared, {left_out} at edges left out")
    print(f"beams off by more than 1 cm: {wrong}; largest difference {worst_m * 1000:.3f} mm")


def edges(ranges: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which beams have a neighbour at another depth."""
    filled = np.where(np.isfinite(ranges), ranges, 9.0)
    jump = np.abs(np.diff(filled)) > 0.05
    return np.asarray(np.append(jump, False) | np.insert(jump, 0, False))


def segments_of(world: World, height_m: float) -> NDArray[np.float64]:
    """Return the outlines of all boxes at a height, float64 (M, 4): x0 y0 x1 y1."""
    lines = []
    for box in world.boxes:
        if abs(box.centre[2] - height_m) > box.half[2]:
            continue
        cos, sin = math.cos(box.yaw_rad), math.sin(box.yaw_rad)
        corners = [
            (
                box.centre[0] + cos * u * box.half[0] - sin * v * box.half[1],
                box.centre[1] + sin * u * box.half[0] + cos * v * box.half[1],
            )
            for u, v in ((1, 1), (-1, 1), (-1, -1), (1, -1))
        ]
        lines += [(*a, *b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
    return np.array(lines)


def cast_segments(
    segments: NDArray[np.float64], origin: tuple[float, float], angles: NDArray[np.float64], reach_m: float
) -> NDArray[np.float64]:
    """Return distance to the nearest segment along each angle, float64 (N,), +inf beyond reach."""
    ax, ay = segments[:, 0] - origin[0], segments[:, 1] - origin[1]
    ex, ey = segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1]
    length = np.hypot(ex, ey)
    along = np.clip(-(ax * ex + ay * ey) / length**2, 0.0, 1.0)
    near = np.hypot(ax + along * ex, ay + along * ey) < reach_m
    ax, ay, ex, ey = ax[near], ay[near], ex[near], ey[near]
    dx, dy = np.cos(angles)[:, None], np.sin(angles)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        cross = dx * ey - dy * ex
        distance = (ax * ey - ay * ex) / cross
        share = (ax * dy - ay * dx) / cross
    distance = np.where((distance > 0.0) & (share >= 0.0) & (share <= 1.0), distance, np.inf)
    nearest = distance.min(axis=1, initial=np.inf)
    return np.asarray(np.where(nearest <= reach_m, nearest, np.inf))


def main(arguments: list[str]) -> int:
    """Run what was asked for."""
    what, rest = (arguments[0], arguments[1:]) if arguments else ("", [])
    if what == "speed":
        speed(["office", "offices:60", *(name for path in rest for name in (path, f"{path}@4"))])
    elif what == "odometry":
        odometry(rest[0] if rest else None)
    elif what == "laser" and rest and Path(rest[0]).exists():
        laser(rest[0], rest[1] if len(rest) > 1 else None)
    elif what == "rays":
        rays(int(rest[0]) if rest else 10_000)
    else:
        print(__doc__)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
