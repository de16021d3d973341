"""The URG-04LX-UG01 on the robot: a mirror that turns while the robot drives, beam after beam."""

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lemtomap.sim.body import BodyState
from lemtomap.sim.hokuyo import FIRST_STEP, FRONT_STEP, INITIAL_RPM, LAST_STEP, NOT_MEASURABLE, SLITS
from lemtomap.sim.hokuyo_stream import STEPS
from lemtomap.sim.mounting import Mounting
from lemtomap.sim.optics import NOTHING, WEAK, BeamHits, OpticsConfig, measure
from lemtomap.sim.scene import Scene

BEAMS = LAST_STEP - FIRST_STEP + 1
TRACK = 16  # physics steps remembered: more than one turn
ANGLES_RAD: NDArray[np.float64] = np.array(
    [(step - FRONT_STEP) * 2 * math.pi / SLITS for step in range(FIRST_STEP, LAST_STEP + 1)]
)


@dataclass(frozen=True, slots=True)
class UrgConfig:
    """The sensor and where it sits."""

    mounting: Mounting = field(default_factory=Mounting)
    height_m: float = 0.25
    """Above the floor: on the TurtleBot's second plate."""
    optics: OpticsConfig = field(default_factory=OpticsConfig)
    motor_sigma: float = 0.002
    """Relative error of the motor's speed (exp1.dat turns about one percent fast)."""
    blocked: tuple[float, float] | None = None
    """Seconds (from, to) during which something hangs before the sensor."""


class Urg:
    """One sensor in one scene."""

    def __init__(self, scene: Scene, config: UrgConfig, rng: np.random.Generator) -> None:
        self._scene = scene
        self._config = config
        self._rng = rng
        self._motor_error = config.motor_sigma * float(rng.standard_normal())
        self._rpm = INITIAL_RPM
        self._phase_s = float(rng.uniform(0.0, self.period_s))
        self._turn = 0
        self._next = 0
        self._begun = False
        self._shining = False
        self._track: deque[tuple[float, BodyState]] = deque(maxlen=TRACK)
        self.finished_s = 0.0
        self._range_m = np.zeros(BEAMS)
        self._cos = np.zeros(BEAMS)
        self._albedo = np.zeros(BEAMS)
        self._points = np.zeros((BEAMS, 2))

    @property
    def period_s(self) -> float:
        """How long a turn takes at the present speed."""
        return 60.0 / self._rpm * (1.0 + self._motor_error)

    @property
    def started_s(self) -> float:
        """When step 0 of the present turn was passed."""
        return self._phase_s + self._turn * self.period_s

    @property
    def _slit_s(self) -> float:
        return self.period_s / SLITS

    def step(
        self, begin_s: float, end_s: float, before: BodyState, after: BodyState, *, laser_on: bool, rpm: int
    ) -> NDArray[np.int64] | None:
        """Turn the mirror from begin_s to end_s; return a finished scan, int64 (769,) in mm or error codes.

        A new speed of the motor counts from the next turn on.
        `finished_s` then tells when the turn of the returned scan had passed step 0.
        """
        if not self._track:
            self._track.append((begin_s, before))
        self._track.append((end_s, after))
        if not self._begun and self.started_s <= end_s:
            self._begun, self._shining = True, laser_on
        self._shining &= laser_on
        passed = (end_s - self.started_s) / self._slit_s - FIRST_STEP
        upto = min(BEAMS, max(self._next, math.floor(passed) + 1))
        if upto > self._next and (upto == BEAMS or self._scene.alive):
            if self._shining:
                self._cast(slice(self._next, upto))
            self._next = upto
        if passed + FIRST_STEP < STEPS:
            return None
        scan = self._measure() if self._shining else None
        self.finished_s = self.started_s
        self._turn += 1
        if rpm != self._rpm:
            self._phase_s, self._turn, self._rpm = self.started_s, 0, rpm
        self._next, self._begun = 0, False
        return scan

    def _cast(self, beams: slice) -> None:
        """Cast beams, each from where the robot was at its time; where nothing else moves, a turn at once."""
        config = self._config
        stamps = [stamp for stamp, _ in self._track]
        poses = np.array([(s.x, s.y, s.yaw, s.height_m, s.pitch, s.roll) for _, s in self._track])
        beams_s = self.started_s + np.arange(beams.start + FIRST_STEP, beams.stop + FIRST_STEP) * self._slit_s
        x, y, yaw = (np.interp(beams_s, stamps, poses[:, column]) for column in range(3))
        cos, sin = np.cos(yaw), np.sin(yaw)
        dx, dy, mount_yaw = config.mounting.T_base_laser
        angle = mount_yaw + ANGLES_RAD[beams] * (-1.0 if config.mounting.upside_down else 1.0)
        starts, directions = np.empty((len(yaw), 3)), np.empty((len(yaw), 3))
        starts[:, 0] = x + cos * dx - sin * dy
        starts[:, 1] = y + sin * dx + cos * dy
        starts[:, 2] = config.height_m
        directions[:, 0] = np.cos(yaw + angle)
        directions[:, 1] = np.sin(yaw + angle)
        directions[:, 2] = 0.0
        if not self._scene.flat:
            height, pitch, roll = (np.interp(beams_s, stamps, poses[:, column]) for column in range(3, 6))
            starts[:, 2] += height
            directions[:, 2] = np.cos(angle) * np.tan(pitch) + np.sin(angle) * np.tan(roll)
            directions /= np.linalg.norm(directions, axis=1)[:, None]
        reach_m = config.optics.max_m
        hits = self._scene.cast(starts, starts + directions * reach_m)
        length = hits.share * reach_m
        self._range_m[beams] = np.where(hits.body >= 0, length, np.inf)
        self._cos[beams] = np.abs((hits.normal * directions).sum(axis=1))
        self._albedo[beams] = self._scene.albedo[hits.body]
        self._points[beams] = starts[:, :2] + directions[:, :2] * length[:, None]

    def _measure(self) -> NDArray[np.int64]:
        """Return one turn by step, int64 (769,), mm or error codes."""
        blocked = self._config.blocked
        scan = np.full(STEPS, NOT_MEASURABLE, dtype=np.int64)
        if blocked is not None and blocked[0] <= self.started_s < blocked[1]:
            values = self._rng.choice([NOTHING, WEAK, 25, 31], size=BEAMS)
        else:
            light = BeamHits(self._range_m, self._cos, self._albedo, self._points)
            values = measure(light, self._config.optics, self._rng)
        scan[FIRST_STEP : LAST_STEP + 1] = values
        return scan

    def true_ranges_m(self, state: BodyState) -> NDArray[np.float64]:
        """Return what a perfect sensor would see from a standing robot, float64 (682,), +inf beyond reach."""
        kept = self._track.copy()
        self._track.clear()
        self._track.append((self.started_s, state))
        self._cast(slice(0, BEAMS))
        self._track.clear()
        self._track.extend(kept)
        return self._range_m.copy()
