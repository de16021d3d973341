"""Doors that close on the way, and things the laser overlooks, in any building.

Doors: a barrier is put across the way the robot will take. Where there is another way it must be taken; when
the barrier is gone the short way must be used again; where there is none the goal must be refused with that
reason. Obstacles: chairs with star feet and low bars stand beside the middle of the way, with room to pass.
"""

import math
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lemtomap.nav.types import Goal, NavState
from lemtomap.robot.config import RobotConfig
from lemtomap.robot.exchange import MissionState
from lemtomap.robot.missions.missions import MissionInput, Order
from lemtomap.robot.runs.warmup import warm_up
from lemtomap.se2 import Pose
from lemtomap.sim import furniture, worlds
from lemtomap.sim.errors import BadWorld
from lemtomap.sim.movers import NOWHERE
from lemtomap.sim.route import FloorRoutePlanner, path_length_m
from lemtomap.sim.simulator import Truth
from lemtomap.sim.world import (
    Box,
    Pose2,
    Raster,
    Surface,
)
from tools.bench.nav_parts.lead import Rig, rig_of, round_trip
from tools.truth.walls import wall_between

DOOR_HALF_M = (0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.3)
"""Half the width of the doors there are. One that stuck out behind the walls would be a new thing there."""
BAR = Box((0.0, 0.0, 0.09), (0.03, 0.30, 0.03), surface=Surface.DARK)
BUMP_APART_S = 3.0
IN_SIGHT_M = 3.0
LIMIT_S = 400.0
Row = tuple[str, bool, float]
"""What was tried, whether it went right, seconds."""
Point = NDArray[np.float64]
"""x, y, ... metres, world."""
THING_HALF_M = 0.30
ROUND_M = 1.0
"""Past a thing there is room when the way grows by no more than this."""
LEAST_WAY_M, MOST_WAY_M = 12.0, 40.0


@dataclass
class Placed:
    """A thing that the bench puts somewhere while the run is on."""

    parts: tuple[Box, ...]
    pose: Pose2 = NOWHERE

    def begin(self, _seed: int) -> "Placed":
        """Be one's own motion."""
        return self

    def step(self, _now_s: float, _dt_s: float, _robot: Pose2) -> Pose2:
        """Stand where one was put."""
        return self.pose


@dataclass
class Drive:
    """A mission of one goal, with what a bench wants to know of it."""

    rig: Rig
    goal: Goal
    barrier: Pose2 = NOWHERE
    state: str = ""
    text: str = ""
    begun_s: float = math.nan
    ended_s: float = math.nan
    begun_m: float = 0.0
    way_m: float = 0.0
    seen_s: float = math.nan
    """When the robot first was so near to the barrier, with nothing before it, that it must have seen it."""
    closed_s: float = math.nan
    """When it first planned around something closed."""
    bumps: int = 0
    """Contacts that are BUMP_APART_S apart: a robot rubs along what it backs off from."""
    _touched_s: float = -math.inf
    _counted: int = 0

    def step(self, moment: MissionInput) -> Order:
        """Give the goal, watch, and end with the navigator's verdict."""
        truth = self.rig.simulator.truth()
        if math.isnan(self.begun_s):
            self.begun_s, self.begun_m, self._cycle = moment.now_s, truth.path_m, moment.output.cycle
            self._counted = truth.contact_count
            return Order(MissionState.RUNNING, "drive", self.goal)
        self._count_bumps(truth, moment.now_s)
        away_m = float(np.hypot(*(truth.T_world_base[:2] - np.array(self.barrier[:2]))))
        if math.isnan(self.seen_s) and away_m < IN_SIGHT_M and self._in_sight(truth.T_world_base):
            self.seen_s = moment.now_s
        closed = moment.navigator._way.blocked.closed_until_s(moment.now_s)  # noqa: SLF001 - measured from outside on purpose
        if math.isnan(self.closed_s) and closed:
            self.closed_s = moment.now_s
        if moment.output.cycle <= self._cycle or moment.output.state not in {
            NavState.ARRIVED,
            NavState.FAILED,
        }:
            return Order(MissionState.RUNNING, "drive")
        self.state, self.text = str(moment.output.state), f"{moment.output.reason}: {moment.output.text}"
        self.ended_s, self.way_m = moment.now_s, truth.path_m - self.begun_m
        return Order(MissionState.DONE)

    def _count_bumps(self, truth: Truth, now_s: float) -> None:
        if truth.contact_count > self._counted and now_s - self._touched_s > BUMP_APART_S:
            self.bumps += 1
        if truth.contact_count > self._counted or truth.touching:
            self._touched_s = now_s
        self._counted = truth.contact_count

    def _in_sight(self, T_world_base: Pose) -> bool:
        """Return True if no wall of the plan, in which the barrier is not, stands before it."""
        return not wall_between(self.rig.simulator.world.raster, T_world_base, np.array(self.barrier))

    def run(self) -> "Drive":
        """Drive to the end."""
        self.rig.run(self, LIMIT_S)
        return self

    def told(self) -> str:
        """Return a line about it."""
        return (
            f"{self.state or 'hung'} {self.ended_s - self.begun_s:.1f} s {self.way_m:.1f} m "
            f"{self.bumps} bumps {self.text}"
        )


def across(path: NDArray[np.float64], share: float) -> Pose2:
    """Return a pose across a path at a share of its length; x along the path."""
    at = min(max(int(share * len(path)), 3), len(path) - 4)
    dx, dy = path[at + 3] - path[at - 3]
    return float(path[at, 0]), float(path[at, 1]), math.atan2(dy, dx)


class Doors:
    """A door of each width; at most one of them is shut."""

    def __init__(self) -> None:
        self.all = [Placed((Box((0.0, 0.0, 0.6), (0.04, half_m, 0.6)),)) for half_m in DOOR_HALF_M]

    def shut(self, door: int, pose: Pose2) -> None:
        """Shut one, open the others."""
        for index, placed in enumerate(self.all):
            placed.pose = pose if index == door else NOWHERE

    def open(self) -> None:
        """Open all."""
        self.shut(-1, NOWHERE)


def fitting_door(raster: Raster, pose: Pose2) -> tuple[int, Pose2] | None:
    """Return the narrowest door that shuts the way at a pose, and where in its middle; None if none does."""
    x, y, yaw = pose
    left_m, right_m = (_room(raster, x, y, yaw + sign * math.pi / 2) for sign in (1, -1))
    aside_m = 0.5 * (left_m - right_m)
    middle = x - aside_m * math.sin(yaw), y + aside_m * math.cos(yaw), yaw
    for index, half_m in enumerate(DOOR_HALF_M):
        if half_m >= 0.5 * (left_m + right_m):
            return index, middle
    return None


def barred(raster: Raster, pose: Pose2, half_m: float) -> Raster:
    """Return the plan with a door in it."""
    rows, cols = np.indices(raster.occupied.shape)
    x = raster.origin_m[0] + (cols + 0.5) * raster.resolution_m - pose[0]
    y = raster.origin_m[1] + (rows + 0.5) * raster.resolution_m - pose[1]
    along = x * math.cos(pose[2]) + y * math.sin(pose[2])
    aside = -x * math.sin(pose[2]) + y * math.cos(pose[2])
    wall = (abs(along) <= 0.08) & (abs(aside) <= half_m + raster.resolution_m)
    return replace(raster, occupied=raster.occupied | wall, free=raster.free & ~wall)


def length_m(planner: FloorRoutePlanner, a: Point, b: Point) -> float:
    """Return the way between two points, inf if there is none."""
    try:
        path = planner.path((a[0], a[1]), (b[0], b[1]))
    except BadWorld:
        return math.inf
    return path_length_m(path)


def bench_doors(name: str, seed: int, count: int) -> None:
    """Close the way `count` times; print each drive and how many did what they should."""
    warm_up(RobotConfig())
    world, doors = worlds.load(name), Doors()
    rng = np.random.default_rng(seed)
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as folder:
        rig = rig_of(replace(world, movers=(*world.movers, *doors.all)), seed, Path(folder))
        rig.lead(round_trip(world))
        planner = FloorRoutePlanner(world.raster)
        for _ in range(50 * count):
            if len(rows) >= 2 * count:
                break
            rows += _one_door(rig, doors, planner, int(rng.choice(sorted(rig.T_world_node))))
        rig.close()
    for kind in ("another way", "again", "refused"):
        mine = [row for row in rows if row[0] == kind]
        times = [row[2] for row in mine if math.isfinite(row[2])]
        right = sum(row[1] for row in mine)
        print(f"{kind:12} {right} of {len(mine)} right; s: " + ", ".join(f"{time_s:.1f}" for time_s in times))


def _one_door(
    rig: Rig, doors: Doors, planner: FloorRoutePlanner, node_id: int
) -> list[tuple[str, bool, float]]:
    """Bar the way to one node; return (what, right, time s) of each drive."""
    here = rig.simulator.truth().T_world_base
    there = rig.T_world_node[node_id]
    path = planner.path((here[0], here[1]), (there[0], there[1]))
    short_m = path_length_m(path)
    if not LEAST_WAY_M < short_m < MOST_WAY_M:
        return []
    raster = rig.simulator.world.raster
    fitting = fitting_door(raster, across(path, 0.6))
    if fitting is None:
        return []
    door, pose = fitting
    long_m = length_m(FloorRoutePlanner(barred(raster, pose, DOOR_HALF_M[door])), here, there)
    if long_m < 1.5 * short_m + 3.0 or (math.isfinite(long_m) and long_m > 100.0):
        return []  # the barrier is no barrier, or the way round is too long for a bench
    doors.shut(door, pose)
    print(f"node {node_id}: {short_m:.0f} m, barred {long_m:.0f} m", flush=True)
    drive = Drive(rig, Goal(node_id), pose).run()
    print(f"  barred: {drive.told()}", flush=True)
    if not math.isfinite(long_m):
        right = drive.state == "failed" and "closed" in drive.text
        again = Drive(rig, Goal(node_id), pose).run()
        print(f"  asked again: {again.told()}", flush=True)
        doors.open()
        return [("refused", right and again.state == "failed", again.ended_s - again.begun_s)]
    found_s = drive.closed_s - drive.seen_s
    rows = [("another way", drive.state == "arrived" and found_s < 5.0, found_s)]
    doors.open()
    back = rig.nearest_node(here)
    home = Drive(rig, Goal(back)).run()
    wait_s = rig.core.navigation.navigator.config.recovery.block_s
    rig.run(_Pause(wait_s), 2.0 * wait_s)
    again = Drive(rig, Goal(node_id)).run()
    print(f"  back: {home.told()}\n  open again: {again.told()}", flush=True)
    rows.append(("again", again.state == "arrived" and again.way_m < 1.2 * short_m + 1.0, math.nan))
    return rows


class _Pause:
    def __init__(self, wait_s: float) -> None:
        self._wait_s, self._until_s = wait_s, math.nan

    def step(self, moment: MissionInput) -> Order:
        """Let the decay pass."""
        if math.isnan(self._until_s):
            self._until_s = moment.now_s + self._wait_s
        return Order(MissionState.DONE if moment.now_s > self._until_s else MissionState.RUNNING, "waiting")


def bench_obstacles(name: str, seed: int, count: int, *, depth: bool) -> None:
    """Put unseen things beside the middle of the way and drive there and back; print bumps for each."""
    warm_up(RobotConfig())
    world = worlds.load(name)
    chair = Placed(tuple(furniture.office_chair(0.0, 0.0, 0.3)))
    things = [chair, Placed((BAR,))]
    rng = np.random.default_rng(seed)
    worst = total = drives = failed = 0
    with tempfile.TemporaryDirectory() as folder:
        rig = rig_of(replace(world, movers=(*world.movers, *things)), seed, Path(folder), depth=depth)
        rig.lead(round_trip(world))
        planner = FloorRoutePlanner(world.raster)
        for _ in range(50 * count):
            if drives >= 2 * count:
                break
            here = rig.simulator.truth().T_world_base
            node_id = int(rng.choice(sorted(rig.T_world_node)))
            pose = _beside(rig, planner, here, rig.T_world_node[node_id], rng)
            if pose is None:
                continue
            thing = things[drives // 2 % len(things)]
            thing.pose = pose
            legs = [Drive(rig, Goal(goal)).run() for goal in (node_id, rig.nearest_node(here))]
            touched = sum(leg.bumps for leg in legs)
            kind = "chair" if thing is chair else "bar"
            print(f"{kind} at {pose[0]:.1f}, {pose[1]:.1f}: {touched} bumps; there: {legs[0].told()}")
            print(f"   back: {legs[1].told()}", flush=True)
            drives, total, worst = drives + 2, total + touched, max(worst, touched)
            failed += sum(leg.state != "arrived" for leg in legs)
            thing.pose = NOWHERE
            if touched:  # nobody tells the robot that it is gone
                wait_s = rig.core.navigation.navigator.config.costmap.contact_hard_s
                rig.run(_Pause(wait_s), 2.0 * wait_s)
        rig.close()
    eyes = "with" if depth else "without"
    print(
        f"{eyes} the depth camera: {drives} drives past {drives // 2} unseen things, {failed} not reached, "
        f"{total} bumps, {worst} at most with one thing"
    )


def _beside(
    rig: Rig, planner: FloorRoutePlanner, here: Point, there: Point, rng: np.random.Generator
) -> Pose2 | None:
    """Return a place near the middle of the way where a thing leaves room to pass; None if there is none."""
    path = planner.path((here[0], here[1]), (there[0], there[1]))
    way_m = path_length_m(path)
    if not 6.0 < way_m < MOST_WAY_M:
        return None
    raster = rig.simulator.world.raster
    for share in rng.uniform(0.3, 0.7, 10):
        x, y, yaw = across(path, float(share))
        aside = float(rng.uniform(-0.25, 0.25))
        pose = x - aside * math.sin(yaw), y + aside * math.cos(yaw), yaw
        past = FloorRoutePlanner(barred(raster, pose, THING_HALF_M))
        if length_m(past, here, there) < way_m + ROUND_M:
            return pose
    return None


def _room(raster: Raster, x: float, y: float, bearing: float) -> float:
    """Return metres of free floor from a point in one direction, at most 2."""
    for away_m in np.arange(0.0, 2.0, 0.05):
        cell = raster.cell(x + away_m * math.cos(bearing), y + away_m * math.sin(bearing))
        if raster.occupied[cell]:
            return float(away_m)
    return 2.0
