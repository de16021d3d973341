"""Odometry between scans, and how far it may be wrong."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lemtomap.grid.config import SlamConfig
from lemtomap.se2 import Pose

SEES = 0.5  # information of the scan against the prediction's, from which on it judges the odometry
FADES = 0.7  # from scan to scan, what a late stamp still means: half a second's worth at 10 Hz
FIRST_STRETCHES = 2  # that the settings count for in the drift

Information = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """How far a step of odometry may be wrong, the same along x and y."""

    sigma_m: float
    sigma_rad: float


def odometry_drift(step: Pose, config: SlamConfig) -> Uncertainty:
    """Return how far odometry drifts over a step, one standard deviation.

    The errors of pieces as long as from one integration to the next are independent: a random walk. What
    one match must find grows in proportion, for it may be what one slip did.
    """
    x, y, yaw = step.tolist()
    pieces_m = math.hypot(x, y) * config.integrate_distance_m
    pieces_rad = abs(yaw) * config.integrate_turn_rad
    return Uncertainty(
        math.sqrt(config.odometry_m_per_m**2 * pieces_m + config.odometry_m_per_rad**2 * pieces_rad),
        math.sqrt(config.odometry_rad_per_rad**2 * pieces_rad + config.odometry_rad_per_m**2 * pieces_m),
    )


class OdometryNoise:
    """What this robot's wheels and gyro have proven to be worth, learnt from the matches while they tell.

    Two scales tell odometry's errors apart. Stamps that do not fit the scans and wheels that slip show in
    one match, as a share of the motion. Drift of the heading shows in what the matches of a stretch add up
    to: one match errs by as much as a gyro does over metres, but the errors of matches do not add up.
    """

    def __init__(self, config: SlamConfig) -> None:
        self._config = config
        self._way_ratio = self._turn_ratio = self._drift_ratio = 1.0  # variances, against the settings'
        self._way_m = self._turn_rad = 0.0  # of a step lately: a late stamp shows in the steps after it too
        self._corrected_rad = self._allowed = self._stretch = 0.0
        self._stretches = FIRST_STRETCHES

    def drift(self, step: Pose) -> Uncertainty:
        """Return how far odometry drifts over a stretch, one standard deviation."""
        drift = odometry_drift(step, self._config)
        return Uncertainty(drift.sigma_m, math.sqrt(self._drift_ratio) * drift.sigma_rad)

    def prior(self, step: Pose) -> Uncertainty:
        """Return how far the prediction of one match may be off, one standard deviation."""
        share = self._shares(step)
        drift_rad = self.drift(step).sigma_rad
        return Uncertainty(
            math.sqrt(self._config.odometry_floor_m**2 + self._way_ratio * share.sigma_m**2),
            math.sqrt(
                self._config.odometry_floor_rad**2 + drift_rad**2 + self._turn_ratio * share.sigma_rad**2
            ),
        )

    def learn(self, correction: Pose, heading_rad: float, step: Pose, information: Information) -> None:
        """Take what a match changed of the prediction after a step.

        correction (3,) and information (3, 3) of the scan alone, both in grid; heading_rad as predicted.
        Only a direction in which the scan sees has a say.
        """
        prior, share = self.prior(step), self._shares(step)
        way, turn = prior.sigma_m**2, prior.sigma_rad**2
        x, y, yaw = correction.tolist()
        rows = information.tolist()
        pull = [
            h0 * x + h1 * y + h2 * yaw + own
            for (h0, h1, h2), own in zip(rows, (x / way, y / way, yaw / turn), strict=True)
        ]
        c, s = math.cos(heading_rad), math.sin(heading_rad)
        row = [c * h0 + s * h1 for h0, h1 in zip(rows[0], rows[1], strict=True)]
        seen = c * row[0] + s * row[1]
        if seen * way > SEES:
            spread = way * (row[0] ** 2 + row[1] ** 2) + turn * row[2] ** 2
            spread -= self._way_ratio * share.sigma_m**2 * seen**2
            ratio = _surprise(c * pull[0] + s * pull[1], seen, spread) / share.sigma_m**2
            self._way_ratio = self._moved(self._way_ratio, ratio)
        row, seen = rows[2], rows[2][2]
        if seen * turn > SEES and share.sigma_rad > self._config.odometry_turns_rad:
            spread = way * (row[0] ** 2 + row[1] ** 2) + turn * row[2] ** 2
            spread -= self._turn_ratio * share.sigma_rad**2 * seen**2
            ratio = _surprise(pull[2], seen, spread) / share.sigma_rad**2
            self._turn_ratio = self._moved(self._turn_ratio, ratio)
        self._end_step(float(correction[2]), step)

    def _shares(self, step: Pose) -> Uncertainty:
        """Return what the settings allow as a share of the motion, of this step or of one lately."""
        config = self._config
        x, y, yaw = step.tolist()
        way, turn = max(math.hypot(x, y), self._way_m), max(abs(yaw), self._turn_rad)
        return Uncertainty(
            config.odometry_m_per_m * way + config.odometry_m_per_rad * turn,
            config.odometry_rad_per_rad * turn,
        )

    def _moved(self, ratio: float, newest: float) -> float:
        """Return a ratio with the newest match taken in, within bounds."""
        least, most = self._config.trust_least**2, self._config.trust_most**2
        newest = min(max(newest, 0.0), 4.0 * most)
        return min(max(ratio + self._config.trust_memory * (newest - ratio), least), most)

    def _end_step(self, corrected_rad: float, step: Pose) -> None:
        """Let the step pass into the stretch, and the stretch into the drift when it is long enough."""
        config = self._config
        x, y, yaw = step.tolist()
        way_m, turn_rad = math.hypot(x, y), abs(yaw)
        self._way_m, self._turn_rad = max(way_m, FADES * self._way_m), max(turn_rad, FADES * self._turn_rad)
        self._corrected_rad += corrected_rad
        self._allowed += odometry_drift(step, config).sigma_rad ** 2
        self._stretch += way_m / config.heading_stretch_m + turn_rad / config.heading_stretch_rad
        if self._stretch < 1.0:
            return
        # one slip is not what the heading drifts by from now on
        ratio = min(self._corrected_rad**2 / self._allowed, 9.0 * self._drift_ratio)
        self._stretches += 1
        memory = max(config.heading_memory, 1.0 / self._stretches)
        self._drift_ratio += memory * (ratio - self._drift_ratio)
        self._drift_ratio = min(max(self._drift_ratio, config.heading_least**2), config.heading_most**2)
        self._corrected_rad = self._allowed = self._stretch = 0.0


def _surprise(pull: float, seen: float, spread: float) -> float:
    """Return the variance along one axis that explains how hard the scan pulls there.

    The pull of a scan at the prediction has the variance H + H Q H: that of the scan's own noise, `seen`, of
    the other errors of the prediction (diagonal Q), `spread`, and of the one asked for, which is left out of
    them.
    """
    return (pull**2 - seen - spread) / (seen * seen)
