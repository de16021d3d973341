"""`lemtomap sim --nav metric`: the baseline alone, on the plan of the building as its saved grid."""

import re
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from lemtomap.baseline.whole_grid import GRID_ID
from lemtomap.errors import BadSetting
from lemtomap.nav.types import Goal, NavState
from lemtomap.robot.baseline import build_metric_core
from lemtomap.robot.exchange import MissionState
from lemtomap.robot.missions.missions import MissionInput, Order
from lemtomap.robot.output import files as outputs
from lemtomap.robot.output.progress import Bar
from lemtomap.robot.runs.lockstep import run_lockstep
from lemtomap.robot.runs.run import Teller
from lemtomap.robot.runs.sim_server import mounting_of
from lemtomap.robot.runs.simulated import SimOptions, truth_of
from lemtomap.sim import worlds
from lemtomap.sim.simulator import Simulator
from lemtomap.sim.world import World
from lemtomap.types import GridView

NUMBER = r"[-+]?[0-9]+(?:\.[0-9]*)?"
POINT = re.compile(f"goto:({NUMBER}):({NUMBER})")

Point = tuple[float, float]
"""x, y in metres, frame of the grid."""


class Points:
    """A mission that drives to points of a grid one after another."""

    def __init__(self, points: Sequence[Point]) -> None:
        self._points = list(points)
        self._now: Point | None = None
        self._asked_cycle = -1

    def step(self, moment: MissionInput) -> Order:
        """Give the next point when the last one is reached; fail when one is not."""
        now, state = self._now, moment.output.state
        fresh = moment.output.cycle > self._asked_cycle
        if now is not None and fresh and state is NavState.FAILED:
            return Order(MissionState.FAILED, f"{_text(now)} not reached: {moment.output.text}")
        if now is not None and not (fresh and state is NavState.ARRIVED):
            return Order(MissionState.RUNNING, f"going to {_text(now)}")
        if not self._points:
            return Order(MissionState.DONE, "all points reached")
        self._now, self._asked_cycle = self._points.pop(0), moment.output.cycle
        return Order(MissionState.RUNNING, f"going to {_text(self._now)}", goal=Goal(GRID_ID, self._now))


def parse_points(mission: str) -> list[Point]:
    """Return the points of `goto:X:Y` or several joined by commas. Raises BadSetting."""
    found = [POINT.fullmatch(part.strip()) for part in mission.split(",")]
    points = [(float(match[1]), float(match[2])) for match in found if match is not None]
    if len(points) < len(found):
        raise BadSetting(
            f"mission '{mission}': the metric planner takes goto:X:Y in metres, several joined by commas"
        )
    return points


def grid_of(world: World) -> GridView:
    """Return the plan of a building as a saved grid: the best map a metric planner could have."""
    raster = world.raster
    occupancy = np.where(raster.occupied, 100, np.where(raster.free, 0, -1)).astype(np.int8)
    return GridView(0.0, np.ascontiguousarray(occupancy), raster.resolution_m, raster.origin_m)


def run_metric(options: SimOptions, bar: Bar) -> dict[str, Any]:
    """Drive in lock-step; write and return the summary. Raises BadWorld, BadSetting."""
    world, points = worlds.load(options.world), parse_points(options.mission)
    for remark in world.remarks:
        bar.say(remark)
    if not options.fast:
        raise BadSetting("--nav metric: the baseline runs on the virtual clock only; add --fast")
    if options.out.exists() and not options.out.is_dir():
        raise BadSetting(f"{options.out}: is a file; --out needs a folder")
    mounting = mounting_of(options.config)
    simulator = Simulator(world, options.seed, gui=options.gui, mounting=mounting)
    core = build_metric_core(options.config, grid_of(world), world.spawn, seed=options.seed)
    begun_s = time.perf_counter()
    try:
        ended = run_lockstep(
            simulator,
            core,
            Points(points),
            options.duration_s,
            watch=Teller(bar, options.duration_s).look,
        )
        summary = {
            "world": options.world,
            "mission": options.mission,
            "nav": "metric",
            "seed": options.seed,
            "result": ended.state.value,
            "result_text": ended.text,
            "run_s": ended.now_s,
            **truth_of(simulator),
            "realtime_factor": ended.now_s / (time.perf_counter() - begun_s),
            "cpu_s": {part: getattr(core.efforts, part).cpu_s for part in ("base", "mapping", "navigation")},
        }
    finally:
        core.close()
        simulator.close()
    options.out.mkdir(parents=True, exist_ok=True)
    outputs.write_summary(options.out / "summary.json", summary)
    return summary


def told_after_metric(summary: dict[str, Any]) -> str:
    """Return two lines for the user."""
    cpu_s = summary["cpu_s"]
    return (
        f"{summary['result']}: {summary['result_text']}\n"
        f"{summary['true_path_m']:.1f} m driven in {summary['run_s']:.0f} s, {summary['contacts']} contacts; "
        f"CPU: planner {cpu_s['navigation']:.2f} s, AMCL {cpu_s['mapping']:.2f} s"
    )


def _text(point: Point) -> str:
    return f"{point[0]:g}, {point[1]:g}"
