"""What the robot does when it does not get on: a ladder of recoveries, each bounded in time and distance."""

from collections import deque
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from lemtomap import se2
from lemtomap.nav.config import RecoveryConfig
from lemtomap.se2 import Pose
from lemtomap.types import Twist


class RecoveryBehaviour(IntEnum):
    """The ladder, in order."""

    REPLAN = 0
    CLEAR = 1
    TURN = 2
    BACK_OFF = 3
    BLOCK = 4
    """Close the next edge of the route and look for another way."""


class ProgressWatch:
    """Tells when the robot has not come nearer to its goal for too long.

    The way may prove longer than it was believed to be (a later part of a winding route had been taken for
    the next one). Then what is made good of the longer way counts, but only so many times for a goal: two
    targets by turns must not pass for progress for ever.
    """

    def __init__(self, config: RecoveryConfig) -> None:
        self._config = config
        self._best_m = np.inf
        self._since_s = -np.inf
        self._gained_m = 0.0
        self._longest_m = -np.inf
        self._rises = 0

    def restart(self, now_s: float) -> None:
        """Begin anew: a new goal or a new route."""
        self._best_m, self._longest_m, self._rises = np.inf, -np.inf, 0
        self.grace(now_s)

    def take_gain(self) -> float:
        """Return the metres made good since the last call."""
        gained_m, self._gained_m = self._gained_m, 0.0
        return gained_m

    def move_goal(self) -> None:
        """The goal moved while the robot did not: measure anew, but the clock runs on."""
        self._best_m, self._longest_m = np.inf, -np.inf

    def grace(self, now_s: float) -> None:
        """Give what is being tried its time; what had been reached before still stands."""
        self._since_s = now_s

    def stuck(self, remaining_m: float, now_s: float) -> bool:
        """Take the way still to go; True when it has not shrunk for longer than allowed."""
        if np.isinf(self._best_m):
            self._best_m = remaining_m
        elif remaining_m < self._best_m - self._config.progress_m:
            self._gained_m += self._best_m - remaining_m
            self._best_m = self._longest_m = remaining_m
            self._since_s = now_s
        elif self._proved_longer(remaining_m):
            self._rises += 1
            self._best_m = self._longest_m = remaining_m
            self._since_s = now_s
        self._longest_m = max(self._longest_m, remaining_m)
        return now_s - self._since_s > self._config.progress_s

    def _proved_longer(self, remaining_m: float) -> bool:
        """Return True if a good piece was made good of a way that is longer than it was believed to be."""
        made_good_m = self._longest_m - remaining_m
        return self._rises < self._config.longer_ways and made_good_m >= self._config.longer_way_m


class BreadcrumbTrail:
    """The last metres driven, to go back along them."""

    def __init__(self, length_m: float = 2.0, step_m: float = 0.04) -> None:
        self._step_m = step_m
        self._crumbs: deque[Pose] = deque(maxlen=int(length_m / step_m))
        self._leg_T_odom: Pose | None = None
        self.stayed_m = 0.0
        """How far from where the leg was started the robot has been."""

    def start_leg(self) -> None:
        """Measure stayed_m from here."""
        self._leg_T_odom, self.stayed_m = None, 0.0

    def drove(self, T_odom_base: Pose) -> None:
        """Drop a crumb when the robot has moved on."""
        if self._leg_T_odom is None:
            self._leg_T_odom = np.array(T_odom_base)
        self.stayed_m = max(self.stayed_m, float(np.hypot(*(T_odom_base - self._leg_T_odom)[:2])))
        if not self._crumbs or np.hypot(*(T_odom_base - self._crumbs[-1])[:2]) >= self._step_m:
            self._crumbs.append(np.array(T_odom_base))

    def twist_back(self, T_odom_base: Pose, v_mps: float) -> Twist:
        """Return the reverse twist that follows the crumbs; straight back when there are none behind."""
        while self._crumbs:
            x, y, _ = se2.between(T_odom_base, self._crumbs[-1])
            if x < -0.08:
                away2 = x * x + y * y
                return Twist(-v_mps, float(np.clip(-v_mps * 2.0 * y / away2, -0.5, 0.5)))
            self._crumbs.pop()
        return Twist(-v_mps, 0.0)


@dataclass(slots=True)
class _Running:
    rung: RecoveryBehaviour
    until_s: float
    limit_m: float
    T_odom_begun: Pose
    turned_rad: float = 0.0
    last_yaw_rad: float = 0.0


class RecoverySequence:
    """Climbs one rung each time the robot is stuck again; begins at the foot after progress."""

    def __init__(self, config: RecoveryConfig) -> None:
        self._config = config
        self._next = RecoveryBehaviour.REPLAN
        self._rounds = 0
        self._gained_m = 0.0
        self._running: _Running | None = None

    @property
    def running(self) -> bool:
        """True while a rung that moves the robot is under way."""
        return self._running is not None

    @property
    def name(self) -> str:
        """What is being tried."""
        return "" if self._running is None else self._running.rung.name.lower().replace("_", " ")

    @property
    def exhausted(self) -> bool:
        """True when the whole ladder has been climbed as often as allowed."""
        return self._rounds >= self._config.attempts

    def reset(self) -> None:
        """Start from the foot for a new goal."""
        self._next, self._rounds, self._running = RecoveryBehaviour.REPLAN, 0, None

    def relax(self, gained_m: float) -> None:
        """Start from the foot after progress; only much of it lets past failures be forgotten."""
        if self._running is not None or gained_m == 0.0:
            return
        self._next = RecoveryBehaviour.REPLAN
        self._gained_m += gained_m
        if self._gained_m >= self._config.forgive_m:
            self._rounds = 0

    def climb(self, T_odom_base: Pose, now_s: float) -> RecoveryBehaviour:
        """Take the next rung; turning and backing off then run through `step`."""
        rung, self._gained_m = self._next, 0.0
        self._next = RecoveryBehaviour((rung + 1) % len(RecoveryBehaviour))
        if rung == RecoveryBehaviour.BLOCK:
            self._rounds += 1
        elif rung == RecoveryBehaviour.TURN:
            self._begin(rung, self._config.turn_s, np.inf, T_odom_base, now_s)
        elif rung == RecoveryBehaviour.BACK_OFF:
            self.back_off(T_odom_base, now_s, self._config.back_off_m)
        return rung

    def back_off(self, T_odom_base: Pose, now_s: float, limit_m: float) -> None:
        """Go back now, whatever rung is next (after a bump)."""
        self._begin(RecoveryBehaviour.BACK_OFF, self._config.back_off_s, limit_m, T_odom_base, now_s)

    def _begin(
        self, rung: RecoveryBehaviour, time_s: float, limit_m: float, T_odom_base: Pose, now_s: float
    ) -> None:
        self._running = _Running(
            rung, now_s + time_s, limit_m, np.array(T_odom_base), 0.0, float(T_odom_base[2])
        )

    def step(
        self, T_odom_base: Pose, way_back: BreadcrumbTrail, now_s: float, *, room_behind: bool
    ) -> Twist | None:
        """Return the twist of the rung under way, or None when it has ended."""
        run = self._running
        if run is None:
            return None
        run.turned_rad += abs(float(se2.wrap_angle(T_odom_base[2] - run.last_yaw_rad)))
        run.last_yaw_rad = float(T_odom_base[2])
        moved_m = float(np.hypot(*(T_odom_base - run.T_odom_begun)[:2]))
        over = now_s >= run.until_s or moved_m >= run.limit_m
        if run.rung == RecoveryBehaviour.TURN and run.turned_rad >= 2.0 * np.pi:
            over = True
        if run.rung == RecoveryBehaviour.BACK_OFF and not room_behind:
            over = True
        if over:
            self._running = None
            return None
        if run.rung == RecoveryBehaviour.TURN:
            return Twist(0.0, self._config.turn_radps)
        return way_back.twist_back(T_odom_base, self._config.back_off_mps)
