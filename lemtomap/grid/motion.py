"""Odometry between scans, and how far it may be wrong."""

import math
from dataclasses import dataclass

import numpy as np

from lemtomap.grid.config import SlamConfig
from lemtomap.se2 import Pose


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """How far a step of odometry may be wrong, the same along x and y."""

    sigma_m: float
    sigma_rad: float


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


def odometry_uncertainty(step: Pose, config: SlamConfig) -> Uncertainty:
    """Return the error that the length and turn of a step allow."""
    x, y, yaw = step.tolist()
    way, turn = math.hypot(x, y), abs(yaw)
    return Uncertainty(
        config.odometry_floor_m + config.odometry_m_per_m * way + config.odometry_m_per_rad * turn,
        config.odometry_floor_rad + config.odometry_rad_per_rad * turn + config.odometry_rad_per_m * way,
    )
