"""Odometry between scans, and how far it may be wrong."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lemtomap.grid.config import SlamConfig
from lemtomap.se2 import Pose

SEES_WELL = 0.8  # share of the scan in a match along the way, from which on it judges the odometry


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """How far a step of odometry may be wrong, the same along x and y."""

    sigma_m: float
    sigma_rad: float


Numbers = tuple[float, float, float]
"""One pose in plain numbers: x m, y m, yaw rad; products of several cost a third of what arrays do."""


def numbers(T_a_b: Pose) -> Numbers:
    """Return a single pose in plain numbers."""
    x, y, yaw = T_a_b.tolist()
    return x, y, yaw


def product(T_a_b: Numbers, T_b_c: Numbers) -> Numbers:
    """Return T_a_c."""
    (x, y, yaw), (u, v, turn) = T_a_b, T_b_c
    c, s = math.cos(yaw), math.sin(yaw)
    total = (yaw + turn + math.pi) % (2.0 * math.pi) - math.pi
    return x + c * u - s * v, y + s * u + c * v, total


def quotient(T_w_a: Numbers, T_w_b: Numbers) -> Numbers:
    """Return T_a_b."""
    (x, y, yaw), (u, v, turn) = T_w_a, T_w_b
    c, s = math.cos(yaw), math.sin(yaw)
    total = (turn - yaw + math.pi) % (2.0 * math.pi) - math.pi
    return c * (u - x) + s * (v - y), -s * (u - x) + c * (v - y), total


def compose(T_a_b: Pose, T_b_c: Pose) -> Pose:
    """Return T_a_c of two single poses; as se2.compose, for the path that every scan takes."""
    return np.array(product(numbers(T_a_b), numbers(T_b_c)))


def between(T_w_a: Pose, T_w_b: Pose) -> Pose:
    """Return T_a_b of two single poses; as se2.between, for the path that every scan takes."""
    return np.array(quotient(numbers(T_w_a), numbers(T_w_b)))


def odometry_uncertainty(step: Pose, config: SlamConfig) -> Uncertainty:
    """Return the error that the length and turn of a step allow."""
    x, y, yaw = step.tolist()
    way, turn = math.hypot(x, y), abs(yaw)
    return Uncertainty(
        config.odometry_floor_m + config.odometry_m_per_m * way + config.odometry_m_per_rad * turn,
        config.odometry_floor_rad + config.odometry_rad_per_rad * turn + config.odometry_rad_per_m * way,
    )


def odometry_drift(step: Pose, config: SlamConfig) -> Uncertainty:
    """Return how far odometry drifts over a step, one standard deviation.

    The errors of pieces as long as from one integration to the next are independent: a random walk. The
    uncertainty above grows in proportion, for a match must find what one slip did.
    """
    x, y, yaw = step.tolist()
    pieces_m = math.hypot(x, y) * config.integrate_distance_m
    pieces_rad = abs(yaw) * config.integrate_turn_rad
    return Uncertainty(
        math.sqrt(config.odometry_m_per_m**2 * pieces_m + config.odometry_m_per_rad**2 * pieces_rad),
        math.sqrt(config.odometry_rad_per_rad**2 * pieces_rad + config.odometry_rad_per_m**2 * pieces_m),
    )


class WheelTrust:
    """Learns from the matches how much farther off this robot's odometry is along its way than the settings
    say: slipping wheels, and stamps that do not fit the scans.
    """

    def __init__(self, config: SlamConfig) -> None:
        self._memory = config.trust_memory
        self._bounds = config.trust_least**2, config.trust_most**2
        self._variance_ratio = 1.0

    def widen(self, uncertainty: Uncertainty) -> Uncertainty:
        """Return the uncertainty of a step as experience has it."""
        return Uncertainty(math.sqrt(self._variance_ratio) * uncertainty.sigma_m, uncertainty.sigma_rad)

    def learn(
        self, correction: Pose, heading_rad: float, information: NDArray[np.float64], uncertainty: Uncertainty
    ) -> None:
        """Take what a match changed of its prediction; information float64 (3, 3) of the scan alone, both in
        grid. Only a scan that sees well along the way has a say. uncertainty: as the settings have it.
        """
        x, y = math.cos(heading_rad), math.sin(heading_rad)
        seen = x * x * information[0, 0] + 2.0 * x * y * information[0, 1] + y * y * information[1, 1]
        share = float(seen / (seen + 1.0 / self.widen(uncertainty).sigma_m ** 2))
        if share < SEES_WELL:
            return
        innovation_m = float(x * correction[0] + y * correction[1]) / share
        least, most = self._bounds
        ratio = min((innovation_m / uncertainty.sigma_m) ** 2, 4.0 * most)
        self._variance_ratio += self._memory * (ratio - self._variance_ratio)
        self._variance_ratio = min(max(self._variance_ratio, least), most)


class HeadingTrust:
    """Learns from the matches by how much less this robot's heading drifts than the settings allow: a gyro's
    by a tenth of what wheels do.

    One match errs by as much as a gyro does over metres; what the corrections of a stretch add up to tells.
    """

    def __init__(self, config: SlamConfig) -> None:
        self._config = config
        self._variance_ratio = 1.0
        self._corrected_rad = self._allowed = self._way_m = 0.0

    def narrow(self, drift: Uncertainty) -> Uncertainty:
        """Return the drift of a stretch as experience has it."""
        return Uncertainty(drift.sigma_m, math.sqrt(self._variance_ratio) * drift.sigma_rad)

    def learn(self, correction_rad: float, step: Pose, information_rad: float, sigma_rad: float) -> None:
        """Take what a match changed of the heading that a step predicted.

        information_rad: the scan's alone, 1/rad^2; sigma_rad: how far the match let it differ. A scan that
        does not see the heading well ends the stretch untold.
        """
        share = information_rad / (information_rad + 1.0 / sigma_rad**2)
        if share < SEES_WELL:
            self._start()
            return
        self._corrected_rad += correction_rad / share
        self._allowed += odometry_drift(step, self._config).sigma_rad ** 2
        self._way_m += math.hypot(step[0], step[1])
        if self._way_m >= self._config.heading_stretch_m:
            ratio = self._corrected_rad**2 / self._allowed
            self._variance_ratio += self._config.heading_memory * (ratio - self._variance_ratio)
            self._variance_ratio = min(max(self._variance_ratio, self._config.heading_least**2), 1.0)
            self._start()

    def _start(self) -> None:
        self._corrected_rad = self._allowed = self._way_m = 0.0
