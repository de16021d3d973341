"""Measure exploration: floor seen, and the way driven against a greedy explorer that knows the plan.

    lemtomap bench explore offices:30:1 --seeds 3
    lemtomap bench explore /data/maps/utexas_gdc_3/3.yaml --starts random --out runs/explore
    lemtomap bench explore offices:30:1 --depth

Runs in lock-step without recording. "Seen" is the share of the floor which the robot's body can reach that a
beam of its laser passed over, by the simulator's truth. The greedy explorer drives on the true plan to the
nearest floor it has not seen, looks all round with a noiseless laser of the same reach, and ends at the same
share. Results are kept: a run already in --out is not run again. Each contact is printed with the height of
what was touched: chairs' feet lie below the laser, only the depth camera shows them.
"""

import argparse
import json
import math
import tempfile
import time
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from lemtomap.robot.build import build_core
from lemtomap.robot.config import RobotConfig
from lemtomap.robot.missions.missions import parse_mission
from lemtomap.robot.runs.lockstep import run_lockstep
from lemtomap.robot.runs.simulated import camera_of
from lemtomap.sim import worlds
from lemtomap.sim.scene import TOWER_HIGH_M
from lemtomap.sim.simulator import Simulator
from lemtomap.sim.world import Box, World
from tools.bench.parts.mapping_runs import table
from tools.truth.floor_seen import (
    Floor,
    GreedyExplorer,
    Mask,
    random_start,
    reachable_floor,
    see_scan,
)

LOOK_EVERY_S = 0.4
TELL_EVERY_S = 120.0
WANTED_SHARE, WANTED_RATIO = 0.97, 1.6


@dataclass
class Result:
    """One exploration, measured."""

    world: str
    seed: int
    start: tuple[float, float, float]
    floor_m2: float
    state: str = ""
    text: str = ""
    time_s: float = 0.0
    share: float = 0.0
    path_m: float = 0.0
    greedy_m: float = 0.0
    contacts: int = 0
    cpu_s: float = 0.0
    depth: bool = False
    """With the depth camera."""
    touched: list[tuple[float, float, float, float]] = field(default_factory=list)
    """(time s, x m, y m, top of the nearest thing m) of each contact."""
    grown: list[tuple[float, float, float]] = field(default_factory=list)
    """(time s, path m, share seen) every two minutes."""

    @property
    def ratio(self) -> float:
        """Way driven over the greedy explorer's."""
        return self.path_m / self.greedy_m if self.greedy_m else float("nan")


class Onlooker:
    """Marks what the laser sees, by the truth."""

    def __init__(self, simulator: Simulator, floor: Floor, result: Result) -> None:
        self._simulator, self._floor, self._result = simulator, floor, result
        self.seen: Mask = np.zeros(floor.floor.shape, dtype=np.bool_)
        self.track: list[tuple[float, float]] = []
        self._look_s = self._tell_s = 0.0

    def __call__(self, now_s: float) -> None:
        """Look now and then; note each contact."""
        if self._simulator.truth().contact_count > len(self._result.touched):
            self._note_contact(now_s)
        scan = self._simulator.last_scan
        if now_s < self._look_s or scan is None:
            return
        self._look_s = now_s + LOOK_EVERY_S
        truth = self._simulator.truth()
        pose = truth.T_world_base
        self.track.append((float(pose[0]), float(pose[1])))
        see_scan(self.seen, self._floor.raster, pose, scan.ranges_mm)
        if now_s >= self._tell_s:
            self._tell_s = now_s + TELL_EVERY_S
            share = self._floor.share(self.seen)
            self._result.grown.append((round(now_s, 1), round(truth.path_m, 1), round(share, 4)))
            print(f"    {now_s:6.0f} s {truth.path_m:6.0f} m {100 * share:5.1f} % seen", flush=True)

    def _note_contact(self, now_s: float) -> None:
        """Tell where the robot touched what: below 0.25 m the laser sees nothing."""
        x, y, _ = self._simulator.truth().T_world_base
        box = min(self._simulator.world.boxes, key=lambda box: _away_m(box, float(x), float(y)))
        top_m = box.centre[2] + box.half[2]
        self._result.touched.append(
            (round(now_s, 1), round(float(x), 2), round(float(y), 2), round(top_m, 3))
        )
        print(f"    {now_s:6.0f} s contact at {x:.2f}, {y:.2f} with what is {top_m:.2f} m high", flush=True)


def _away_m(box: Box, x: float, y: float) -> float:
    """Return the level distance from a point to a box that the robot could run into, inf to any other."""
    if box.centre[2] - box.half[2] >= TOWER_HIGH_M:
        return math.inf
    dx, dy = x - box.centre[0], y - box.centre[1]
    cos, sin = math.cos(box.yaw_rad), math.sin(box.yaw_rad)
    along, across = abs(cos * dx + sin * dy) - box.half[0], abs(cos * dy - sin * dx) - box.half[1]
    return math.hypot(max(along, 0.0), max(across, 0.0))


def explore(world: World, seed: int, duration_s: float, out: Path, *, depth: bool = False) -> Result:
    """Explore one world from its start; draw what came of it."""
    floor = reachable_floor(world.raster, world.spawn[:2])
    area_m2 = float(np.count_nonzero(floor.floor)) * floor.cell_m**2
    result = Result(world.name, seed, world.spawn, round(area_m2, 1), depth=depth)
    simulator = Simulator(world, seed=seed)
    onlooker = Onlooker(simulator, floor, result)
    begin = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        core = build_core(RobotConfig(), Path(folder) / "map.lemto", durable=False, seed=seed)
        camera = camera_of(simulator, core) if depth else None

        def watch(now_s: float) -> None:
            if camera is not None:
                camera.poll(now_s)
            onlooker(now_s)

        ended = run_lockstep(simulator, core, parse_mission("explore"), duration_s, watch=watch)
        core.close()
    truth = simulator.truth()
    simulator.close()
    result.cpu_s = round(time.process_time() - begin, 1)
    result.state, result.text, result.time_s = str(ended.state), ended.text, round(ended.now_s, 1)
    result.share, result.path_m = floor.share(onlooker.seen), round(truth.path_m, 1)
    result.contacts = truth.contact_count
    print(
        f"    {result.time_s:6.0f} s {truth.path_m:6.0f} m {100 * result.share:5.1f} % seen: {result.text}",
        flush=True,
    )
    greedy = GreedyExplorer(floor, world.spawn[:2])
    result.greedy_m = round(greedy.explore(result.share), 1)
    picture(floor, onlooker, greedy, result, out)
    return result


def picture(floor: Floor, onlooker: Onlooker, greedy: GreedyExplorer, result: Result, path: Path) -> None:
    """Draw the floor seen and not seen, and both ways."""
    import matplotlib as mpl  # noqa: PLC0415

    mpl.use("Agg")
    from matplotlib import pyplot as plt  # noqa: PLC0415

    raster = floor.raster
    shown = np.full((*floor.floor.shape, 3), 0.85)
    shown[floor.floor & onlooker.seen] = 1.0
    shown[floor.floor & ~onlooker.seen] = (0.95, 0.35, 0.3)
    shown[raster.occupied] = 0.1
    (x0, y0), (rows, cols), step = raster.origin_m, floor.floor.shape, raster.resolution_m
    figure, axis = plt.subplots(figsize=(12, max(3.0, 12 * rows / cols + 0.5)), layout="constrained")
    axis.imshow(shown, origin="lower", extent=(x0, x0 + cols * step, y0, y0 + rows * step))
    axis.plot(*np.array(greedy.track).T, color="#999999", lw=0.8, label=f"greedy, {result.greedy_m:.0f} m")
    axis.plot(*np.array(onlooker.track).T, color="#1f77b4", lw=0.8, label=f"robot, {result.path_m:.0f} m")
    axis.plot(*result.start[:2], "o", color="#2a9d8f")
    axis.plot(*onlooker.track[-1], "s", color="#d62828")
    inner = np.argwhere(floor.floor)
    (r0, c0), (r1, c1) = inner.min(axis=0), inner.max(axis=0)
    axis.set_xlim(x0 + c0 * step - 1.0, x0 + c1 * step + 1.0)
    axis.set_ylim(y0 + r0 * step - 1.0, y0 + r1 * step + 1.0)
    axis.set_title(
        f"{result.world}, seed {result.seed}: {100 * result.share:.1f} % seen; {result.text}", fontsize=9
    )
    axis.legend(fontsize=8)
    figure.savefig(path, dpi=90)
    plt.close(figure)


def measured(name: str, seed: int, args: argparse.Namespace) -> Result:
    """Return one run's result, from the folder when it was run before."""
    label = (
        f"{Path(name).parent.name}_{Path(name).stem}" if name.endswith(".yaml") else name.replace(":", "-")
    )
    kept = args.out / f"{label}_{seed}{'_depth' if args.depth else ''}.json"
    if kept.exists():
        return Result(**json.loads(kept.read_text()))
    print(f"  {label}, seed {seed}", flush=True)
    world = replace(worlds.load(name), name=label)
    if args.starts == "random":
        world = replace(world, spawn=random_start(world.raster, np.random.default_rng(seed)))
    result = explore(world, seed, args.duration, kept.with_suffix(".png"), depth=args.depth)
    kept.write_text(json.dumps(asdict(result), indent=1))
    return result


def row(result: Result) -> list[str]:
    """Return a line of the table."""
    good = result.state == "done" and result.share >= WANTED_SHARE and result.ratio <= WANTED_RATIO
    values: list[Any] = [
        result.world,
        result.seed,
        f"{result.floor_m2:.0f} m2",
        f"{100 * result.share:.1f} %",
        f"{result.path_m:.0f} m",
        f"{result.greedy_m:.0f} m",
        f"{result.ratio:.2f}",
        f"{result.time_s / 60:.1f} min",
        result.contacts,
        f"{result.cpu_s:.0f} s",
        f"{result.state}: {result.text}",
        "yes" if good else "NO",
    ]
    return [str(value) for value in values]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("worlds", nargs="*", default=["offices:30:1"])
    parser.add_argument("--seeds", type=int, default=3, help="runs of each world")
    parser.add_argument("--first-seed", type=int, default=1)
    parser.add_argument("--starts", choices=["random", "own"], default="random")
    parser.add_argument("--depth", action="store_true", help="with the simulated depth camera")
    parser.add_argument("--duration", type=float, default=5400.0, metavar="S")
    parser.add_argument("--out", type=Path, default=Path("runs/explore"))
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    seeds = range(args.first_seed, args.first_seed + args.seeds)
    rows = [row(measured(name, seed, args)) for name in args.worlds for seed in seeds]
    header = [
        "world",
        "seed",
        "floor",
        "seen",
        "way",
        "greedy",
        "ratio",
        "time",
        "contacts",
        "CPU",
        "end",
        "met",
    ]
    print(table(header, rows))


if __name__ == "__main__":
    main()
