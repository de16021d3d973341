"""A simulated robot that only maps: driven along scripted ways over the true plan, carried, judged by truth.

Real bytes through drivers and odometry, no navigation, safety, viewer or recording: some twenty times faster
than the clock. Truth is used to drive and to judge, never by the mapping.
"""

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from lemtomap.robot.base import BaseStep
from lemtomap.robot.config import RobotConfig
from lemtomap.robot.devices.recording import HOKUYO, KOBUKI
from lemtomap.robot.devices.wire import RecordedHokuyoSession, RecordedKobukiSession, Wire
from lemtomap.robot.exchange import Exchange, TimedScan
from lemtomap.se2 import Pose
from lemtomap.sim.errors import Unplugged
from lemtomap.sim.simulator import Simulator
from lemtomap.sim.tours import ScriptedTour, base_command
from lemtomap.sim.world import World

STEP_S = 0.02  # one feedback packet
TRUTH_KEPT = 100  # steps: older than any scan that is still under way
FADE_S = 1.2  # from the lifting of the robot until it stands again


@dataclass(frozen=True, slots=True)
class Seen:
    """One scan as the mapper gets it, and where the robot truly was at its stamp."""

    timed: TimedScan
    T_world_base: Pose


class SimRobot:
    """The base of one robot in one world; `drive` and `stand` yield what goes to the mapper."""

    def __init__(self, world: World, seed: int) -> None:
        self.simulator = Simulator(world, seed=seed)
        self.now_s = 0.0
        self._exchange = Exchange()
        self._base_step = BaseStep(RobotConfig(), self._exchange)
        self._base = Wire(KOBUKI, self.simulator.kobuki, RecordedKobukiSession(_forget), _forget, Unplugged)
        self._laser = Wire(HOKUYO, self.simulator.hokuyo, RecordedHokuyoSession(_forget), _forget, Unplugged)
        self._truth: deque[tuple[float, Pose]] = deque(maxlen=TRUTH_KEPT)

    @property
    def T_world_base(self) -> Pose:  # noqa: N802 - a frame's name
        """Where the robot truly is."""
        return self.simulator.truth().T_world_base

    def drive(self, tour: ScriptedTour, limit_s: float = math.inf) -> Iterator[Seen]:
        """Follow a way to its end, or until the time is up."""
        limit_s = min(limit_s, 60.0 + 4.0 * tour.length_m / tour.config.speed_mps)
        end_s = self.now_s + limit_s
        while not tour.done and self.now_s < end_s:
            self.simulator.kobuki.write(base_command(*tour.command(self.T_world_base)))
            yield from self._step()
        self.simulator.kobuki.write(base_command(0.0, 0.0))

    def stand(self, seconds: float, w_radps: float = 0.0) -> Iterator[Seen]:
        """Stand, or turn on the spot."""
        end_s = self.now_s + seconds
        while self.now_s < end_s:
            self.simulator.kobuki.write(base_command(0.0, w_radps))
            yield from self._step()

    def carry(self, T_world_base: Pose, *, felt: bool = True) -> Iterator[Seen]:
        """Put the robot somewhere else; `felt`: the wheels hang meanwhile and their switches say so."""
        self.simulator.base.lifted = felt
        yield from self.stand(0.5 * FADE_S)
        self.put(T_world_base)
        yield from self.stand(0.5 * FADE_S)
        self.simulator.base.lifted = False

    def put(self, T_world_base: Pose) -> None:
        """Set the body down at a place, without a wheel turning."""
        x, y, yaw = (float(value) for value in T_world_base)
        body = self.simulator.base.body
        body.state = replace(body.state, x=x, y=y, yaw=yaw)

    def close(self) -> None:
        """Free the physics engine."""
        self.simulator.close()

    def _step(self) -> Iterator[Seen]:
        self.now_s = round(self.now_s + STEP_S, 9)
        self.simulator.advance(self.now_s)
        x, y, yaw = self.simulator.base.body.state.pose
        self._truth.append((self.now_s, np.array([x, y, yaw])))
        told = self._base.poll(self.now_s), self._laser.poll(self.now_s)
        self._base_step.take(*told, self.now_s)
        for timed in self._exchange.scans.drain():
            yield Seen(timed, self._true_at(timed.scan.stamp_s))

    def _true_at(self, stamp_s: float) -> Pose:
        stamps = np.array([stamp for stamp, _ in self._truth])
        poses = np.array([pose for _, pose in self._truth])
        return np.array([np.interp(stamp_s, stamps, column) for column in poses.T])


def _forget(_: object) -> None:
    """Keep no record."""
