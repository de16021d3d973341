"""Where the wheels and the gyro say the base is: T_odom_base, continuous, drifting.

Distance comes from the wheels, heading from the gyro: a wheel slips, and a wheel base of 0.23 m turns a slip
of 2 mm into half a degree. The gyro's own error, a slow drift, shows whenever the wheels stand still; it is
learnt there and taken off everywhere.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lemtomap.se2 import Pose, wrap_angle
from lemtomap.settings import within
from lemtomap.types import Odometry


@dataclass(frozen=True, slots=True)
class OdometryConfig:
    """Geometry of the base, and when it stands still."""

    metres_per_tick: float = within(1.0 / 11724.41658029856624751591, 7e-5, 1e-4)
    """From kobuki_core, diff_drive.hpp."""
    wheel_base_m: float = within(0.23, 0.2, 0.26)  # kobuki_core
    wheel_scale: float = within(1.0, 0.8, 1.25)
    """True distance over odometry's, of this robot's wheels."""
    max_wheel_mps: float = within(1.2, 0.7, 3.0)
    """The Kobuki does 0.7; faster is a base that was switched off and on."""
    still_after_s: float = within(0.5, 0.1, 10.0)
    """No tick for this long is standing still."""
    still_rate_radps: float = within(0.02, 0.001, 0.2)
    """1.1 deg/s: the base is not being carried or turned by hand."""
    bias_memory_s: float = within(60.0, 1.0, 3600.0)
    """The gyro's drift is the mean over so much standing."""
    max_bias_radps: float = within(0.01, 0.0, 0.1)
    """From kobuki#371: "a couple of degrees a minute at worst", with a wide margin."""


class WheelGyroOdometry:
    """Adds up one robot's motion. Starts at the identity."""

    def __init__(self, config: OdometryConfig | None = None) -> None:
        self.config = config or OdometryConfig()
        self.gyro_bias_radps = 0.0
        """Learnt while standing: what the gyro says it turns when it does not."""
        self._bias_weight_s = 0.0
        self._last: tuple[float, int, int, float] | None = None
        self._pose = (0.0, 0.0, 0.0)
        self._still_s = 0.0

    @property
    def standing(self) -> bool:
        """Return True if the base stands still."""
        return self._still_s >= self.config.still_after_s

    def update(
        self, stamp_s: float, left_ticks: int, right_ticks: int, gyro_yaw_rad: float, gyro_rate_radps: float
    ) -> Odometry:
        """Take one packet's encoders (wrapping at 65536) and heading (modulo a turn; NaN: wheels only).

        Holds: the yaw returned never jumps, however encoders and heading wrap; a stamp that does not advance
        adds nothing.
        """
        if self._last is None or stamp_s <= self._last[0]:
            self._last = self._last or (stamp_s, left_ticks, right_ticks, gyro_yaw_rad)
            return self._odometry(stamp_s, 0.0, 0.0)
        elapsed_s = stamp_s - self._last[0]
        left_m = self._travel_m(left_ticks - self._last[1], elapsed_s)
        right_m = self._travel_m(right_ticks - self._last[2], elapsed_s)
        turn_rad = (right_m - left_m) / self.config.wheel_base_m
        moved = left_m != 0.0 or right_m != 0.0
        if math.isfinite(gyro_yaw_rad) and math.isfinite(self._last[3]):
            turn_rad = self._gyro_turn_rad(
                gyro_yaw_rad - self._last[3], gyro_rate_radps, elapsed_s, moved=moved
            )
        self._last = (stamp_s, left_ticks, right_ticks, gyro_yaw_rad)
        distance_m = 0.5 * (left_m + right_m)
        self._advance(distance_m, turn_rad)
        rate = (
            gyro_rate_radps - self.gyro_bias_radps if math.isfinite(gyro_rate_radps) else turn_rad / elapsed_s
        )
        return self._odometry(stamp_s, distance_m / elapsed_s, 0.0 if self.standing else rate)

    def _travel_m(self, ticks: int, elapsed_s: float) -> float:
        ticks = (ticks + 0x8000) % 0x10000 - 0x8000
        travel_m = ticks * self.config.metres_per_tick * self.config.wheel_scale
        return travel_m if abs(travel_m) <= self.config.max_wheel_mps * max(elapsed_s, 0.02) else 0.0

    def _gyro_turn_rad(
        self, difference_rad: float, rate_radps: float, elapsed_s: float, *, moved: bool
    ) -> float:
        turn_rad = math.remainder(difference_rad, 2.0 * math.pi)
        quiet = not moved and not abs(rate_radps) > self.config.still_rate_radps
        self._still_s = self._still_s + elapsed_s if quiet else 0.0
        if self.standing:
            self._learn_bias(turn_rad, elapsed_s)
            return 0.0
        return turn_rad - self.gyro_bias_radps * elapsed_s

    def _learn_bias(self, turn_rad: float, elapsed_s: float) -> None:
        """Keep the mean of what the gyro turned while the base did not."""
        total_s = self._bias_weight_s + elapsed_s
        bias = (self.gyro_bias_radps * self._bias_weight_s + turn_rad) / total_s
        limit = self.config.max_bias_radps
        self.gyro_bias_radps = max(-limit, min(limit, bias))
        self._bias_weight_s = min(total_s, self.config.bias_memory_s)

    def _advance(self, distance_m: float, turn_rad: float) -> None:
        """Move along the arc by its chord's direction (mid-point rule)."""
        x, y, yaw = self._pose
        middle = yaw + 0.5 * turn_rad
        x += distance_m * math.cos(middle)
        y += distance_m * math.sin(middle)
        self._pose = (x, y, math.remainder(yaw + turn_rad, 2.0 * math.pi))

    def _odometry(self, stamp_s: float, v_mps: float, w_radps: float) -> Odometry:
        return Odometry(stamp_s, np.array(self._pose), v_mps, w_radps)


class NotCovered(LookupError):
    """The buffer does not reach this far back, or not yet this far."""


class OdometryBuffer:
    """The last poses, to be asked for any moment between the oldest and the newest."""

    def __init__(self, capacity: int = 500) -> None:
        self._capacity = capacity
        self._kept: list[Odometry] = []
        self._stamps_s: NDArray[np.float64] = np.zeros(2 * capacity)
        self._poses: Pose = np.zeros((2 * capacity, 3))
        self._first = self._end = 0

    def __len__(self) -> int:
        return self._end - self._first

    def __iter__(self) -> Iterator[Odometry]:
        return iter(self._kept[self._first : self._end])

    def add(self, odometry: Odometry) -> None:
        """Keep a pose; one that is not newer than the last replaces nothing and is left out."""
        if len(self) and odometry.stamp_s <= self._stamps_s[self._end - 1]:
            return
        if self._end == len(self._stamps_s):
            self._compact()
        pose = np.array(odometry.T_odom_base)
        if len(self):  # keep the yaw without wraps, so that it can be interpolated
            before = self._poses[self._end - 1, 2]
            pose[2] = before + wrap_angle(pose[2] - before)
        self._stamps_s[self._end], self._poses[self._end] = odometry.stamp_s, pose
        self._kept.append(odometry)
        self._end += 1
        self._first = max(self._first, self._end - self._capacity)

    def covers(self, *stamps_s: float) -> bool:
        """Return True if all these moments lie between the oldest and the newest pose."""
        return bool(len(self)) and self.oldest_s <= min(stamps_s) and max(stamps_s) <= self.newest_s

    @property
    def oldest_s(self) -> float:
        """Stamp of the oldest pose."""
        return float(self._stamps_s[self._first])

    @property
    def newest_s(self) -> float:
        """Stamp of the newest pose."""
        return float(self._stamps_s[self._end - 1])

    def at(self, stamps_s: ArrayLike) -> Pose:
        """Return T_odom_base at these moments, float64 (..., 3), interpolated. Raises NotCovered."""
        wanted = np.asarray(stamps_s, dtype=np.float64)
        if wanted.size and not self.covers(float(wanted.min()), float(wanted.max())):
            have = f"{self.oldest_s:.3f} to {self.newest_s:.3f} s" if len(self) else "nothing"
            asked = f"{float(wanted.min()):.3f} to {float(wanted.max()):.3f} s"
            raise NotCovered(f"odometry was asked for {asked} and covers {have}")
        stamps, poses = self._stamps_s[self._first : self._end], self._poses[self._first : self._end]
        columns = [np.interp(wanted, stamps, poses[:, column]) for column in range(3)]
        columns[2] = wrap_angle(columns[2])
        return np.stack(columns, axis=-1)

    def odometry_during(self, stamps_s: NDArray[np.floating]) -> Odometry:
        """Return pose and velocity at the first of a scan's beams, and the poses at all of them.

        stamps_s: float64 (N,). Raises NotCovered.
        """
        return replace(self.odometry_at(float(stamps_s[0])), T_odom_base_beams=self.at(stamps_s))

    def odometry_at(self, stamp_s: float) -> Odometry:
        """Return pose and velocity at one moment. Raises NotCovered."""
        pose = self.at(stamp_s)
        index = int(np.searchsorted(self._stamps_s[self._first : self._end], stamp_s))
        nearest = self._kept[self._first + index]
        return Odometry(stamp_s, pose, nearest.v_mps, nearest.w_radps)

    def _compact(self) -> None:
        kept = slice(self._first, self._end)
        size = len(self)
        self._stamps_s[:size], self._poses[:size] = self._stamps_s[kept].copy(), self._poses[kept].copy()
        self._kept = self._kept[kept]
        self._poses[:size, 2] -= 2.0 * np.pi * np.round(self._poses[0, 2] / (2.0 * np.pi))
        self._first, self._end = 0, size
