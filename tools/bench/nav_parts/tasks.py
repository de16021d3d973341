"""The thesis' navigation tasks (5-2-2): there and back twice, topological against metric, side by side.

The robot is led there and back once; then it drives the way by itself over its own topological map. The
baseline drives between the same places with AMCL and a field over the true plan of the whole building,
starting where and as the topological robot did. Costmap, near look, DWA, limits and recoveries are the same.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from lemtomap import se2
from lemtomap.baseline.whole_grid import GRID_ID
from lemtomap.nav.types import Goal, NavState
from lemtomap.robot.baseline import build_metric_core
from lemtomap.robot.config import RobotConfig
from lemtomap.robot.core import RobotCore
from lemtomap.robot.exchange import MissionState
from lemtomap.robot.missions.missions import MissionInput, Order
from lemtomap.robot.runs.metric import grid_of
from lemtomap.robot.runs.warmup import warm_up
from lemtomap.sim import worlds
from lemtomap.sim.simulator import Simulator
from lemtomap.sim.tours import plan_errand
from lemtomap.sim.world import World
from tools.bench.nav_parts.lead import Meter, Rig, rig_of

KINDS = ("topological", "metric")
LEG_LIMIT_S = 900.0


@dataclass
class Leg:
    """One task from one place to another, as it was driven."""

    kind: str
    world: str
    seed: int
    number: int
    state: str = ""
    text: str = ""
    time_s: float = 0.0
    path_m: float = 0.0
    first_plan_ms: float = 0.0
    planner_cpu_s: float = 0.0
    stops: int = 0
    contacts: int = 0
    v_mps: list[float] = field(default_factory=list)
    """Velocity wanted, each 0.1 s."""


class Legs:
    """A mission that drives goals one after another and writes down each leg."""

    def __init__(
        self,
        leg: Leg,
        simulator: Simulator,
        meters: tuple[Meter, Meter],
        goals: Sequence[Goal],
        ends: Sequence[tuple[float, float]],
    ) -> None:
        self.done: list[Leg] = []
        self.ends = list(ends)
        """Where each goal truly lies, world metres: as seen on arrival, else as given."""
        self._like, self._simulator, self._goals = leg, simulator, list(goals)
        self._first_meter, self._cycle_meter = meters
        self._leg: Leg | None = None
        self._goal = Goal(0)
        self._begun = (0.0, 0.0, 0)
        self._cycle = 0

    def step(self, moment: MissionInput) -> Order:
        """Give the next goal when the last one is over."""
        if self._leg is not None and not self._watch(self._leg, moment):
            return Order(MissionState.RUNNING, f"leg {len(self.done)}")
        if not self._goals:
            return Order(MissionState.DONE)
        self._goal = self._goals.pop(0)
        truth = self._simulator.truth()
        self._leg = Leg(self._like.kind, self._like.world, self._like.seed, len(self.done))
        self._begun = (moment.now_s, truth.path_m, truth.contact_count)
        self._first_meter.first_s, self._cycle_meter.total_s = None, 0.0
        self._cycle = moment.output.cycle
        return Order(MissionState.RUNNING, f"leg {len(self.done)}", self._goal)

    def _watch(self, leg: Leg, moment: MissionInput) -> bool:
        """Take one cycle; True when the leg is over."""
        if moment.output.cycle <= self._cycle:
            return False
        leg.v_mps.append(round(moment.output.twist.v_mps, 3))
        if moment.output.state not in {NavState.ARRIVED, NavState.FAILED}:
            return False
        truth = self._simulator.truth()
        leg.state, leg.text = str(moment.output.state), moment.output.text
        leg.time_s, leg.path_m = moment.now_s - self._begun[0], truth.path_m - self._begun[1]
        leg.contacts = truth.contact_count - self._begun[2]
        leg.first_plan_ms = 1e3 * (self._first_meter.first_s or 0.0)
        leg.planner_cpu_s = self._cycle_meter.total_s
        leg.stops = stops(leg.v_mps)
        if moment.output.state == NavState.ARRIVED:
            self._note_end(leg.number, moment)
        self.done.append(leg)
        self._leg = None
        return True

    def _note_end(self, number: int, moment: MissionInput) -> None:
        view = moment.view
        node_id = self._goal.node_id if self._goal.node_id in view.T_grid_node else view.associated_id
        T_grid_goal = se2.compose(view.T_grid_node[node_id], [*self._goal.p_node, 0.0])
        T_base_goal = se2.between(view.T_grid_base, T_grid_goal)
        x, y, _ = se2.compose(self._simulator.truth().T_world_base, T_base_goal)
        self.ends[number] = float(x), float(y)


def stops(v_mps: Sequence[float]) -> int:
    """Count how often the robot came to rest between setting off and the last half metre of braking."""
    v = np.array(v_mps)
    moving = np.flatnonzero(v > 0.2)
    if moving.size == 0:
        return 0
    inner = v[moving[0] : moving[-1]]
    return int(((inner[1:] < 0.05) & (inner[:-1] >= 0.05)).sum())


def run_pair(name: str, metres: float, seed: int, folder: Path) -> list[Leg]:
    """Drive one errand of about so many metres there and back twice, with both kinds of navigation."""
    world = worlds.load(name)
    errand = plan_errand(world, metres).path
    quarter = len(errand) // 4
    rig = rig_of(world, seed, folder)
    rig.lead(errand[: 2 * quarter])
    start = rig.simulator.truth().T_world_base.copy()
    far, home = rig.nearest_node(errand[quarter]), rig.nearest_node(errand[0])
    goals = {far: errand[quarter], home: errand[0]}
    topological, ends = _topological(rig, Leg("topological", name, seed, 0), goals)
    rig.close()
    return [*topological, *_metric(world, start, ends, Leg("metric", name, seed, 0))]


def _topological(
    rig: Rig, leg: Leg, places: Mapping[int, tuple[float, float]]
) -> tuple[list[Leg], list[tuple[float, float]]]:
    """Drive from node to node, twice round; places: about where they lie, world metres."""
    meters = Meter(), Meter()
    navigator = rig.core.navigation.navigator
    routes = navigator._way._planner  # noqa: SLF001 - measured from outside on purpose
    routes.plan = meters[0].timed(routes.plan)  # type: ignore[method-assign]
    navigator.step = meters[1].timed(navigator.step)  # type: ignore[method-assign]
    goals = [Goal(node_id) for node_id in places] * 2
    legs = Legs(leg, rig.simulator, meters, goals, list(places.values()) * 2)
    rig.run(legs, LEG_LIMIT_S * len(goals))
    return legs.done, legs.ends


def _metric(world: World, start: Any, ends: Sequence[tuple[float, float]], leg: Leg) -> list[Leg]:
    x, y, yaw = (float(value) for value in start)
    simulator = Simulator(replace(world, spawn=(x, y, yaw)), seed=leg.seed)
    core = build_metric_core(RobotConfig(), grid_of(world), start, seed=leg.seed)
    legs = drive_metric(core, simulator, leg, ends)
    simulator.close()
    return legs.done


def drive_metric(
    core: RobotCore, simulator: Simulator, leg: Leg, ends: Sequence[tuple[float, float]]
) -> Legs:
    """Drive to points of the grid one after another; the first plan is the search without its costmap."""
    meters = Meter(), Meter()
    navigator = core.navigation.navigator
    look = navigator.lookout.far
    look._search = meters[0].timed(look._search)  # type: ignore[attr-defined]  # noqa: SLF001
    navigator.step = meters[1].timed(navigator.step)  # type: ignore[method-assign]
    legs = Legs(leg, simulator, meters, [Goal(GRID_ID, end) for end in ends], ends)
    Rig(simulator, core).run(legs, LEG_LIMIT_S * len(ends))
    return legs


def bench_tasks(name: str, metres: float, seeds: Sequence[int], out: Path) -> list[Leg]:
    """Run what of these seeds is not in the file yet, print and keep all legs."""
    out.mkdir(parents=True, exist_ok=True)
    told = out / "nav_tasks.json"
    legs = [Leg(**leg) for leg in json.loads(told.read_text())] if told.exists() else []
    warm_up(RobotConfig())
    for seed in seeds:
        if any(leg.seed == seed and leg.world == name for leg in legs):
            continue
        legs += run_pair(name, metres, seed, out)
        told.write_text(json.dumps([asdict(leg) for leg in legs], indent=None))
        report([leg for leg in legs if leg.world == name])
    mine = [leg for leg in legs if leg.world == name]
    report(mine)
    picture(mine, out / "nav_velocity.png")
    return mine


def report(legs: Sequence[Leg]) -> dict[str, list[float]]:
    """Print the legs and their means; return per kind time s, way m, first plan ms, planner CPU s.

    Means are over the legs that both kinds of navigation drove to their end.
    """
    arrived = [
        {(leg.world, leg.seed, leg.number) for leg in legs if leg.kind == kind and leg.state == "arrived"}
        for kind in KINDS
    ]
    both = arrived[0] & arrived[1]
    for leg in legs:
        print(
            f"  {leg.kind:11} {leg.seed}.{leg.number} {leg.state} {leg.time_s:.1f} s {leg.path_m:.2f} m "
            f"{leg.planner_cpu_s:.2f} s CPU, first {leg.first_plan_ms:.2f} ms, {leg.stops} stops, "
            f"{leg.contacts} contacts" + (f" ({leg.text})" if leg.state != "arrived" else "")
        )
    print("                legs reached   time s   way m 1st plan ms planner CPU s stops contacts")
    means = {}
    for kind in KINDS:
        mine = [leg for leg in legs if leg.kind == kind]
        driven = [leg for leg in mine if (leg.world, leg.seed, leg.number) in both]
        means[kind] = values = [
            float(np.mean([getattr(leg, name) for leg in driven] or [np.nan]))
            for name in ("time_s", "path_m", "first_plan_ms", "planner_cpu_s")
        ]
        reached = sum(leg.state == "arrived" for leg in mine)
        print(
            f"{kind:14}{len(mine):>6}{reached:>8}{values[0]:>9.1f}{values[1]:>8.2f}{values[2]:>12.2f}"
            f"{values[3]:>14.2f}{sum(leg.stops for leg in mine):>6}{sum(leg.contacts for leg in mine):>9}"
        )
    ratios = [100.0 * (a / b - 1.0) for a, b in zip(*means.values(), strict=True)]
    print(
        f"{'difference':28}{ratios[0]:>+8.1f}%{ratios[1]:>+7.1f}%{ratios[2]:>+11.1f}%{ratios[3]:>+13.1f}%",
        flush=True,
    )
    return means


def picture(legs: Sequence[Leg], path: Path) -> None:
    """Draw velocity and distance over time of the same leg with both kinds (Figure 5-13)."""
    from matplotlib.figure import Figure  # noqa: PLC0415

    longest = max((leg for leg in legs if leg.kind == "topological"), key=lambda leg: leg.time_s)
    figure = Figure(figsize=(11, 3.6), dpi=110, layout="constrained")
    speed, way = figure.subplots(1, 2, width_ratios=(2, 1))
    for kind, colour in zip(KINDS, ("#1d5fa8", "#c0392b"), strict=True):
        leg = next(
            leg for leg in legs if (leg.kind, leg.seed, leg.number) == (kind, longest.seed, longest.number)
        )
        time_s = 0.1 * np.arange(len(leg.v_mps))
        speed.plot(time_s, leg.v_mps, color=colour, label=kind, linewidth=1)
        way.plot(time_s, 0.1 * np.cumsum(leg.v_mps), color=colour, label=kind)
    speed.set(xlabel="time (s)", ylabel="velocity (m/s)", ylim=(0, None))
    way.set(xlabel="time (s)", ylabel="way (m)", ylim=(0, None))
    speed.legend(fontsize=8)
    figure.savefig(path)
