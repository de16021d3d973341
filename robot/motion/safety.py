"""The last gate before the wheels: (velocity wanted, evidence, now) -> (velocity allowed, reason).

Permission starts false. Silence stops. Every rule below has one defined reaction and one reason; the most
restrictive wins, and the reason names the rule that took something away:

    reason            when                                          reaction
    bad command       NaN or infinite velocity                      stop
    not permitted     no one has said that the robot may move       stop
    base timeout      no base packet for 0.2 s                      stop, then settle
    wheel drop        a wheel hangs in the air                      stop, then settle
    over-current      a motor draws too much                        stop, then settle
    settling          0.5 s after each of the three above           stop
    adapter           the charging cable is plugged in              stop
    battery empty     dangerously low for 5 s                       stop
    mapping hangs     a scan waits for the map for 0.25 s           stop
    navigation hangs  no cycle was begun for 0.25 s                 stop
    command timeout   no fresh velocity for 0.3 s                   stop
    scan timeout      no scan for 0.5 s and motion wanted           stop
    scan blind        (almost) no beam of the scan is valid         stop
    cliff             a cliff sensor sees no floor                  straight back, slowly, only
    bumper            a bumper is pressed                           forward: stop; else slow back, slow turn
    near obstacle     the raw scan has points on the way            slow down, stop before them, may turn away
    limit             faster than the limits                        clamp

The gate knows no planner, driver or clock: a wrong map cannot talk it into driving.
"""

import math
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from lemtomap.robot.motion.proximity import free_travel_m
from lemtomap.settings import check_ranges, within

CLOCK_SLACK_S = (
    0.05  # a stamp this far in the future is thread jitter; more is a broken clock, so no evidence
)


class Reason(StrEnum):
    """Why the velocity is what it is."""

    CLEAR = "clear"
    BAD_COMMAND = "bad command"
    NOT_PERMITTED = "not permitted"
    BASE_TIMEOUT = "base timeout"
    WHEEL_DROP = "wheel drop"
    OVER_CURRENT = "over-current"
    SETTLING = "settling"
    ADAPTER = "charging cable plugged in"
    BATTERY_EMPTY = "battery empty"
    MAPPING_HANGS = "mapping hangs"
    NAVIGATION_HANGS = "navigation hangs"
    COMMAND_TIMEOUT = "command timeout"
    SCAN_TIMEOUT = "scan timeout"
    SCAN_BLIND = "scan blind"
    CLIFF = "cliff"
    BUMPER = "bumper"
    NEAR_OBSTACLE = "near obstacle"
    LIMIT = "limit"


@dataclass(frozen=True, slots=True)
class SafetyLimits:
    """Limits of the gate, each with its default, the bounds that nothing leaves, and why.

    Kobuki: reference, sections 8, 10, 12 and 14. Raises BadSetting.
    """

    v_max_mps: float = within(0.65, 0.05, 0.65, "a Kobuki does 0.70 and its wheel controller overshoots")
    reverse_max_mps: float = within(0.20, 0.02, 0.20, "the laser sees nothing behind")
    w_max_radps: float = within(1.9, 0.1, 1.92, "the gyro degrades above 110 deg/s")
    back_off_mps: float = within(0.10, 0.02, 0.15, "nothing is seen behind")
    """The official safety controller's retreat."""
    bumped_w_max_radps: float = within(0.50, 0.05, 1.0, "it turns while it touches something")
    velocity_age_s: float = within(0.3, 0.1, 0.5, "navigation speaks every 0.1 s")
    base_age_s: float = within(0.2, 0.04, 0.5, "a packet comes every 0.02 s")
    scan_age_s: float = within(0.5, 0.15, 0.8, "a scan comes every 0.1 s")
    map_age_s: float = within(0.25, 0.15, 0.5, "a scan comes every 0.1 s")
    """Mapping takes some tens of milliseconds; a robot whose mapping hangs stands within 0.3 s."""
    cycle_age_s: float = within(0.25, 0.15, 0.5, "navigation begins a cycle every 0.1 s")
    settle_s: float = within(0.5, 0.2, 10.0, "wheels and people come to rest")
    battery_empty_v: float = within(13.2, 13.0, 15.0, "the pack switches itself off soon below")
    """The official driver's "dangerous"."""
    battery_hold_s: float = within(5.0, 0.5, 30.0, "the voltage sags while the motors start, not for longer")
    scan_valid_beams: int = within(10, 5, 300, "a covered laser sees no obstacle either")
    body_radius_m: float = within(0.18, 0.178, 0.5, "a Kobuki with its bumper is 0.178 m round")
    side_margin_m: float = within(0.01, 0.005, 0.2, "a range is right to a centimetre")
    """Navigation keeps 0.015: the gate must not hold what navigation steers past."""
    stop_gap_m: float = within(0.025, 0.01, 0.5, "wheels stop a little late")
    creep_share: float = within(0.05, 0.01, 0.2, "only a robot that almost stands turns unharmed")
    brake_mps2: float = within(0.8, 0.1, 1.2, "wheels slip above, doors are too narrow below")
    """Gentle enough for a laptop on top."""
    reaction_s: float = within(0.12, 0.1, 1.0, "a scan period passes before anything is seen")
    """One scan period and one output period."""
    own_parts_m: float = within(0.15, 0.0, 0.17, "what lies outside the body is no part of it")
    """Nearer points are the robot's own posts and cables."""

    def __post_init__(self) -> None:
        check_ranges(self)


@dataclass(frozen=True, slots=True)
class Sides:
    """One flag for each of the three sensors of a ring."""

    left: bool = False
    centre: bool = False
    right: bool = False

    def __or__(self, other: "Sides") -> "Sides":
        return Sides(self.left or other.left, self.centre or other.centre, self.right or other.right)

    @property
    def any(self) -> bool:
        """Return True if one of them is set."""
        return self.left or self.centre or self.right


@dataclass(frozen=True, slots=True)
class Evidence:
    """What the gate judges by. Stamps: monotonic host time of arrival; -inf = never."""

    velocity_stamp_s: float = -math.inf
    base_stamp_s: float = -math.inf
    map_stamp_s: float = -math.inf
    """All scans until then are in the map, or known to be of no use to it."""
    cycle_stamp_s: float = -math.inf
    """When navigation began its latest cycle."""
    scan_stamp_s: float = -math.inf
    bumper: Sides = field(default_factory=Sides)
    cliff: Sides = field(default_factory=Sides)
    wheel_drop: bool = False
    over_current: bool = False
    adapter: bool = False
    battery_v: float = 16.0
    points_base: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 2)))
    """float64 (N, 2), metres, base frame: the returns of the last scan."""
    valid_beams: int = 0
    """Beams of the last scan that returned something or surely nothing."""


@dataclass(frozen=True, slots=True)
class Allowed:
    """What may be sent to the wheels, and why it is not more."""

    v_mps: float
    w_radps: float
    reason: Reason


class SafetyGate:
    """Judge each velocity just before it is sent."""

    def __init__(self, limits: SafetyLimits | None = None) -> None:
        self.limits = limits or SafetyLimits()
        self._permitted = False
        self._settle_until_s = -math.inf
        self._battery_low_since_s: float | None = None

    def permit(self) -> None:
        """Let the robot move from now on."""
        self._permitted = True

    def revoke(self) -> None:
        """Take the permission back: every velocity is zero from now on."""
        self._permitted = False

    def check(self, v_mps: float, w_radps: float, evidence: Evidence, now_s: float) -> Allowed:
        """Return what may be sent now. Holds: never faster than wanted, never another direction."""
        stop = (
            self._fault(evidence, now_s)
            or self._hung(evidence, now_s)
            or self._silence(v_mps, w_radps, evidence, now_s)
        )
        if not (math.isfinite(v_mps) and math.isfinite(w_radps)):
            stop = Reason.BAD_COMMAND
        if stop is not None:
            return Allowed(0.0, 0.0, stop)
        allowed = self._limit(v_mps, w_radps)
        allowed = self._contact(allowed, evidence)
        return self._approach(allowed, evidence, now_s)

    def _fault(self, evidence: Evidence, now_s: float) -> Reason | None:
        lim = self.limits
        serious = None
        if not _fresh(evidence.base_stamp_s, now_s, lim.base_age_s):
            serious = Reason.BASE_TIMEOUT
        elif evidence.wheel_drop:
            serious = Reason.WHEEL_DROP
        elif evidence.over_current:
            serious = Reason.OVER_CURRENT
        if serious is not None:
            self._settle_until_s = now_s + lim.settle_s
        elif now_s < self._settle_until_s:
            serious = Reason.SETTLING
        if not self._permitted:
            return Reason.NOT_PERMITTED
        return serious or self._power(evidence, now_s)

    def _power(self, evidence: Evidence, now_s: float) -> Reason | None:
        if evidence.battery_v >= self.limits.battery_empty_v:
            self._battery_low_since_s = None
        elif self._battery_low_since_s is None:
            self._battery_low_since_s = now_s
        if evidence.adapter:
            return Reason.ADAPTER
        since_s = self._battery_low_since_s
        if since_s is not None and now_s - since_s >= self.limits.battery_hold_s:
            return Reason.BATTERY_EMPTY
        return None

    def _hung(self, evidence: Evidence, now_s: float) -> Reason | None:
        """Judge the robot's own threads, also while it stands: else it would stand for ever, unexplained."""
        if not _fresh(evidence.map_stamp_s, now_s, self.limits.map_age_s):
            return Reason.MAPPING_HANGS
        if not _fresh(evidence.cycle_stamp_s, now_s, self.limits.cycle_age_s):
            return Reason.NAVIGATION_HANGS
        return None

    def _silence(self, v_mps: float, w_radps: float, evidence: Evidence, now_s: float) -> Reason | None:
        lim = self.limits
        if not _fresh(evidence.velocity_stamp_s, now_s, lim.velocity_age_s):
            return Reason.COMMAND_TIMEOUT
        if v_mps == 0.0 and w_radps == 0.0:
            return None
        if not _fresh(evidence.scan_stamp_s, now_s, lim.scan_age_s):
            return Reason.SCAN_TIMEOUT
        if evidence.valid_beams < lim.scan_valid_beams:
            return Reason.SCAN_BLIND
        return None

    def _limit(self, v_mps: float, w_radps: float) -> Allowed:
        lim = self.limits
        v = min(max(v_mps, -lim.reverse_max_mps), lim.v_max_mps)
        w = min(max(w_radps, -lim.w_max_radps), lim.w_max_radps)
        return _lessened(Allowed(v_mps, w_radps, Reason.CLEAR), v, w, Reason.LIMIT)

    def _contact(self, allowed: Allowed, evidence: Evidence) -> Allowed:
        lim = self.limits
        if not (evidence.cliff.any or evidence.bumper.any):
            return allowed
        reason = Reason.CLIFF if evidence.cliff.any else Reason.BUMPER
        if allowed.v_mps > 0.0:
            return Allowed(0.0, 0.0, reason)
        v = max(allowed.v_mps, -lim.back_off_mps)
        if evidence.cliff.any:
            return _lessened(allowed, v, 0.0, Reason.CLIFF)
        w = min(max(allowed.w_radps, -lim.bumped_w_max_radps), lim.bumped_w_max_radps)
        return _lessened(allowed, v, w, Reason.BUMPER)

    def _approach(self, allowed: Allowed, evidence: Evidence, now_s: float) -> Allowed:
        """Scale v and w together, so that the robot slows on its path; at a creep it may turn away."""
        lim = self.limits
        points = evidence.points_base
        points = points[np.hypot(points[:, 0], points[:, 1]) > lim.own_parts_m]
        radius_m = lim.body_radius_m + lim.side_margin_m
        free_m = free_travel_m(points, allowed.v_mps, allowed.w_radps, radius_m) - lim.stop_gap_m
        if free_m == math.inf:
            return allowed
        delay_s = lim.reaction_s + max(0.0, now_s - evidence.scan_stamp_s)
        safe_mps = _stoppable_mps(max(0.0, free_m), delay_s, lim.brake_mps2)
        share = min(1.0, safe_mps / abs(allowed.v_mps))
        turn = share if share > lim.creep_share else 1.0  # a round body that almost stands turns unharmed
        return _lessened(allowed, share * allowed.v_mps, turn * allowed.w_radps, Reason.NEAR_OBSTACLE)


def _fresh(stamp_s: float, now_s: float, age_max_s: float) -> bool:
    return -CLOCK_SLACK_S <= now_s - stamp_s <= age_max_s


def _stoppable_mps(free_m: float, delay_s: float, brake_mps2: float) -> float:
    """Return the speed from which delay and braking take exactly `free_m`: v t + v^2 / 2a = d."""
    return 2.0 * free_m / (delay_s + math.sqrt(delay_s * delay_s + 2.0 * free_m / brake_mps2))


def _lessened(allowed: Allowed, v_mps: float, w_radps: float, reason: Reason) -> Allowed:
    """Return the lesser velocity; its reason only when it took something away."""
    if v_mps == allowed.v_mps and w_radps == allowed.w_radps:
        return allowed
    return Allowed(v_mps, w_radps, reason)
