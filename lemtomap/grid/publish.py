"""The published correction T_grid_odom: follows the estimate, but never faster than a controller can bear."""

import math

import numpy as np

from lemtomap.grid.config import SlamConfig
from lemtomap.se2 import IDENTITY, Numbers, Pose, numbers, product, quotient

_IDENTITY = numbers(IDENTITY)


class SmoothCorrection:
    """Spreads each correction over several scans; closes a large gap at once and says so."""

    def __init__(self, config: SlamConfig) -> None:
        self._most_m, self._most_rad = config.smooth_m, config.smooth_rad
        self._jump_m, self._jump_rad = config.jump_m, config.jump_rad
        self._T_grid_odom: Numbers | None = None

    def follow(self, T_grid_base: Pose, T_odom_base: Pose) -> tuple[Pose, bool]:
        """Return (T_grid_odom, jumped). Limits hold at the robot, where they are felt, not at odom's far
        origin.
        """
        base, odom_base = numbers(T_grid_base), numbers(T_odom_base)
        T_base_odom = quotient(odom_base, _IDENTITY)
        if self._T_grid_odom is None:
            self._T_grid_odom = product(base, T_base_odom)
            return np.array(self._T_grid_odom), False
        shown = product(self._T_grid_odom, odom_base)
        x, y, yaw = quotient(shown, base)
        way, turn = math.hypot(x, y), abs(yaw)
        jumped = way > self._jump_m or turn > self._jump_rad
        share = 1.0
        if not jumped:
            share = min(1.0, self._most_m / max(way, 1e-12), self._most_rad / max(turn, 1e-12))
        shown = base if share == 1.0 else product(shown, (x * share, y * share, yaw * share))
        self._T_grid_odom = product(shown, T_base_odom)
        return np.array(self._T_grid_odom), jumped
