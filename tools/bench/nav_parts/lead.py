"""Buildings for navigation benches: the robot is led through one once, as a person would with a joystick.

A led drive follows a path planned on the true plan; the robot maps on the way. The truth is used to lead
and to judge, never by the robot.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lemtomap import se2
from lemtomap.robot.build import build_core
from lemtomap.robot.config import RobotConfig
from lemtomap.robot.core import RobotCore
from lemtomap.robot.devices.depth import DepthFeed
from lemtomap.robot.exchange import Ended, MissionState
from lemtomap.robot.missions.missions import Mission, MissionInput, Order
from lemtomap.robot.runs.lockstep import run_lockstep
from lemtomap.robot.runs.simulated import camera_of
from lemtomap.se2 import Pose
from lemtomap.sim.route import FloorRoutePlanner
from lemtomap.sim.simulator import Simulator
from lemtomap.sim.tours import ScriptedTour
from lemtomap.sim.world import World
from lemtomap.types import Twist

PATIENCE = 3.0  # a led drive that takes so many times its length at 0.4 m/s has come to a stop
PLACES_M = 3.0  # a tour passes within about this much of every place


class Led:
    """A mission that is over when the leader has come to the end of his path."""

    def __init__(self, tour: ScriptedTour) -> None:
        self._tour = tour

    def step(self, moment: MissionInput) -> Order:  # noqa: ARG002 - the leader watches the path
        """Wait."""
        return Order(MissionState.DONE if self._tour.done else MissionState.RUNNING, "led")


@dataclass(slots=True)
class Rig:
    """One robot in one building, with what only the bench knows."""

    simulator: Simulator
    core: RobotCore
    T_world_node: dict[int, Pose] = field(default_factory=dict)
    """Where each node truly is: where the robot was when it was made."""
    camera: DepthFeed | None = None

    def run(self, mission: Mission, limit_s: float, watch: Callable[[float], None] | None = None) -> Ended:
        """Run a mission in lock-step."""

        def each(now_s: float) -> None:
            if self.camera is not None:
                self.camera.poll(now_s)
            self._note_nodes()
            if watch is not None:
                watch(now_s)

        return run_lockstep(self.simulator, self.core, mission, limit_s, watch=each)

    def lead(self, path: NDArray[np.float64]) -> Ended:
        """Take the robot along a path, float64 (N, 2), world metres."""
        tour = ScriptedTour(path)

        def pull(now_s: float) -> None:
            v_mps, w_radps = tour.command(self.simulator.truth().T_world_base)
            self.core.base.teleop(Twist(v_mps, w_radps), now_s)

        return self.run(Led(tour), 60.0 + PATIENCE * tour.length_m / tour.config.speed_mps, pull)

    def _note_nodes(self) -> None:
        view = self.core.exchange.map_view.get()
        if view is not None and view.associated_id not in self.T_world_node:
            T_base_node = se2.between(view.T_grid_base, view.T_grid_node[view.associated_id])
            truth = self.simulator.truth().T_world_base
            self.T_world_node[view.associated_id] = se2.compose(truth, T_base_node)

    def nearest_node(self, point: NDArray[np.float64]) -> int:
        """Return the node that truly lies nearest to a point of the world."""
        places = self.T_world_node
        return min(places, key=lambda node_id: float(np.hypot(*(places[node_id][:2] - point[:2]))))

    def close(self) -> None:
        """Close the map and free the simulator."""
        self.core.close()
        self.simulator.close()


def rig_of(world: World, seed: int, folder: Path, *, depth: bool = False) -> Rig:
    """Return a topological robot with an empty map at the world's starting place."""
    simulator = Simulator(world, seed=seed)
    path = folder / f"{abs(hash(world.name)) % 10**8}-{seed}.lemto"
    path.unlink(missing_ok=True)
    core = build_core(RobotConfig(), path, durable=False, seed=seed)
    rig = Rig(simulator, core)
    if depth:
        rig.camera = camera_of(simulator, core)
    return rig


def round_trip(world: World, spacing_m: float = PLACES_M) -> NDArray[np.float64]:
    """Return a path through every place of a building, nearest first by the way, and back to the start."""
    planner = FloorRoutePlanner(world.raster)
    here = home = (world.spawn[0], world.spawn[1])
    left = planner.places(home, spacing_m)
    legs = []
    while left:
        cost, _ = planner.distances(here)
        goal = min(left, key=lambda place: cost[planner._nearest(place)])  # noqa: SLF001 - a bench may look
        left.remove(goal)
        legs.append(planner.path(here, goal))
        here = goal
    legs.append(planner.path(here, home))
    return np.concatenate(legs)


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
