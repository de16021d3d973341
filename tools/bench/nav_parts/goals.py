"""Random goals in a building the robot was led through once: reached, rightly refused, or not.

A goal is a node, or a point given beside a node; one in ten is a point no robot of this size comes to,
which it must refuse. Contacts are those of the simulator's physics. People, if any, walk between random
places and give way at the last moment.
"""

import json
import math
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from lemtomap import se2
from lemtomap.nav.types import Goal, NavState
from lemtomap.robot.config import RobotConfig
from lemtomap.robot.exchange import MissionState
from lemtomap.robot.missions.missions import MissionInput, Order
from lemtomap.robot.runs.warmup import warm_up
from lemtomap.sim import worlds
from lemtomap.sim.movers import Person
from lemtomap.sim.raster import clearance_m
from lemtomap.sim.route import FloorRoutePlanner
from lemtomap.sim.world import World
from tools.bench.nav_parts.lead import Rig, rig_of, round_trip

BODY_M = 0.18
SPARE_M = 0.06  # where less room than this is left beside the body, both verdicts are right
POINT_REACH_M = 1.5  # a point goal lies this near to a node
TRUE_M = 0.5  # an arrival further off than this in truth is none
UNREACHABLE_SHARE = 0.1
NODE_SHARE = 0.5  # of the others
GOAL_LIMIT_S = 900.0


@dataclass
class Verdict:
    """One goal and what came of it."""

    world: str
    seed: int
    number: int
    people: int
    wanted: str
    """reach, refuse or either."""
    point: tuple[float, float]
    state: str = ""
    text: str = ""
    time_s: float = 0.0
    path_m: float = 0.0
    off_m: float = 0.0
    contacts: int = 0
    pushed: int = 0
    """Contacts while the robot itself was moving towards what it touched."""

    @property
    def right(self) -> bool:
        """Return True if it did what was wanted."""
        reached = self.state == "arrived" and self.off_m <= TRUE_M
        return reached if self.wanted == "reach" else self.state == "failed" or self.wanted == "either"


class Floor:
    """What of a building a robot of this size can come to, in truth."""

    def __init__(self, world: World) -> None:
        raster = world.raster
        self._raster, clear = raster, clearance_m(raster)
        row, col = raster.cell(world.spawn[0], world.spawn[1])
        self.surely, self.perhaps = (_joined(clear >= BODY_M + spare, row, col) for spare in (SPARE_M, -0.02))
        self._never = ndimage.distance_transform_edt(~self.perhaps) * raster.resolution_m

    def wanted(self, point: Sequence[float]) -> str:
        """Return whether a point is to be reached, refused, or may be either."""
        cell = self._raster.cell(point[0], point[1])
        if not (0 <= cell[0] < self.surely.shape[0] and 0 <= cell[1] < self.surely.shape[1]):
            return "refuse"
        if self.surely[cell]:
            return "reach"
        return "refuse" if self._never[cell] > TRUE_M else "either"

    def cells(self) -> NDArray[np.int64]:
        """Return [row, col] of the cells (N, 2) that are surely within reach."""
        return np.argwhere(self.surely)


def _joined(passable: NDArray[np.bool_], row: int, col: int) -> NDArray[np.bool_]:
    labels, _ = ndimage.label(passable)
    return np.asarray(labels == labels[row, col]) & passable


def choose_goals(rig: Rig, floor: Floor, count: int, seed: int) -> list[tuple[Goal, tuple[float, float]]]:
    """Return random goals, each with where it truly lies."""
    rng = np.random.default_rng(1000 + seed)
    nodes = sorted(rig.T_world_node)
    goals: list[tuple[Goal, tuple[float, float]]] = []
    while len(goals) < count:
        wanted = "refuse" if rng.random() < UNREACHABLE_SHARE else "reach"
        at_node = wanted == "reach" and rng.random() < NODE_SHARE
        for _ in range(2000):
            node_id = int(rng.choice(nodes))
            away_m = 0.0 if at_node else rng.uniform(0.3, POINT_REACH_M)
            bearing = rng.uniform(-math.pi, math.pi)
            p_node = (float(away_m * np.cos(bearing)), float(away_m * np.sin(bearing)))
            x, y = (float(value) for value in se2.transform(rig.T_world_node[node_id], p_node))
            if at_node or floor.wanted((x, y)) == wanted:
                goals.append((Goal(node_id, p_node), (x, y)))
                break
    return goals


class GoalTour:
    """A mission that drives all goals and writes down each verdict."""

    def __init__(
        self, rig: Rig, goals: Sequence[tuple[Goal, tuple[float, float]]], like: Verdict, floor: Floor
    ) -> None:
        self.done: list[Verdict] = []
        self._rig, self._goals, self._like, self._floor = rig, list(goals), like, floor
        self._now: Verdict | None = None
        self._begun = (0.0, 0.0, 0)
        self._cycle = 0
        self._touching, self._pushed = False, 0

    def watch(self, _now_s: float) -> None:
        """Notice who pushed whom: a robot that drives towards what it touches did."""
        truth = self._rig.simulator.truth()
        if truth.touching and not self._touching:
            self._pushed += pushes(self._rig)
        self._touching = truth.touching

    def step(self, moment: MissionInput) -> Order:
        """Give the next goal when the last one is over."""
        if self._now is not None and not self._over(self._now, moment):
            return Order(MissionState.RUNNING, f"goal {len(self.done) + 1}")
        if not self._goals:
            return Order(MissionState.DONE)
        goal, point = self._goals.pop(0)
        truth = self._rig.simulator.truth()
        self._now = replace(self._like, number=len(self.done), wanted=self._floor.wanted(point), point=point)
        self._begun = moment.now_s, truth.path_m, truth.contact_count
        self._cycle, self._pushed = moment.output.cycle, 0
        return Order(MissionState.RUNNING, f"goal {len(self.done) + 1}", goal)

    def _over(self, verdict: Verdict, moment: MissionInput) -> bool:
        late = moment.now_s - self._begun[0] > GOAL_LIMIT_S
        ended = moment.output.state in {NavState.ARRIVED, NavState.FAILED}
        if moment.output.cycle <= self._cycle or not (ended or late):
            return False
        truth = self._rig.simulator.truth()
        verdict.state = str(moment.output.state) if ended else "hung"
        verdict.text = f"{moment.output.reason}: {moment.output.text}"
        verdict.time_s = round(moment.now_s - self._begun[0], 1)
        verdict.path_m = round(truth.path_m - self._begun[1], 2)
        verdict.off_m = round(float(np.hypot(*(truth.T_world_base[:2] - np.array(verdict.point)))), 3)
        verdict.contacts, verdict.pushed = truth.contact_count - self._begun[2], self._pushed
        self.done.append(verdict)
        self._now = None
        flag = "" if verdict.right and not verdict.contacts else "   <---"
        print(
            f"  {verdict.number:3} {verdict.wanted:6} {verdict.state:8} {verdict.time_s:6.1f} s "
            f"{verdict.path_m:6.1f} m off {verdict.off_m:.2f} m, {verdict.contacts} contacts "
            f"{verdict.text}{flag}",
            flush=True,
        )
        return True


def pushes(rig: Rig) -> bool:
    """Return True if the robot is moving towards what it touches now."""
    body = rig.simulator.base.body
    odometry = rig.core.exchange.odometry.get()
    if odometry is None or abs(odometry.v_mps) < 0.02:
        return False
    ahead = odometry.v_mps * np.array([math.cos(body.state.yaw), math.sin(body.state.yaw)])
    return any(float(ahead @ np.array(contact.normal[:2])) < 0.0 for contact in body.contacts)


def with_people(world: World, people: int, seed: int) -> World:
    """Return the building with people who walk to and fro between random places."""
    planner, rng = FloorRoutePlanner(world.raster), np.random.default_rng(seed)
    places = planner.places((world.spawn[0], world.spawn[1]), 3.0)
    walkers: list[Person] = []
    while len(walkers) < people:
        a, b = (places[int(index)] for index in rng.choice(len(places), 2, replace=False))
        way = planner.path(a, b)[::5]
        points = tuple((float(x), float(y)) for x, y in (*way, *way[-2:0:-1]))
        if len(points) > 10:
            walkers.append(Person(points, speed_mps=float(rng.uniform(0.6, 1.3))))
    return replace(world, movers=(*world.movers, *walkers))


def run_goals(name: str, seed: int, count: int, people: int, *, depth: bool) -> list[Verdict]:
    """Lead the robot through a building, then let it drive to random goals."""
    world = worlds.load(name)
    floor = Floor(world)
    with tempfile.TemporaryDirectory() as folder:
        rig = rig_of(with_people(world, people, seed) if people else world, seed, Path(folder), depth=depth)
        ended = rig.lead(round_trip(world))
        truth = rig.simulator.truth()
        print(
            f"{name}, seed {seed}: led {truth.path_m:.0f} m in {ended.now_s:.0f} s, "
            f"{len(rig.T_world_node)} nodes, {truth.contact_count} contacts",
            flush=True,
        )
        goals = choose_goals(rig, floor, count, seed)
        like = Verdict(name, seed, 0, people, "reach", (0.0, 0.0))
        tour = GoalTour(rig, goals, like, floor)
        rig.run(tour, GOAL_LIMIT_S * count, tour.watch)
        rig.close()
    return tour.done


def bench_goals(
    names: Sequence[str], seeds: Sequence[int], count: int, out: Path, *, people: int = 0, depth: bool = False
) -> list[Verdict]:
    """Run what is not in the file yet; print and keep all verdicts."""
    out.mkdir(parents=True, exist_ok=True)
    told = out / (f"nav_goals_{people}_people.json" if people else "nav_goals.json")
    done = [Verdict(**each) for each in json.loads(told.read_text())] if told.exists() else []
    warm_up(RobotConfig())
    for name in names:
        for seed in seeds:
            if not any(each.world == name and each.seed == seed for each in done):
                done += run_goals(name, seed, count, people, depth=depth)
                told.write_text(json.dumps([asdict(each) for each in done]))
    mine = [each for each in done if each.world in names and each.seed in seeds]
    report(mine)
    return mine


def report(verdicts: Sequence[Verdict]) -> None:
    """Print how many goals of each building were met."""
    print(
        "world                          goals  right reached refused  wrong contacts pushed   way m   time s"
    )
    for name in [*dict.fromkeys(each.world for each in verdicts), "all"]:
        mine = [each for each in verdicts if name in (each.world, "all")]
        reached = sum(each.state == "arrived" for each in mine)
        print(
            f"{name[-30:]:30}{len(mine):>6}{sum(each.right for each in mine):>7}{reached:>8}"
            f"{sum(each.state == 'failed' for each in mine):>8}{sum(not each.right for each in mine):>7}"
            f"{sum(each.contacts for each in mine):>9}{sum(each.pushed for each in mine):>7}"
            f"{sum(each.path_m for each in mine):>8.0f}{sum(each.time_s for each in mine):>9.0f}"
        )
