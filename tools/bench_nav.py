"""Measure navigation: planners on large maps, DWA, and the thesis' tasks against the metric baseline.

    python tools/bench_nav.py planner            first plan and re-plan on 2,000 to 1,000,000 nodes
    python tools/bench_nav.py dwa                 one control cycle's roll-outs
    python tools/bench_nav.py tasks --world office --seeds 2 --out runs/nav
                                                  topological against metric navigation, there and back twice

CPU is thread time. The tasks run in lock-step with the simulator; both navigators drive the same legs with
the same costmap, DWA and limits. They differ in what plans the route and what localises: topological map and
rolling window against AMCL and a field over the true grid map of the whole building.
"""

import argparse
import json
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from lemtomap import se2
from lemtomap.nav.amcl.localiser import Amcl
from lemtomap.nav.amcl.whole_grid import GOAL_ID, WholeGridPlanner
from lemtomap.nav.config import BodyLimits, DwaConfig, RouteConfig
from lemtomap.nav.costmap import Costs
from lemtomap.nav.metric import plan_to
from lemtomap.nav.motion.dwa import choose_twist
from lemtomap.nav.navigator import Navigator
from lemtomap.nav.route.network import RouteNetwork
from lemtomap.nav.types import Goal, NavState
from lemtomap.types import EdgeTable, GridView, Twist
from robot.base import BaseStep
from robot.build import build_core
from robot.config import RobotConfig
from robot.core import RobotCore
from robot.exchange import Exchange, MissionState, TimedScan
from robot.lockstep import run_lockstep
from robot.missions import Moment, Order, parse_mission
from robot.navigating import NavigationStep
from sim import worlds
from sim.simulator import Simulator
from sim.world import World


def city(nodes: int) -> tuple[EdgeTable, int]:
    """Return a town of corridors with a node each metre and near-neighbour edges, and its node count."""
    rng = np.random.default_rng(0)
    side = int(np.sqrt(nodes))
    ids = np.arange(1, side * side + 1).reshape(side, side)
    across = rng.random((side - 1, side)) < 0.35
    a = np.concatenate([ids[:, :-1].ravel(), ids[:-1][across], ids[:, :-2].ravel()])
    b = np.concatenate([ids[:, 1:].ravel(), ids[1:][across], ids[:, 2:].ravel()])
    length = np.where(b - a == 2, 1.95, 1.0) * rng.uniform(1.0, 1.3, a.size)
    order = np.argsort(np.maximum(a, b), kind="stable")
    length_m, time_s = length[order].astype(np.float32), (length[order] / 0.4).astype(np.float32)
    table = EdgeTable(np.arange(1, a.size + 1), a[order], b[order], length_m, time_s, np.zeros(a.size))
    return table, side**2


def bench_planner() -> None:
    rng = np.random.default_rng(1)
    print("    nodes     edges  load s  first plan ms: median   worst  re-plan ms")
    for nodes in (2_000, 100_000, 1_000_000):
        table, count = city(nodes)
        begin = time.thread_time()
        network = RouteNetwork(table, RouteConfig())
        load_s = time.thread_time() - begin
        network.plan(1, 2, 0.0)  # compile
        pairs = [(1, count), *(tuple(int(i) for i in rng.integers(1, count, 2)) for _ in range(14))]
        first, again = [], []
        for start, goal in pairs:
            begin = time.thread_time()
            route = network.plan(start, goal, 0.0)
            first.append(time.thread_time() - begin)
            shut = {route.edges[min(5, len(route.edges) - 1)].edge_id: 10.0}
            begin = time.thread_time()
            network.plan(start, goal, 0.0, shut)
            again.append(time.thread_time() - begin)
        again = again[1:]  # the first one compiles
        print(
            f"{count:>9} {table.edge_id.size:>9} {load_s:>7.2f} {1e3 * np.median(first):>22.1f} "
            f"{1e3 * max(first):>7.1f} {1e3 * max(again):>11.2f}"
        )


def bench_dwa() -> None:
    rng = np.random.default_rng(0)
    state = np.where(rng.random((400, 400)) < 0.004, 2, 0).astype(np.uint8)
    state[190:210, 190:210] = 0
    from lemtomap.nav import kernels  # noqa: PLC0415 - only this bench needs the raw kernels

    def build() -> Costs:
        clearance = kernels.clearance_transform(state, 15.6)
        cost = kernels.traversal_cost(state, clearance, 4.1, 4.0, 2.4, 4.0)
        return Costs(0.0, 0.05, (0.0, 0.0), state, clearance, cost)

    costs = build()
    here = se2.pose(10.0, 10.0, 0.3)
    plan = plan_to(costs, here, (360, 360))
    if plan is None:
        raise SystemExit("the bench's random world has no way: change its seed")
    body, dwa = BodyLimits(), DwaConfig()
    parts: list[tuple[str, Callable[[], object]]] = [
        ("costmap 400 x 400", build),
        ("field and path to a target 11 m away", lambda: plan_to(costs, here, (360, 360))),
        ("DWA", lambda: choose_twist(plan, here, Twist(0.3, 0.2), None, body, dwa)),
    ]
    for name, call in parts:
        call()
        taken = []
        for _ in range(50):
            begin = time.thread_time()
            call()
            taken.append(time.thread_time() - begin)
        print(
            f"{name:40} median {1e3 * np.median(taken):6.2f} ms, p99 {1e3 * np.quantile(taken, 0.99):6.2f} ms"
        )
    print(f"trajectories: {choose_twist(plan, here, Twist(0.3, 0.2), None, body, dwa).tried}")


@dataclass
class Leg:
    """One task from one place to another, as it was driven."""

    kind: str
    seed: int
    number: int
    state: str = ""
    time_s: float = 0.0
    path_m: float = 0.0
    first_plan_ms: float = 0.0
    planner_cpu_s: float = 0.0
    stops: int = 0
    contacts: int = 0
    v_mps: list[float] = field(default_factory=list)


class Meter:
    """Adds up the CPU time of some calls."""

    def __init__(self) -> None:
        self.total_s = 0.0
        self.first_s: float | None = None

    def timed(self, call: Callable[..., Any]) -> Callable[..., Any]:
        """Return the same call, measured."""

        def measured(*args: object, **kwargs: object) -> Any:
            begin = time.thread_time()
            try:
                return call(*args, **kwargs)
            finally:
                taken = time.thread_time() - begin
                self.total_s += taken
                self.first_s = taken if self.first_s is None else self.first_s

        return measured


class Legs:
    """A mission that drives given goals one after another and writes down each leg."""

    def __init__(self, kind: str, seed: int, simulator: Simulator, meters: tuple[Meter, Meter]) -> None:
        self.done: list[Leg] = []
        self.ends: list[tuple[float, float]] = []
        self._kind, self._seed, self._simulator = kind, seed, simulator
        self._route_meter, self._cycle_meter = meters
        self._leg: Leg | None = None
        self._begun = (0.0, 0.0, 0)
        self._cycle = self._goal_id = 0

    def begin(self, now_s: float, cycle: int, goal_id: int) -> None:
        """Start to write down a leg."""
        self._goal_id = goal_id
        truth = self._simulator.truth()
        self._leg = Leg(self._kind, self._seed, len(self.done))
        self._begun = (now_s, truth.path_m, truth.contact_count)
        self._route_meter.first_s, self._cycle_meter.total_s = None, 0.0
        self._cycle = cycle

    def watch(self, moment: Moment) -> bool:
        """Take one cycle; True when the leg is over."""
        leg = self._leg
        if leg is None or moment.output.cycle <= self._cycle:
            return False
        leg.v_mps.append(round(moment.output.twist.v_mps, 3))
        if moment.output.state not in {NavState.ARRIVED, NavState.FAILED}:
            return False
        truth = self._simulator.truth()
        leg.state = str(moment.output.state)
        leg.time_s, leg.path_m = moment.now_s - self._begun[0], truth.path_m - self._begun[1]
        leg.contacts = truth.contact_count - self._begun[2]
        leg.first_plan_ms = 1e3 * (self._route_meter.first_s or 0.0)
        leg.planner_cpu_s = self._cycle_meter.total_s
        leg.stops = stops(leg.v_mps)
        self.done.append(leg)
        goal_id = self._goal_id if self._goal_id in moment.view.T_grid_node else moment.view.associated_id
        T_base_goal = se2.between(moment.view.T_grid_base, moment.view.T_grid_node[goal_id])
        T_world_goal = se2.compose(truth.T_world_base, T_base_goal)
        self.ends.append((float(T_world_goal[0]), float(T_world_goal[1])))
        self._leg = None
        return True


def stops(v_mps: Sequence[float]) -> int:
    """Count how often the robot came to rest between setting off and the last half metre of braking."""
    v = np.array(v_mps)
    moving = np.flatnonzero(v > 0.2)
    if moving.size == 0:
        return 0
    inner = v[moving[0] : moving[-1]]
    return int(((inner[1:] < 0.05) & (inner[:-1] >= 0.05)).sum())


class TopoTour:
    """Explore, then drive start - far - start - far over the topological map."""

    def __init__(self, legs: Legs, goals: Sequence[str]) -> None:
        self._explore, self._legs, self._goals = parse_mission("explore,goto:start"), legs, list(goals)
        self._exploring = True

    def step(self, moment: Moment) -> Order:
        """Return what to do now."""
        from robot.missions import resolve  # noqa: PLC0415

        if self._exploring:
            order = self._explore.step(moment)
            if order.state is not MissionState.DONE:
                return order
            self._exploring = False
        elif not self._legs.watch(moment):
            return Order(MissionState.RUNNING, f"leg {len(self._legs.done)}")
        if not self._goals:
            return Order(MissionState.DONE)
        node_id = resolve(self._goals.pop(0), moment)
        if node_id is None:
            return Order(MissionState.FAILED, "no such node")
        if self._goals:  # `far` is the same place each time
            self._goals = [str(node_id) if goal == "far" else goal for goal in self._goals]
        self._legs.begin(moment.now_s, moment.output.cycle, node_id)
        return Order(MissionState.RUNNING, "leg", Goal(node_id))


class MetricTour:
    """Drive to the same points over the whole grid."""

    def __init__(self, legs: Legs, planner: WholeGridPlanner, points: Sequence[tuple[float, float]]) -> None:
        self._legs, self._planner, self._points = legs, planner, list(points)
        self._begun = False

    def step(self, moment: Moment) -> Order:
        """Return what to do now."""
        over = self._legs.watch(moment)
        if self._begun and not over:
            return Order(MissionState.RUNNING)
        self._begun = True
        if not self._points:
            return Order(MissionState.DONE)
        self._planner.set_goal(self._points.pop(0))
        self._legs.begin(moment.now_s, moment.output.cycle, GOAL_ID)
        self._planner.renew(moment.view.T_grid_base, moment.now_s)
        return Order(MissionState.RUNNING, "leg", Goal(GOAL_ID))


class AmclMapping:
    """Stands in for the mapping part: AMCL on the saved grid, and the global plan once a second."""

    def __init__(self, amcl: Amcl, planner: WholeGridPlanner, exchange: Exchange) -> None:
        self._amcl, self._planner, self._exchange = amcl, planner, exchange

    def step(self, timed: TimedScan) -> None:
        """Localise with one scan and publish the window."""
        T_grid_odom = self._amcl.update(timed.sighting.hits_base, timed.sighting.T_odom_base)
        T_grid_base = self._amcl.T_grid_base
        self._planner.renew(T_grid_base, timed.scan.stamp_s)
        self._exchange.map_view.put(self._planner.view(T_grid_odom, T_grid_base, timed.scan.stamp_s))

    def close(self) -> None:
        """Nothing to write."""


class _NoFile:
    """The way points as NavigationStep wants a graph."""

    def __init__(self, planner: WholeGridPlanner) -> None:
        way = planner.way
        self.has_node, self.edges_of, self._way = way.has_node, way.edges_of, way

    @property
    def version(self) -> int:
        return self._way.version

    def node_of(self, name: str) -> int | None:  # noqa: ARG002
        return None

    def close(self) -> None:
        pass


def topological(world: World, seed: int, folder: Path) -> Legs:
    simulator = Simulator(world, seed=seed)
    core = build_core(RobotConfig(), folder / f"topo{seed}.lemto", durable=False, seed=seed)
    meters = Meter(), Meter()
    navigator = core.navigation.navigator
    routes = navigator._way._planner  # noqa: SLF001 - measured from outside on purpose
    routes.plan = meters[0].timed(routes.plan)  # type: ignore[method-assign]
    navigator.step = meters[1].timed(navigator.step)  # type: ignore[method-assign]
    legs = Legs("topological", seed, simulator, meters)
    ended = run_lockstep(simulator, core, TopoTour(legs, ["far", "start", "far", "start"]), 3600.0)
    print(f"  topological, seed {seed}: {ended.state}, {ended.text}, {ended.now_s:.0f} s simulated")
    core.close()
    simulator.close()
    return legs


def metric(world: World, seed: int, points: Sequence[tuple[float, float]]) -> Legs:
    simulator = Simulator(world, seed=seed)
    raster = world.raster
    occupancy = np.where(raster.occupied, 100, np.where(raster.free, 0, -1)).astype(np.int8)
    grid = GridView(0.0, np.ascontiguousarray(occupancy), raster.resolution_m, raster.origin_m)
    config, exchange = RobotConfig(), Exchange()
    planner = WholeGridPlanner(grid, config.nav)
    meters = Meter(), Meter()
    navigator = Navigator(config.nav)
    planner.renew = meters[0].timed(planner.renew)  # type: ignore[method-assign]
    cycle = meters[1]
    planner.renew, navigator.step = cycle.timed(planner.renew), cycle.timed(navigator.step)  # type: ignore[method-assign]
    mapping = AmclMapping(Amcl(grid, np.array(world.spawn), seed=seed), planner, exchange)
    navigation = NavigationStep(navigator, exchange, lambda: _NoFile(planner))
    core = RobotCore(exchange, BaseStep(config, exchange), mapping, navigation)  # type: ignore[arg-type]
    legs = Legs("metric", seed, simulator, meters)
    ended = run_lockstep(simulator, core, MetricTour(legs, planner, points), 1800.0)
    print(f"  metric, seed {seed}: {ended.state}, {ended.now_s:.0f} s simulated")
    simulator.close()
    return legs


def bench_tasks(name: str, seeds: int, out: Path) -> None:
    world = worlds.load(name)
    legs: list[Leg] = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(seeds):
            mine = topological(world, seed, Path(folder))
            legs += mine.done
            # The baseline starts at the spawn point, so its way to the first goal is the same task.
            legs += metric(world, seed, mine.ends).done
    out.mkdir(parents=True, exist_ok=True)
    (out / "nav_tasks.json").write_text(json.dumps([asdict(leg) for leg in legs], indent=1))
    report(legs)
    picture(legs, out / "nav_velocity.png")


def report(legs: Sequence[Leg]) -> None:
    print("                legs reached   time s   way m 1st plan ms planner CPU s stops contacts")
    for leg in legs:
        print(f"  {leg.kind} {leg.seed}.{leg.number} {leg.state} {leg.time_s:.1f} s {leg.path_m:.2f} m")
    means = {}
    for kind in ("topological", "metric"):
        mine = [leg for leg in legs if leg.kind == kind]
        values = [
            float(np.mean([getattr(leg, name) for leg in mine]))
            for name in ("time_s", "path_m", "first_plan_ms", "planner_cpu_s")
        ]
        means[kind] = values
        reached = sum(leg.state == "arrived" for leg in mine)
        count = f"{kind:14}{len(mine):>6}{reached:>8}"
        means_text = f"{values[0]:>9.1f}{values[1]:>8.2f}{values[2]:>12.2f}{values[3]:>14.2f}"
        bad = f"{sum(leg.stops for leg in mine):>6}{sum(leg.contacts for leg in mine):>9}"
        print(count + means_text + bad)
    ratios = [100.0 * (a / b - 1.0) for a, b in zip(means["topological"], means["metric"], strict=True)]
    print(f"{'difference':28}{ratios[0]:>+8.1f}%{ratios[1]:>+7.1f}%{ratios[2]:>+11.1f}%{ratios[3]:>+13.1f}%")


def picture(legs: Sequence[Leg], path: Path) -> None:
    """Draw the velocity over time of the longest leg of each kind (Figure 5-13)."""
    import matplotlib as mpl  # noqa: PLC0415

    mpl.use("Agg")
    import matplotlib.pyplot as plt  # noqa: PLC0415

    figure, axes = plt.subplots(2, 1, figsize=(9, 5), sharex=True, sharey=True)
    for axis, kind in zip(axes, ("topological", "metric"), strict=True):
        mine = [leg for leg in legs if leg.kind == kind]
        if mine:
            leg = max(mine, key=lambda leg: leg.time_s)
            axis.plot(0.1 * np.arange(len(leg.v_mps)), leg.v_mps)
        axis.set_title(kind)
        axis.set_ylabel("v [m/s]")
    axes[1].set_xlabel("time [s]")
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=["planner", "dwa", "tasks"])
    parser.add_argument("--world", default="office")
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("runs/nav"))
    args = parser.parse_args()
    if args.what == "planner":
        bench_planner()
    elif args.what == "dwa":
        bench_dwa()
    else:
        bench_tasks(args.world, args.seeds, args.out)


if __name__ == "__main__":
    main()
