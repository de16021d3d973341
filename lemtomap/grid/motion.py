"""Odometry between scans, and how far it may be wrong."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lemtomap.grid.config import SlamConfig
from lemtomap.se2 import Pose


@dataclass(frozen=True, slots=True)
class Motion:
    """A step in the frame it started from, with its covariance there."""

    step: Pose
    covariance: NDArray[np.float64]
    """float64 (3, 3), m, m, rad."""


def compose(T_a_b: Pose, T_b_c: Pose) -> Pose:
    """Return T_a_c of two single poses; as se2.compose, for the path that every scan takes."""
    x, y, yaw = T_a_b.tolist()
    u, v, turn = T_b_c.tolist()
    c, s = math.cos(yaw), math.sin(yaw)
    total = (yaw + turn + math.pi) % (2.0 * math.pi) - math.pi
    return np.array([x + c * u - s * v, y + s * u + c * v, total])


def between(T_w_a: Pose, T_w_b: Pose) -> Pose:
    """Return T_a_b of two single poses; as se2.between, for the path that every scan takes."""
    x, y, yaw = T_w_a.tolist()
    u, v, turn = T_w_b.tolist()
    c, s = math.cos(yaw), math.sin(yaw)
    total = (turn - yaw + math.pi) % (2.0 * math.pi) - math.pi
    return np.array([c * (u - x) + s * (v - y), -s * (u - x) + c * (v - y), total])


def odometry_motion(step: Pose, config: SlamConfig) -> Motion:
    """Return a step of the odometry with the error that its length and turn allow."""
    x, y, yaw = step.tolist()
    way, turn = math.hypot(x, y), abs(yaw)
    sigma_m = config.odometry_floor_m + config.odometry_m_per_m * way + config.odometry_m_per_rad * turn
    sigma_rad = (
        config.odometry_floor_rad + config.odometry_rad_per_rad * turn + config.odometry_rad_per_m * way
    )
    return Motion(step, np.diag([sigma_m**2, sigma_m**2, sigma_rad**2]))


def rotated(covariance: NDArray[np.float64], yaw_rad: float) -> NDArray[np.float64]:
    """Return a covariance of [dx, dy, dyaw] with its axes turned by yaw."""
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(turn @ covariance @ turn.T)


def inverted(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the inverse of a symmetric positive definite 3 x 3 matrix."""
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)
