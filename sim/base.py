"""The whole base: body, gyro, battery and firmware; one feedback packet every 20 ms of its own clock."""

import math
from dataclasses import dataclass, field

import numpy as np

from lemtomap.sim import dock
from lemtomap.sim.body import (
    CLIFF_DROP_M,
    MAX_WHEEL_MPS,
    Body,
    BodyState,
    SimulatedBody,
)
from lemtomap.sim.gyro import Gyro, GyroConfig
from lemtomap.sim.kobuki import BaseReadings, FakeKobukiConfig, KobukiFirmware
from lemtomap.sim.scene import Scene, Touch
from lemtomap.sim.world import World

PERIOD_S = 0.020
TICKS_PER_M = 11724.41658029856624751591  # section 6
BIT_RATE = 115_200.0
BUMPER_EDGE_RAD = math.radians(30)  # centre +-30 degrees, sides to +-90 (section 14)
BUMPER_OVERLAP_RAD = math.radians(5)  # near an edge two switches close
LEFT, CENTRE, RIGHT = 0x04, 0x02, 0x01
CLIFF_BITS = (RIGHT, CENTRE, LEFT)
CLIFF_SENSOR_HEIGHT_M = 0.03


@dataclass(frozen=True, slots=True)
class SimulatedBattery:
    """A 4S1P pack (section 10)."""

    full_v: float = 16.5
    empty_v: float = 13.2
    runtime_s: float = 3.0 * 3600.0
    charge_s: float = 1.5 * 3600.0
    start_share: float = 1.0


@dataclass(frozen=True, slots=True)
class BaseConfig:
    """Everything about the base."""

    body: SimulatedBody = field(default_factory=SimulatedBody)
    gyro: GyroConfig = field(default_factory=GyroConfig)
    firmware: FakeKobukiConfig = field(default_factory=FakeKobukiConfig)
    battery: SimulatedBattery = field(default_factory=SimulatedBattery)


@dataclass(frozen=True, slots=True)
class Sent:
    """What the last packet said, when, and what was true then."""

    stamp_s: float
    readings: BaseReadings
    state: BodyState


class Base:
    """The base among the things of a scene."""

    def __init__(self, world: World, scene: Scene, config: BaseConfig, rng: np.random.Generator) -> None:
        body_rng, gyro_rng, offset_rng = rng.spawn(3)
        self._world = world
        self._scene = scene
        self._config = config
        self.body = Body(scene, world.spawn, config.body, body_rng, flat=world.flat)
        self.gyro = Gyro(config.gyro, gyro_rng)
        self.firmware = KobukiFirmware(config.firmware)
        self.last: Sent | None = None
        self.buttons = 0
        """Touch keys held down now: 1, 2, 4."""
        self.lifted = False
        """Someone holds the robot up: both wheels hang."""
        self._start_ticks = [int(value) for value in offset_rng.integers(0, 65536, 2)]
        self._charge = config.battery.start_share
        self._packets = 0
        self._period_s = PERIOD_S / (1.0 + config.firmware.clock_ppm * 1e-6)
        self._phase_s = float(offset_rng.uniform(0.001, PERIOD_S))

    def step(self, now_s: float, dt_s: float) -> bytes:
        """Move on to now_s; return the packet that fell due on the way, with `packet_s` telling when."""
        before = self.body.state
        self.body.step(now_s, dt_s, self.firmware.wheel_targets_mps(now_s))
        self.gyro.tick(before, self.body.state, dt_s)
        due = self.packet_s
        if due > now_s:
            return b""
        state = before.towards(self.body.state, 1.0 - (now_s - due) / dt_s)
        readings = self._readings(state)
        self.last = Sent(due, readings, state)
        packet = self.firmware.packet(readings)
        self._packets += 1
        return packet

    @property
    def packet_s(self) -> float:
        """When the next packet falls due."""
        return self._phase_s + self._packets * self._period_s

    def _readings(self, state: BodyState) -> BaseReadings:
        self._live_on_battery()
        samples = self.gyro.sample(self._period_s)
        frame = self.gyro.frame
        self.gyro.frame = (frame + len(samples)) & 0xFF
        left_hangs, right_hangs = self.body.wheels_hang
        battery = self._config.battery
        volts = battery.empty_v + self._charge * (battery.full_v - battery.empty_v)
        return BaseReadings(
            timestamp_ms=self._config.firmware.power_on_ms + 20 * self._packets,
            left_ticks=self._start_ticks[0] + math.floor(state.left_m * TICKS_PER_M),
            right_ticks=self._start_ticks[1] + math.floor(state.right_m * TICKS_PER_M),
            angle_cdeg=self.gyro.heading_cdeg,
            rate_cdegps=round(self.gyro.rate_dps * 100.0),
            bumper=_bumper_bits(self.body.contacts),
            wheel_drop=(0x02 if left_hangs or self.lifted else 0)
            | (0x01 if right_hangs or self.lifted else 0),
            cliff=self._cliff_bits(),
            left_pwm=_pwm(state.left_mps),
            right_pwm=_pwm(state.right_mps),
            buttons=self.buttons,
            charger=self._charger(),
            battery_dv=round(volts * 10.0),
            dock_ir=self._dock_ir(),
            cliff_adc=self._cliff_adc(),
            current_10ma=(self._current(state.left_mps), self._current(state.right_mps)),
            gyro_frame=frame,
            gyro=samples,
        )

    def _live_on_battery(self) -> None:
        battery = self._config.battery
        if self._charger():
            self._charge = min(1.0, self._charge + self._period_s / battery.charge_s)
        else:
            self._charge = max(0.0, self._charge - self._period_s / battery.runtime_s)

    def _charger(self) -> int:
        """Return the charger byte: 0 driving, 6 docked and charging, 2 docked and full."""
        place = self._world.dock
        if place is None or not dock.docked(place, self.body.state.pose):
            return 0
        return 2 if self._charge >= 1.0 else 6

    def _dock_ir(self) -> tuple[int, int, int]:
        if self._world.dock is None:
            return 0, 0, 0
        return dock.dock_ir(self._world.dock, self.body.state.pose, self._scene)

    def _cliff_bits(self) -> int:
        if self.lifted:
            return LEFT | CENTRE | RIGHT
        drops = self.body.floor_drops
        return sum(bit for bit, drop in zip(CLIFF_BITS, drops, strict=True) if drop > CLIFF_DROP_M)

    def _cliff_adc(self) -> tuple[int, int, int]:
        drops = self.body.floor_drops if not self.lifted else (1.0, 1.0, 1.0)
        values = [_infrared_adc(CLIFF_SENSOR_HEIGHT_M + drop) for drop in drops]
        return values[0], values[1], values[2]

    def _current(self, wheel_mps: float) -> int:
        load = 3 if self.body.contacts else 0
        return min(255, round(4.0 * abs(wheel_mps) / MAX_WHEEL_MPS) + (load if wheel_mps else 0))


def _bumper_bits(contacts: list[Touch]) -> int:
    bits = 0
    for contact in contacts:
        angle = contact.bearing_rad
        if not contact.low or abs(angle) > math.pi / 2:
            continue
        if abs(angle) < BUMPER_EDGE_RAD + BUMPER_OVERLAP_RAD:
            bits |= CENTRE
        if angle > BUMPER_EDGE_RAD - BUMPER_OVERLAP_RAD:
            bits |= LEFT
        elif angle < -(BUMPER_EDGE_RAD - BUMPER_OVERLAP_RAD):
            bits |= RIGHT
    return bits


def _pwm(wheel_mps: float) -> int:
    return max(-127, min(127, round(wheel_mps / MAX_WHEEL_MPS * 100.0)))


def _infrared_adc(range_m: float) -> int:
    """Return the distance sensor's 12-bit value, as Gazebo's Kobuki does (section 3.4)."""
    return max(0, min(4095, int(76123 * math.atan2(0.995, max(range_m, 1e-3) * 1000.0))))
