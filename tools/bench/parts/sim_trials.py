"""One try each: switched on, or carried, somewhere in a mapped building; does the robot find itself?"""

import os
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lemtomap.se2 import Pose
from lemtomap.sim.route import FloorRoutePlanner
from lemtomap.sim.tours import ScriptedTour
from lemtomap.sim.world import World
from tools.bench.parts.sim_maps import JudgedMap, load_born
from tools.bench.parts.sim_robot import Seen, SimRobot

TURN_S, TURN_RADPS = 6.6, 1.0  # a lost robot looks round once before it drives
LIMIT_S, LIMIT_M = 30.0, 3.0
RIGHT_M, RIGHT_RAD = 0.3, 0.1  # found at the right place; how exactly, the poses' quality tells
KNOWN_M = 1.5  # from a known node: elsewhere nothing is mapped
UNKNOWN_M = 6.0  # from every known node: nothing that is mapped is in sight of a short-sighted laser
ENDS = (".lemto", ".born.json")
Found = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Trial:
    """Tries on copies of one map."""

    source: Path
    folder: Path

    def started(self, world: World, seed: int) -> Found:
        """Put the robot down anywhere near a known node and wait until it knows where it is."""
        rng = np.random.default_rng([seed, 1])
        robot, judged, path = self._begin(world, seed)
        start = _known_place(path, world, rng)
        robot.put(start)
        found = _find(robot, judged, world, rng)
        return _told(found, robot, judged, path, noticed=True)

    def elsewhere(self, world: World, seed: int) -> Found:
        """Put the robot down where nothing is mapped: it must not believe to be anywhere it knows."""
        rng = np.random.default_rng([seed, 3])
        robot, judged, path = self._begin(world, seed)
        robot.put(_place_at(path, world, rng, UNKNOWN_M, np.inf))
        found = _find(robot, judged, world, rng)
        told = _told(found, robot, judged, path, noticed=True)
        return told | {"ok": not told["wrong"]}

    def carried(self, world: World, seed: int) -> Found:
        """Let the robot find itself, drive a bit, carry it, and wait until it knows again."""
        rng = np.random.default_rng([seed, 2])
        robot, judged, path = self._begin(world, seed)
        robot.put(_known_place(path, world, rng))
        _find(robot, judged, world, rng, limit_s=60.0, limit_m=10.0)
        end = _known_place(path, world, rng)
        lost = False
        if seed % 2:
            robot.put(end)
        else:
            judged.feed(robot.carry(end))
        for seen in robot.stand(2.0):
            judged.take(seen)
            lost = lost or judged.view.lost
        found = _find(robot, judged, world, rng)
        return _told(found, robot, judged, path, noticed=lost)

    def _begin(self, world: World, seed: int) -> tuple[SimRobot, JudgedMap, Path]:
        path = self.folder / f"trial-{self.source.stem}-{os.getpid()}.lemto"
        for end in ENDS:
            path.with_suffix(end).write_bytes(self.source.with_suffix(end).read_bytes())
        return SimRobot(world, 1000 + seed), JudgedMap(path, world), path


def _find(
    robot: SimRobot,
    judged: JudgedMap,
    world: World,
    rng: np.random.Generator,
    limit_s: float = LIMIT_S,
    limit_m: float = LIMIT_M,
) -> Found:
    """Look round and drive somewhere until the robot says that it knows its place."""
    begun_s, begun_m = robot.now_s, judged.score.path_m
    found: Found = {
        "found": False,
        "right": False,
        "way_m": 0.0,
        "time_s": 0.0,
        "off_m": -1.0,
        "off_rad": -1.0,
    }
    for seen in _search(robot, world, rng, limit_s):
        judged.take(seen)
        way_m = judged.score.path_m - begun_m
        if judged.exchange.map_view.get() is not None and not judged.view.lost and not seen.timed.lifted:
            off_m, off_rad = judged.error(seen.T_world_base)
            return found | {
                "found": True,
                "right": off_m <= RIGHT_M and off_rad <= RIGHT_RAD and _is_joined(judged),
                "way_m": way_m,
                "time_s": robot.now_s - begun_s,
                "off_m": off_m,
                "off_rad": off_rad,
            }
        if way_m > 3.0 * limit_m:
            break
    return found


def _search(robot: SimRobot, world: World, rng: np.random.Generator, limit_s: float) -> Iterator[Seen]:
    yield from robot.stand(1.0)
    yield from robot.stand(TURN_S, TURN_RADPS)
    yield from robot.drive(_wander(world, robot.T_world_base, rng), 2.0 * limit_s)


def _wander(world: World, T_world_base: Pose, rng: np.random.Generator) -> ScriptedTour:
    """Return a way through random places from here."""
    planner = FloorRoutePlanner(world.raster)
    here = (float(T_world_base[0]), float(T_world_base[1]))
    places = planner.places(here, 1.0)
    goals = [places[index] for index in rng.integers(len(places), size=3)]
    return ScriptedTour(
        planner.through([here, *[goal for goal in goals if np.hypot(*np.subtract(goal, here)) > 1.0]])
    )


def _told(found: Found, robot: SimRobot, judged: JudgedMap, path: Path, *, noticed: bool) -> Found:
    robot.close()
    score = judged.close()
    for end in ENDS:
        path.with_suffix(end).unlink()
    in_time = found["way_m"] <= LIMIT_M and found["time_s"] <= LIMIT_S
    ok = bool(noticed and found["right"] and in_time)
    wrong = bool(score.wrong or (found["found"] and not found["right"]) or not noticed)
    told = "not noticed" if not noticed else "not found"
    if found["found"]:
        told = (
            f"{'right' if found['right'] else 'WRONG'} after {found['way_m']:.1f} m, {found['time_s']:.1f} s"
        )
        told += f", {found['off_m']:.3f} m off"
    return found | {"ok": ok, "wrong": wrong, "told": told, "score": asdict(score)}


def _is_joined(judged: JudgedMap) -> bool:
    """Return True if the robot's node hangs together with the map of before."""
    return 1 in judged.topo.graph.reach(judged.view.associated_id, 1e9)


def _known_place(path: Path, world: World, rng: np.random.Generator) -> Pose:
    """Return a random pose near a known node."""
    return _place_at(path, world, rng, 0.0, KNOWN_M)


def _place_at(path: Path, world: World, rng: np.random.Generator, least_m: float, most_m: float) -> Pose:
    """Return a random pose within reach of the building's start and so far from the nearest known node."""
    nodes = np.array([T[:2] for T in load_born(path).values()])
    places = np.array(FloorRoutePlanner(world.raster).places(world.spawn[:2], 0.5))
    gap_m = np.hypot(*(places[:, None] - nodes[None]).transpose(2, 0, 1)).min(axis=1)
    chosen = places[rng.choice(np.flatnonzero((gap_m >= least_m) & (gap_m <= most_m)))]
    return np.array([*chosen, rng.uniform(-np.pi, np.pi)])
