"""The URG-04LX-UG01's optics: a mirror that turns while the robot drives, and what comes back of its light.

The range error follows the data sheet (+-30 mm to 1 m, +-3 % above, taken as three standard deviations)
and is split: one part stays with each patch of surface (its colour shifts the phase measurement), the rest is
new every time. What returns nothing is decided by light: albedo, angle of incidence and distance.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.body import BodyState
from sim.hokuyo import FIRST_STEP, FRONT_STEP, LAST_STEP, NOT_MEASURABLE, SLITS, STEPS
from sim.scene import Scene
from sim.world import Pose2

BEAMS = LAST_STEP - FIRST_STEP + 1
ANGLES_RAD: NDArray[np.float64] = np.array(
    [(step - FRONT_STEP) * 2 * math.pi / SLITS for step in range(FIRST_STEP, LAST_STEP + 1)]
)
NOTHING, WEAK, OTHER, NEIGHBOUR, TWO_WAVES = 0, 1, 6, 7, 8
"""Error codes (section 7.1)."""


@dataclass(frozen=True, slots=True)
class UrgConfig:
    """The sensor and where it sits."""

    T_base_laser: Pose2 = (0.0, 0.0, 0.0)
    height_m: float = 0.25
    """Above the floor: on the TurtleBot's second plate."""
    max_m: float = 5.6
    """DMAX of the sensor."""
    reach_m: float = 6.4
    """How far a white wall, square to the beam, still gives an answer; from the shares of exp1.dat."""
    near_sigma_m: float = 0.010
    """A third of +-30 mm."""
    far_sigma: float = 0.010
    """A third of +-3 %."""
    patch_share: float = 0.8
    """Share of the standard deviation that belongs to the patch of surface (repeatability is far better
    than accuracy: 3 to 10 mm on a standing exp1.dat)."""
    patch_m: float = 0.25
    albedo_spread: float = 0.5
    """Paint differs: a patch gives back between (1 - spread) and 1 of its surface's albedo."""
    footprint_m: float = 0.15
    """A jump in range between two neighbours beyond this is an edge, where one beam meets two surfaces."""
    edge_mixed: float = 0.15
    """Chance that an edge beam gives a value in between."""
    edge_error: float = 0.25
    """Chance that an edge beam gives an error code."""
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
        self._patch = np.zeros((BEAMS, 2))

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
        ends = starts + directions * config.max_m
        hits = self._scene.cast(starts, ends)
        self._range_m[beams] = np.where(hits.body >= 0, hits.share * config.max_m, np.inf)
        self._cos[beams] = np.abs((hits.normal * directions).sum(axis=1))
        self._albedo[beams] = self._scene.albedo[hits.body]
        self._patch[beams] = np.floor(
            (starts + directions * (hits.share * config.max_m)[:, None]) / config.patch_m
        )[:, :2]

    def _measure(self) -> NDArray[np.int64]:
        """Return what the electronics make of one turn."""
        config, rng = self._config, self._rng
        scan = np.full(STEPS, NOT_MEASURABLE, dtype=np.int64)
        values = scan[FIRST_STEP : LAST_STEP + 1]
        if config.blocked is not None and config.blocked[0] <= self.started_s < config.blocked[1]:
            values[:] = rng.choice([NOTHING, WEAK, 25, 31], size=BEAMS)
            return scan
        hit = np.isfinite(self._range_m)
        distance = np.where(hit, self._range_m, config.max_m)
        patch = _hash_uniform(self._patch)
        sigma = np.maximum(config.near_sigma_m, config.far_sigma * distance)
        fresh = rng.standard_normal(BEAMS)
        measured = distance + sigma * (
            config.patch_share * np.sqrt(12.0) * (patch - 0.5)
            + math.sqrt(1.0 - config.patch_share**2) * fresh
        )
        values[:] = np.rint(measured * 1000.0)
        self._mix_edges(values, distance)
        light = self._albedo * (1.0 - config.albedo_spread * _hash_uniform(self._patch + 0.5)) * self._cos
        needed = 0.8 * (1.0 - config.albedo_spread / 2) * (distance / config.reach_m) ** 2
        lost = ~hit | (light < needed * (0.85 + 0.3 * rng.random(BEAMS)))
        values[lost] = self._code_of_lost(int(lost.sum()))
        values[(values < 20) & ~lost] = WEAK
        values[values > round(config.max_m * 1000)] = NOTHING
        return scan

    def _mix_edges(self, values: NDArray[np.int64], distance: NDArray[np.float64]) -> None:
        jump = np.flatnonzero(np.abs(np.diff(distance)) > self._config.footprint_m)
        chance = self._rng.random(len(jump))
        share = self._rng.random(len(jump))
        mixed = jump[chance < self._config.edge_mixed]
        between = distance[mixed] + share[: len(mixed)] * (distance[mixed + 1] - distance[mixed])
        values[mixed] = np.rint(between * 1000.0)
        failed = jump[chance > 1.0 - self._config.edge_error]
        values[failed] = self._rng.choice(
            [NEIGHBOUR, OTHER, TWO_WAVES], size=len(failed), p=[0.6, 0.35, 0.05]
        )

    def _code_of_lost(self, count: int) -> NDArray[np.int64]:
        """Return error codes in the shares of exp1.dat: nearly all 0."""
        codes = self._rng.random(count)
        table = np.array([NOTHING, OTHER, NEIGHBOUR, WEAK])
        return np.asarray(table[np.searchsorted([0.955, 0.97, 0.995], codes)])


def _hash_uniform(cells: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a fixed pseudo-random number in [0, 1) for each cell, float64 (N,) from (N, 2)."""
    mixed = np.sin(cells[:, 0] * 12.9898 + cells[:, 1] * 78.233) * 43758.5453
    return np.asarray(mixed - np.floor(mixed))
