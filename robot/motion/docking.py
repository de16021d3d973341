"""Driving onto the charging dock by its infra-red sectors, as a state machine: packets in, velocities out.

The official dock drive turns until a receiver sees something and trusts that heading; it gets stuck beside
the dock and takes its own word for being docked. Here the bearing of the dock is the middle of the arc over
which the centre receiver sees it, the middle of the field is found by driving right across it, every state
has a limit in time or distance, and only the charger says that the robot is docked.

    SCAN ── centre ──► TURN ──► APPROACH ──► CONFIRM ──► docked
      │                             │ lost, bumped, too far
      └─ left, right ► TURN ──► CROSS ──► HALF_BACK ─┐  RETREAT
         of the field                    back to SCAN ◄──┘ (so many attempts)
"""

import math
from collections import deque
from dataclasses import dataclass
from enum import StrEnum

from lemtomap.drivers.kobuki.battery import PowerSource
from lemtomap.drivers.kobuki.events import KobukiSample
from lemtomap.drivers.kobuki.packets import TICKS_PER_METRE, DockSector

_CENTER = DockSector.NEAR_CENTER | DockSector.FAR_CENTER
_LEFT = DockSector.NEAR_LEFT | DockSector.FAR_LEFT
_RIGHT = DockSector.NEAR_RIGHT | DockSector.FAR_RIGHT
_NEAR = DockSector.NEAR_LEFT | DockSector.NEAR_CENTER | DockSector.NEAR_RIGHT


@dataclass(frozen=True, slots=True)
class DockingConfig:
    """Speeds and limits."""

    scan_radps: float = 0.5  # kobuki_core: 0.66; slower sees the edges of the arc sharper
    gap_rad: float = 0.15
    """The dock's beams flash: out of sight is what stays so over this angle."""
    turn_radps: float = 0.6
    turn_done_rad: float = 0.02
    cross_mps: float = 0.1
    cross_angle_rad: float = math.radians(70)
    """Off the dock's bearing: a side receiver, about 60 degrees off, keeps the dock in sight."""
    far_mps: float = 0.1  # kobuki_core
    near_mps: float = 0.05  # kobuki_core
    steer_rad: float = math.radians(14)
    """Into the middle of the field when the approach has left it."""
    retreat_mps: float = -0.05  # kobuki_core
    retreat_m: float = 0.3
    smooth_packets: int = 10  # the dock's beams flash; kobuki_core joins 20 packets
    lost_s: float = 2.0
    """Without any sight of the dock for this long the approach has failed."""
    confirm_s: float = 1.0  # the charger must say so for this long
    longest_cross_m: float = 2.5  # the field is 2 m wide
    longest_approach_m: float = 5.5  # and 5 m deep
    attempts: int = 4
    limit_s: float = 180.0
    """For everything together."""


class DockingState(StrEnum):
    """What it is doing."""

    SCAN = "looking for the dock"
    TURN = "turning"
    CROSS = "crossing the dock's field"
    HALF_BACK = "going back to its middle"
    APPROACH = "driving to the dock"
    CONFIRM = "waiting for the charger"
    RETREAT = "backing off for another attempt"
    DOCKED = "docked and charging"
    FAILED = "gave up"


@dataclass(frozen=True, slots=True)
class DockingOutput:
    """What to drive now, and how it stands."""

    v_mps: float
    w_radps: float
    state: DockingState
    reason: str = ""
    """Why it failed."""

    @property
    def finished(self) -> bool:
        """Return True if it is over, one way or the other."""
        return self.state in {DockingState.DOCKED, DockingState.FAILED}


class Docking:
    """One docking run. Feed it each packet; drive what it says; stop when it is finished."""

    def __init__(self, config: DockingConfig | None = None) -> None:
        self.config = config or DockingConfig()
        self.state = DockingState.SCAN
        self.reason = ""
        self._begin_s: float | None = None
        self._attempt = 1
        self._yaw_rad = 0.0  # since the start, without wraps
        self._travel_m = 0.0
        self._last: KobukiSample | None = None
        self._recent: deque[tuple[int, int, int]] = deque(maxlen=self.config.smooth_packets)
        self._goal_rad = 0.0
        self._after_turn = DockingState.APPROACH
        self._axis_rad = 0.0
        self._seen_s = 0.0
        self._confirm_since_s: float | None = None
        self._from_rad = self._from_m = 0.0  # where the present state began
        self._arc: tuple[float, float] | None = None  # first and last heading with the dock in sight
        self._was_dark = False
        self._sectors = 0
        self._center_from_m: float | None = None
        self._half_m = 0.0

    def step(self, sample: KobukiSample) -> DockingOutput:
        """Take a packet, return what to drive until the next. Time is the packet's stamp."""
        self._follow_motion(sample)
        now_s = sample.stamp_s
        if self._begin_s is None:
            self._begin_s = self._seen_s = now_s
        ir = sample.docking_ir
        self._recent.append((ir.right, ir.center, ir.left))
        if self.state in {DockingState.DOCKED, DockingState.FAILED}:
            return self._output(0.0, 0.0)
        if sample.battery.source is PowerSource.ADAPTER:
            return self._fail("the charging cable is plugged in")
        if now_s - self._begin_s > self.config.limit_s:
            return self._fail(f"not docked after {self.config.limit_s:.0f} s")
        if self._on_dock(sample):
            return self._confirm(now_s)
        if self.state is DockingState.CONFIRM:  # slipped off the contacts
            self._enter(DockingState.APPROACH)
        return self._drive(sample, now_s)

    def _drive(self, sample: KobukiSample, now_s: float) -> DockingOutput:
        match self.state:
            case DockingState.SCAN:
                return self._scan(sample)
            case DockingState.TURN:
                return self._turn()
            case DockingState.CROSS:
                return self._cross(sample)
            case DockingState.HALF_BACK:
                return self._half_back()
            case DockingState.APPROACH:
                return self._approach(sample, now_s)
            case _:
                return self._retreat()

    # ---- states ----

    def _scan(self, sample: KobukiSample) -> DockingOutput:
        """Turn until the dock has come into sight and gone out of it again; its bearing is the middle."""
        sight = sample.docking_ir.center
        turned_rad = self._yaw_rad - self._from_rad
        if not sight:
            self._was_dark = True
            if self._arc is not None and self._yaw_rad - self._arc[1] > self.config.gap_rad:
                return self._choose(0.5 * (self._arc[0] + self._arc[1]))
        elif self._was_dark:  # what is in sight from the start on has no beginning: wait until it comes round
            self._arc = (self._arc[0] if self._arc is not None else self._yaw_rad, self._yaw_rad)
            self._sectors |= sight
        if turned_rad > 4.5 * math.pi:
            return self._try_again("no dock in sight all around")
        return self._output(0.0, self.config.scan_radps)

    def _choose(self, bearing_rad: float) -> DockingOutput:
        """Go for the dock from the middle of its field, else go to the middle first."""
        self._axis_rad = bearing_rad
        if self._sectors & _CENTER:
            return self._turn_to(bearing_rad, DockingState.APPROACH)
        side = 1.0 if self._sectors & _LEFT else -1.0
        return self._turn_to(bearing_rad + side * self.config.cross_angle_rad, DockingState.CROSS)

    def _turn_to(self, goal_rad: float, then: DockingState) -> DockingOutput:
        self._goal_rad = self._yaw_rad + math.remainder(goal_rad - self._yaw_rad, 2.0 * math.pi)
        self._after_turn = then
        self._enter(DockingState.TURN)
        return self._turn()

    def _turn(self) -> DockingOutput:
        error_rad = self._goal_rad - self._yaw_rad
        if abs(error_rad) < self.config.turn_done_rad:
            self._enter(self._after_turn)
            return self._output(0.0, 0.0)
        return self._output(0.0, self._steer(error_rad))

    def _cross(self, sample: KobukiSample) -> DockingOutput:
        """Drive across until the middle sector has been entered and left."""
        seen = 0
        for receivers in self._recent:
            seen |= receivers[0] | receivers[1] | receivers[2]
        driven_m = self._travel_m - self._from_m
        if seen & _CENTER and self._center_from_m is None:
            self._center_from_m = self._travel_m
        beyond = _RIGHT if self._goal_rad > self._axis_rad else _LEFT
        if self._center_from_m is not None and (not seen & _CENTER or seen & beyond):
            self._half_m = 0.5 * (self._travel_m - self._center_from_m)
            self._enter(DockingState.HALF_BACK)
            return self._output(0.0, 0.0)
        if sample.bumper or driven_m > self.config.longest_cross_m:
            return self._try_again("the way across the dock's field is blocked or too long")
        return self._output(self.config.cross_mps, self._steer(self._goal_rad - self._yaw_rad))

    def _half_back(self) -> DockingOutput:
        if self._from_m - self._travel_m >= self._half_m:
            self._enter(DockingState.SCAN)
            return self._output(0.0, 0.0)
        return self._output(-self.config.cross_mps, self._steer(self._goal_rad - self._yaw_rad))

    def _approach(self, sample: KobukiSample, now_s: float) -> DockingOutput:
        """Hold the dock's bearing; lean to the middle while outside of it."""
        center = 0
        for _, receiver, _ in self._recent:
            center |= receiver
        if center:
            self._seen_s = now_s
        if sample.bumper:
            return self._try_again("bumped into something that does not charge")
        if now_s - self._seen_s > self.config.lost_s:
            return self._try_again("lost sight of the dock")
        if self._travel_m - self._from_m > self.config.longest_approach_m:
            return self._try_again("drove further than the dock can be")
        lean = 0.0
        if not center & _CENTER:
            lean = self.config.steer_rad * (bool(center & _LEFT) - bool(center & _RIGHT))
        speed = self.config.near_mps if center & _NEAR or not center else self.config.far_mps
        return self._output(speed, self._steer(self._axis_rad + lean - self._yaw_rad))

    def _retreat(self) -> DockingOutput:
        if self._from_m - self._travel_m >= self.config.retreat_m:
            self._enter(DockingState.SCAN)
            return self._output(0.0, 0.0)
        return self._output(self.config.retreat_mps, 0.0)

    def _confirm(self, now_s: float) -> DockingOutput:
        """Stand still until the charger has said so for long enough."""
        if self._confirm_since_s is None:
            self._confirm_since_s = now_s
            self._enter(DockingState.CONFIRM)
        if now_s - self._confirm_since_s >= self.config.confirm_s:
            self.state = DockingState.DOCKED
        return self._output(0.0, 0.0)

    def _on_dock(self, sample: KobukiSample) -> bool:
        """Return True if the charger's byte, not the debounced battery, names the dock now."""
        if sample.on_dock:
            return True
        self._confirm_since_s = None
        return False

    def _enter(self, state: DockingState) -> None:
        self.state = state
        self._from_rad, self._from_m = self._yaw_rad, self._travel_m
        if state is DockingState.SCAN:
            self._arc, self._was_dark, self._sectors = None, False, 0
        elif state is DockingState.CROSS:
            self._center_from_m = None

    def _try_again(self, reason: str) -> DockingOutput:
        self._attempt += 1
        if self._attempt > self.config.attempts:
            return self._fail(f"{reason} ({self.config.attempts} attempts)")
        self._enter(DockingState.RETREAT)
        return self._output(0.0, 0.0)

    def _fail(self, reason: str) -> DockingOutput:
        self.state, self.reason = DockingState.FAILED, reason
        return self._output(0.0, 0.0)

    def _steer(self, error_rad: float) -> float:
        return max(-self.config.turn_radps, min(self.config.turn_radps, 2.0 * error_rad))

    def _output(self, v_mps: float, w_radps: float) -> DockingOutput:
        return DockingOutput(v_mps, w_radps, self.state, self.reason)

    def _follow_motion(self, sample: KobukiSample) -> None:
        if self._last is not None:
            self._yaw_rad += math.remainder(sample.gyro_yaw_rad - self._last.gyro_yaw_rad, 2.0 * math.pi)
            for now, before in (
                (sample.left_ticks, self._last.left_ticks),
                (sample.right_ticks, self._last.right_ticks),
            ):
                self._travel_m += 0.5 * ((now - before + 0x8000) % 0x10000 - 0x8000) / TICKS_PER_METRE
        self._last = sample
