"""The URG-04LX-UG01 on the robot: a mirror that turns while the robot drives, beam after beam."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from sim.body import BodyState
from sim.hokuyo import FIRST_STEP, FRONT_STEP, LAST_STEP, NOT_MEASURABLE, SLITS
from sim.hokuyo_stream import STEPS
from sim.optics import NOTHING, WEAK, Light, OpticsConfig, measure
from sim.scene import Scene
from sim.world import Pose2

BEAMS = LAST_STEP - FIRST_STEP + 1
ANGLES_RAD: NDArray[np.float64] = np.array(
    [(step - FRONT_STEP) * 2 * math.pi / SLITS for step in range(FIRST_STEP, LAST_STEP + 1)]
)


@dataclass(frozen=True, slots=True)
class UrgConfig:
    """The sensor and where it sits."""

    T_base_laser: Pose2 = (0.0, 0.0, 0.0)
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
        self.period_s = 0.1 * (1.0 + config.motor_sigma * float(rng.standard_normal()))
        self._phase_s = float(rng.uniform(0.0, self.period_s))
        self._turn = 0
        self._next = 0
        self._shining = False
        self.finished_s = 0.0
        self._range_m = np.zeros(BEAMS)
        self._cos = np.zeros(BEAMS)
        self._albedo = np.zeros(BEAMS)
        self._points = np.zeros((BEAMS, 2))

    @property
    def started_s(self) -> float:
        """When step 0 of the present turn was passed."""
        return self._phase_s + self._turn * self.period_s

    @property
    def _slit_s(self) -> float:
        return self.period_s / SLITS

    def step(
        self, begin_s: float, end_s: float, before: BodyState, after: BodyState, *, laser_on: bool
    ) -> NDArray[np.int64] | None:
        """Turn the mirror from begin_s to end_s; return a finished scan, int64 (769,) in mm or error codes.

        `finished_s` then tells when the turn of the returned scan had passed step 0.
        """
        if self._next == 0 and self.started_s <= end_s:
            self._shining = laser_on
        passed = (end_s - self.started_s) / self._slit_s - FIRST_STEP
        upto = min(BEAMS, max(self._next, math.floor(passed) + 1))
        if upto > self._next and self._shining and laser_on:
            self._cast(slice(self._next, upto), begin_s, end_s, before, after)
        self._next = upto
        if passed + FIRST_STEP < STEPS:
            return None
        scan = self._measure() if self._shining and laser_on else None
        self.finished_s = self.started_s
        self._next = 0
        self._turn += 1
        return scan

    def _cast(self, beams: slice, begin_s: float, end_s: float, before: BodyState, after: BodyState) -> None:
        """Cast the beams that fell into one step, each from where the robot was then."""
        config = self._config
        steps = np.arange(beams.start, beams.stop) + FIRST_STEP
        share = np.clip((self.started_s + steps * self._slit_s - begin_s) / (end_s - begin_s), 0.0, 1.0)
        yaw = before.yaw + (after.yaw - before.yaw) * share
        cos, sin = np.cos(yaw), np.sin(yaw)
        dx, dy, mount_yaw = config.T_base_laser
        starts = np.empty((len(steps), 3))
        starts[:, 0] = before.x + (after.x - before.x) * share + cos * dx - sin * dy
        starts[:, 1] = before.y + (after.y - before.y) * share + sin * dx + cos * dy
        starts[:, 2] = after.height_m + config.height_m
        angle = ANGLES_RAD[beams] + mount_yaw
        directions = np.empty_like(starts)
        directions[:, 0] = np.cos(yaw + angle)
        directions[:, 1] = np.sin(yaw + angle)
        directions[:, 2] = np.cos(angle) * math.tan(after.pitch) + np.sin(angle) * math.tan(after.roll)
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
            light = Light(self._range_m, self._cos, self._albedo, self._points)
            values = measure(light, self._config.optics, self._rng)
        scan[FIRST_STEP : LAST_STEP + 1] = values
        return scan

    def true_ranges_m(self, state: BodyState) -> NDArray[np.float64]:
        """Return what a perfect sensor would see from a standing robot, float64 (682,), +inf beyond reach."""
        self._cast(slice(0, BEAMS), self.started_s, self.started_s + self.period_s, state, state)
        self._next = 0
        return self._range_m.copy()
