"""The published correction T_grid_odom: follows the estimate, but never faster than a controller can bear."""

import math

from lemtomap.grid.config import SlamConfig
from lemtomap.grid.motion import between, compose
from lemtomap.se2 import IDENTITY, Pose


class SmoothCorrection:
    """Spreads each correction over several scans; closes a large gap at once and says so."""

    def __init__(self, config: SlamConfig) -> None:
        self._most_m, self._most_rad = config.smooth_m, config.smooth_rad
        self._jump_m, self._jump_rad = config.jump_m, config.jump_rad
        self._T_grid_odom: Pose | None = None

    def follow(self, T_grid_base: Pose, T_odom_base: Pose) -> tuple[Pose, bool]:
        """Return (T_grid_odom, jumped). Limits hold at the robot, where they are felt, not at odom's far
        origin.
        """
        T_base_odom = between(T_odom_base, IDENTITY)
        if self._T_grid_odom is None:
            self._T_grid_odom = compose(T_grid_base, T_base_odom)
            return self._T_grid_odom, False
        T_grid_shown = compose(self._T_grid_odom, T_odom_base)
        gap = between(T_grid_shown, T_grid_base)
        way, turn = math.hypot(gap[0], gap[1]), abs(float(gap[2]))
        jumped = way > self._jump_m or turn > self._jump_rad
        share = 1.0
        if not jumped:
            share = min(1.0, self._most_m / max(way, 1e-12), self._most_rad / max(turn, 1e-12))
        T_grid_shown = T_grid_base if share == 1.0 else compose(T_grid_shown, gap * share)
        self._T_grid_odom = compose(T_grid_shown, T_base_odom)
        return self._T_grid_odom, jumped
