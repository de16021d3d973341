"""From a metric plan to a velocity: turn only when needed, drive, slow down at the end, take the heading."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from lemtomap.nav.config import NavConfig
from lemtomap.nav.motion.dwa import (
    ArcEnd,
    approach,
    choose_twist,
)
from lemtomap.nav.motion.metric import MetricPlan
from lemtomap.se2 import Pose, wrap_angle
from lemtomap.types import Twist


class FollowerState(StrEnum):
    """What the follower is doing."""

    TURN = "turn"
    DRIVE = "drive"
    STUCK = "stuck"
    """Every trajectory collides."""
    THERE = "there"


@dataclass(frozen=True, slots=True)
class Step:
    """One control cycle's command."""

    twist: Twist
    motion: FollowerState


class Follower:
    """Holds only whether it is turning in place and whether it has reached the spot."""

    def __init__(self, config: NavConfig) -> None:
        self._config = config
        self._turning = False
        self._reached = False

    def restart(self) -> None:
        """Begin a new goal; speed carries over."""
        self._turning = self._reached = False

    def step(self, plan: MetricPlan, T_grid_base: Pose, twist: Twist, end_m: float | None) -> Step:
        """Return the next command along the plan.

        end_m: way left to the goal in metres, when the plan's target is the goal itself; None while the
        target is a node to pass, where the robot does not slow down.
        """
        config, body = self._config, self._config.body
        follow, held_mps = config.follow, config.dwa.held_mps
        heading_off = way_heading_off(plan, T_grid_base, follow.look_m)
        if self._must_turn(heading_off, twist):
            return Step(turn_in_place(heading_off, twist, config), FollowerState.TURN)
        ending = None if end_m is None else ArcEnd(end_m)
        choice = choose_twist(plan, T_grid_base, twist, ending, body, config.dwa)
        held = choice.twist is None or choice.twist.v_mps < held_mps
        if held and abs(heading_off) > follow.held_turn_rad and twist.v_mps < held_mps:
            return Step(turn_in_place(heading_off, twist, config), FollowerState.TURN)
        if choice.twist is None:
            return Step(approach(twist, Twist(0.0, 0.0), body, config.period_s), FollowerState.STUCK)
        return Step(approach(twist, choice.twist, body, config.period_s), FollowerState.DRIVE)

    def at_goal(self, end_m: float, tolerance_m: float) -> bool:
        """Return True if the spot is reached; then turning may stray by as much again."""
        self._reached = end_m <= (2.0 * tolerance_m if self._reached else tolerance_m)
        return self._reached

    def halt(self, T_grid_base: Pose, twist: Twist, yaw_grid_rad: float | None) -> Step:
        """At the goal: come to rest, take the heading asked for, say THERE."""
        config = self._config
        off = 0.0 if yaw_grid_rad is None else float(wrap_angle(yaw_grid_rad - T_grid_base[2]))
        if abs(off) > config.yaw_tolerance_rad:
            return Step(turn_in_place(off, twist, config), FollowerState.TURN)
        slower = approach(twist, Twist(0.0, 0.0), config.body, config.period_s)
        resting = slower.v_mps == 0.0 and slower.w_radps == 0.0
        return Step(slower, FollowerState.THERE if resting else FollowerState.DRIVE)

    def _must_turn(self, heading_off: float, twist: Twist) -> bool:
        config, follow = self._config, self._config.follow
        moving = abs(twist.v_mps) > follow.moving_mps
        start = follow.moving_turn_rad if moving else config.turn_start_rad
        limit = config.turn_end_rad if self._turning else start
        self._turning = abs(heading_off) > limit
        return self._turning


def way_heading_off(plan: MetricPlan, T_grid_base: Pose, look_m: float) -> float:
    """Return the angle in rad from the heading to the start of the way; 0 when the way is very short."""
    path = plan.path_grid
    away = np.hypot(*(path - T_grid_base[:2]).T)
    beyond = np.flatnonzero(away >= look_m)
    index = int(beyond[0]) if beyond.size else len(path) - 1
    if away[index] < 0.08:
        return 0.0
    dx, dy = path[index] - T_grid_base[:2]
    return float(wrap_angle(np.arctan2(dy, dx) - T_grid_base[2]))


def turn_in_place(off_rad: float, twist: Twist, config: NavConfig) -> Twist:
    """Return the next command of a turn on the spot by off_rad that ends at rest."""
    body = config.body
    w = min(body.w_max_radps, float(np.sqrt(2.0 * 0.6 * body.turn_acceleration_radps2 * abs(off_rad))))
    return approach(twist, Twist(0.0, float(np.copysign(w, off_rad))), body, config.period_s)
