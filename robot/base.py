"""The 50 Hz part of the robot: samples in, velocity out. It never waits for mapping or navigation.

feedback packets -> odometry -> odometry buffer -> scans with their motion -> mapping, navigation, safety
wishes -> mux -> smoother -> safety gate -> wheels;  condition -> LEDs and sounds
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lemtomap.deskew import motion_during
from lemtomap.drivers.hokuyo.events import LaserScan
from lemtomap.drivers.hokuyo.session import HokuyoEvent
from lemtomap.drivers.kobuki.battery import ChargeLevel
from lemtomap.drivers.kobuki.events import (
    BumperEvent,
    CliffEvent,
    KobukiSample,
    LinkUp,
)
from lemtomap.drivers.kobuki.session import KobukiEvent
from lemtomap.nav.types import ContactKind, NavState, ObstacleSighting
from lemtomap.odometry import OdometryBuffer, WheelGyroOdometry
from lemtomap.robot.config import RobotConfig
from lemtomap.robot.devices import bridge
from lemtomap.robot.devices.device_log import describe_event
from lemtomap.robot.devices.indicators import Condition, Indicators, Signal
from lemtomap.robot.devices.recording import HOKUYO, KOBUKI
from lemtomap.robot.exchange import (
    BaseStatus,
    Exchange,
    NoteLevel,
    TimedScan,
)
from lemtomap.robot.motion.docking import Docking
from lemtomap.robot.motion.retreat import Retreat
from lemtomap.robot.motion.safety import (
    Allowed,
    Evidence,
    Reason,
    SafetyGate,
    Sides,
)
from lemtomap.robot.motion.velocity import (
    DOCKING,
    NAVIGATION,
    SAFETY,
    TELEOP,
    VelocityMux,
    VelocitySmoother,
    Wish,
)
from lemtomap.robot.motion.watchdog import Watchdog
from lemtomap.types import Odometry, Scan, Twist

SCAN_PATIENCE_S = 0.3  # a scan whose odometry has not come by then belongs to a silent base


@dataclass(frozen=True, slots=True)
class Commands:
    """What the base is told in this step."""

    drive: Allowed
    signals: tuple[Signal, ...] = ()


class BaseStep:
    """Owner of odometry, velocity and safety. Called from one thread."""

    def __init__(self, config: RobotConfig, exchange: Exchange) -> None:
        self.gate = SafetyGate(config.safety)
        self._exchange = exchange
        self._laser = config.laser
        self._odometry = WheelGyroOdometry(config.odometry)
        self._buffer = OdometryBuffer()
        self._mux, self._smoother = VelocityMux(), VelocitySmoother(config.smoother)
        self._retreat, self._indicators = Retreat(config.retreat), Indicators()
        self._watchdog = Watchdog(exchange)
        self._docking_config = config.docking
        self._docking: Docking | None = None
        self._sample: KobukiSample | None = None
        self._last: Odometry | None = None
        self._scan: TimedScan | None = None
        self._waiting: deque[LaserScan] = deque(maxlen=4)
        self.heard: set[str] = set()
        """Devices whose measurements have come: "kobuki", "hokuyo"."""
        self._bumped = self._fell = Sides()
        self._nav_version = 0
        self._commanded_s = -math.inf
        self._reason = Reason.NOT_PERMITTED

    # ---- in ----

    def take(self, base: Sequence[KobukiEvent], laser: Sequence[HokuyoEvent], now_s: float) -> None:
        """Take what the devices told since the last call."""
        hangs = any(isinstance(event, KobukiSample) and event.wheel_drop for event in base)
        for event in base:
            if isinstance(event, KobukiSample):
                self._take_sample(event)
            else:
                self._take_event(event, now_s, lifted=hangs or self._hangs)
        for seen in laser:
            if isinstance(seen, LaserScan):
                self.heard.add(HOKUYO)
                self._waiting.append(seen)
            else:
                self._tell(seen, now_s)
        self._match_scans(now_s)

    def lost(self, device: str) -> None:
        """Take note that a device's port went away: it is silent from now on, not only after its time-out."""
        if device == KOBUKI:
            self._sample = None
        else:
            self._scan = None
            self._waiting.clear()

    def teleop(self, twist: Twist, now_s: float) -> None:
        """Take a person's wish; repeat it at least twice a second."""
        self._mux.offer(TELEOP, twist, now_s)

    def _take_sample(self, sample: KobukiSample) -> None:
        self.heard.add(KOBUKI)
        self._sample = sample
        self._last = self._odometry.update(
            sample.stamp_s, sample.left_ticks, sample.right_ticks, sample.gyro_yaw_rad, sample.gyro_rate_radps
        )
        self._buffer.add(self._last)
        self._exchange.odometry.put(self._last)
        self._dock(sample)

    def _dock(self, sample: KobukiSample) -> None:
        """Drive onto the charging dock while somebody wants it; each wish is a new attempt."""
        if not self._exchange.dock.get():
            self._docking = None
            self._mux.withdraw(DOCKING)
            return
        self._docking = self._docking or Docking(self._docking_config)
        output = self._docking.step(sample)
        self._exchange.docking.put(output)
        if output.finished:
            self._mux.withdraw(DOCKING)
        else:
            self._mux.offer(DOCKING, Twist(output.v_mps, output.w_radps), sample.arrival_s)

    @property
    def _hangs(self) -> bool:
        return self._sample is not None and bool(self._sample.wheel_drop)

    def _take_event(self, event: KobukiEvent, now_s: float, *, lifted: bool) -> None:
        contact = bridge.contact_of(event)
        if contact is not None and not (lifted and contact.kind is ContactKind.CLIFF):  # no floor in the air
            self._exchange.contacts.put(contact)
            self._retreat.contact(self._smoother.sent.v_mps, now_s)
        if isinstance(event, BumperEvent) and event.pressed:
            self._bumped = bridge.sides_of_bumper(event.side) | self._bumped
        elif isinstance(event, CliffEvent) and event.seen:
            self._fell = bridge.sides_of_cliff(event.side) | self._fell
        elif isinstance(event, LinkUp):
            self._indicators.refresh()
        self._tell(event, now_s)

    def _tell(self, event: object, now_s: float) -> None:
        note = describe_event(event, now_s)
        if note is not None:
            self._exchange.notes.put(note)

    def _match_scans(self, now_s: float) -> None:
        """Give each scan its motion as soon as odometry covers its last beam."""
        T_base_laser = self._laser.T_base_laser
        while self._waiting:
            scan = bridge.scan_of(self._waiting[0], T_base_laser, upside_down=self._laser.is_upside_down)
            stamps_s = scan.stamp_s + scan.time_step_s * np.arange(len(scan.ranges_m))
            if self._last is None or self._last.stamp_s < stamps_s[-1]:
                if now_s - self._waiting[0].arrival_s <= SCAN_PATIENCE_S:
                    return
                self._waiting.popleft()
                continue
            seen = self._waiting.popleft()
            if self._buffer.covers(scan.stamp_s):
                self._hand_on(seen, scan, self._buffer.odometry_during(stamps_s))

    def _hand_on(self, seen: LaserScan, scan: Scan, odometry: Odometry) -> None:
        motion = motion_during(scan, odometry)
        sighting = ObstacleSighting.from_scan(scan, odometry.T_odom_base, T_base_beams=motion)
        valid = int(np.count_nonzero(~np.isnan(scan.ranges_m)))
        timed = TimedScan(scan, odometry, sighting, seen.arrival_s, valid, self._hangs)
        self._scan = timed
        if seen.complete:  # a damaged scan still shows obstacles, but never reaches the map
            self._exchange.scans.put(timed)
            self._watchdog.saw(scan.stamp_s, seen.arrival_s)
        self._exchange.sightings.put(sighting)
        self._exchange.last_scan.put(timed)

    # ---- out ----

    def command(self, now_s: float) -> Commands:
        """Return what to send to the base now; call it every 20 ms."""
        self._offer_wishes(now_s)
        wish = self._mux.select(now_s)
        wanted = wish.twist if wish is not None else Twist()
        smooth = self._smoother.step(wanted, self._elapsed_s(now_s))
        stamp_s = wish.stamp_s if wish is not None else -math.inf
        sent = self.gate.check(smooth.v_mps, smooth.w_radps, self._evidence(stamp_s, now_s), now_s)
        self._smoother.note_sent(sent.v_mps, sent.w_radps)
        self._bumped = self._fell = Sides()
        self._note_reason(sent.reason, now_s)
        self._exchange.base_status.put(self._status(wish, sent, now_s))
        return Commands(sent, tuple(self._indicators.update(self._condition(sent.reason), now_s)))

    def _offer_wishes(self, now_s: float) -> None:
        version, output = self._exchange.nav_output.version, self._exchange.nav_output.get()
        if output is not None and version != self._nav_version:
            self._nav_version = version
            self._mux.offer(NAVIGATION, output.twist, output.stamp_s)
        retreat = self._retreat.wish(now_s)
        if retreat is not None:
            self._mux.offer(SAFETY, retreat, now_s)
        else:
            self._mux.withdraw(SAFETY)

    def _elapsed_s(self, now_s: float) -> float:
        elapsed_s = min(max(now_s - self._commanded_s, 0.0), 0.1)
        self._commanded_s = now_s
        return elapsed_s

    def _evidence(self, velocity_stamp_s: float, now_s: float) -> Evidence:
        sample, scan, last = self._sample, self._scan, self._last
        map_stamp_s = self._watchdog.map_stamp_s(now_s)
        cycle_stamp_s = self._watchdog.cycle_stamp_s(now_s)
        if sample is None or last is None:
            return Evidence(velocity_stamp_s, map_stamp_s=map_stamp_s, cycle_stamp_s=cycle_stamp_s)
        points = np.zeros((0, 2)) if scan is None else bridge.points_now(scan.sighting, last)
        return Evidence(
            velocity_stamp_s=velocity_stamp_s,
            map_stamp_s=map_stamp_s,
            cycle_stamp_s=cycle_stamp_s,
            base_stamp_s=sample.arrival_s,
            bumper=bridge.sides_of_bumper(sample.bumper) | self._bumped,
            cliff=bridge.sides_of_cliff(sample.cliff) | self._fell,
            wheel_drop=bool(sample.wheel_drop),
            over_current=bool(sample.over_current),
            adapter=bridge.on_adapter(sample),
            battery_v=sample.battery.voltage_v,
            scan_stamp_s=-math.inf if scan is None else scan.arrival_s,
            points_base=points,
            valid_beams=0 if scan is None else scan.valid_beams,
        )

    def _condition(self, reason: Reason) -> Condition:
        output, view = self._exchange.nav_output.get(), self._exchange.map_view.get()
        state = output.state if output is not None else NavState.IDLE
        low = self._sample is not None and self._sample.battery.level in {
            ChargeLevel.LOW,
            ChargeLevel.CRITICAL,
        }
        return Condition(reason, state, view is not None and view.lost, low)

    def _note_reason(self, reason: Reason, now_s: float) -> None:
        """Log each change of the gate's reason that is worth a line."""
        if reason is self._reason:
            return
        quiet = {Reason.CLEAR, Reason.LIMIT, Reason.NEAR_OBSTACLE, Reason.COMMAND_TIMEOUT}
        if reason not in quiet:
            self._exchange.note(now_s, "safety", f"stopped: {reason}", NoteLevel.WARN)
        elif self._reason not in quiet:
            over = self._reason
            text = "permission to move given" if over is Reason.NOT_PERMITTED else f"cleared: {over}"
            self._exchange.note(now_s, "safety", text)
        self._reason = reason

    def _status(self, wish: Wish | None, sent: Allowed, now_s: float) -> BaseStatus:
        sample = self._sample
        if sample is None:
            return BaseStatus(now_s, wish=wish, sent=sent)
        return BaseStatus(
            stamp_s=now_s,
            odometry=self._last,
            wish=wish,
            sent=sent,
            battery_v=sample.battery.voltage_v,
            battery_percent=sample.battery.percent,
            bumped=bool(sample.bumper),
            charging=sample.battery.charging,
        )
