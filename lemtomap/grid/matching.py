"""Scan matching: where in the window was this scan taken, how sure is that, and in which directions."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lemtomap.grid.beams import Beams
from lemtomap.grid.config import SlamConfig
from lemtomap.grid.kernels import matching as kernels
from lemtomap.grid.motion import Uncertainty
from lemtomap.grid.window import LookUp, Window
from lemtomap.se2 import Pose

NEWTON_ROUNDS = 12
CLIMB_STEP_M, CLIMB_STEP_RAD, CLIMB_ROUNDS = 0.08, 0.04, 3  # halved in each round, to two centimetres
CLIMB_TRUST = 0.002  # score given up per unit of squared Mahalanobis distance from odometry
SWEEP_STEP_M, SWEEP_STEP_RAD = 0.1, 0.05


class Rules(NamedTuple):
    """The numbers that kernels take."""

    resolution_m: float
    sigma_m: float
    noise_m: float
    point_weight: float
    degenerate_below: float
    newton_rounds: int
    climb_below: float
    climb_step_m: float
    climb_step_rad: float
    climb_rounds: int
    climb_trust: float
    sweep_step_m: float
    sweep_step_rad: float


@dataclass(frozen=True, slots=True)
class ScanMatch:
    """One scan against one window, the odometry prior included."""

    T_grid_base: Pose
    information: NDArray[np.float64]
    """float64 (3, 3) of the scan alone, grid axes: zero along what it cannot see."""
    covariance: NDArray[np.float64]
    """float64 (3, 3) of scan and odometry together, grid axes."""
    quality: float
    diversity: float
    accepted: bool


class Matcher:
    """Matches scans against windows under one set of rules."""

    def __init__(self, config: SlamConfig, tables: LookUp) -> None:
        self._min_points, self._min_quality = config.min_points, config.min_quality
        self._reach_m = config.search_m
        self._tables = tables
        self._rules = Rules(
            config.resolution_m,
            config.match_sigma_m,
            config.match_noise_m,
            config.point_weight,
            config.degenerate_below,
            NEWTON_ROUNDS,
            config.climb_below,
            CLIMB_STEP_M,
            CLIMB_STEP_RAD,
            CLIMB_ROUNDS,
            CLIMB_TRUST,
            SWEEP_STEP_M,
            SWEEP_STEP_RAD,
        )

    def __call__(
        self,
        beams: Beams,
        prior: Pose,
        uncertainty: Uncertainty,
        window: Window,
        reach_rad: float = 0.0,
    ) -> ScanMatch:
        """Return the pose that scan and prior agree on; reach_rad > 0 asks for headings that far round to
        be tried.
        """
        out = np.empty(23)
        if len(beams.hits) < self._min_points:
            return refused(prior, uncertainty)
        kernels.match(
            beams.hits,
            beams.normals_rad,
            beams.laser_base,
            prior,
            (1.0 / uncertainty.sigma_m**2, 1.0 / uncertainty.sigma_rad**2),
            window.arrays,
            self._tables,
            self._rules,
            reach_rad,
            self._reach_m if reach_rad > 0.0 else 0.0,
            out,
        )
        quality, diversity = out[21:].tolist()
        information, covariance = out[3:12].reshape(3, 3), out[12:21].reshape(3, 3)
        return ScanMatch(out[:3], information, covariance, quality, diversity, quality >= self._min_quality)


def refused(prior: Pose, uncertainty: Uncertainty) -> ScanMatch:
    """Return what is known when there is nothing to match: odometry alone."""
    covariance = np.diag([uncertainty.sigma_m**2, uncertainty.sigma_m**2, uncertainty.sigma_rad**2])
    return ScanMatch(prior, np.zeros((3, 3)), covariance, 0.0, 0.0, accepted=False)
