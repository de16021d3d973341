"""Facts of the Kobuki's feedback: sub-payload ids, sizes, scales, and frozen samples in the robot's own
units.

Source of every number: kobuki_documentation `doc/protocol.rst` and the official driver kobuki_core 1.4.0;
where the two differ, the driver is what real robots agree with. All integers on the wire are little-endian.
"""

from dataclasses import dataclass
from enum import IntEnum, IntFlag

HEADER = b"\xaa\x55"
MAX_PAYLOAD = 255

TICKS_PER_METRE = 11724.41658029856624751591  # kobuki_core, diff_drive.hpp
WHEEL_BASE_M = 0.23  # kobuki_core, diff_drive.hpp
RAW_GYRO_DPS_PER_DIGIT = 0.00875  # L3G4200D at +-250 deg/s


class Bumper(IntFlag):
    """Pressed bumper segments."""

    RIGHT = 0x01
    CENTER = 0x02
    LEFT = 0x04


class WheelDrop(IntFlag):
    """Wheels hanging in the air."""

    RIGHT = 0x01
    LEFT = 0x02


class Cliff(IntFlag):
    """Cliff sensors that see no floor."""

    RIGHT = 0x01
    CENTER = 0x02
    LEFT = 0x04


class Button(IntFlag):
    """Touch buttons held."""

    B0 = 0x01
    B1 = 0x02
    B2 = 0x04


class OverCurrent(IntFlag):
    """Motors above their current limit."""

    LEFT = 0x01
    RIGHT = 0x02


class Charge(IntEnum):
    """Low bits of the charger byte."""

    DISCHARGING = 0
    CHARGED = 2
    CHARGING = 6


class DockSector(IntFlag):
    """Regions of the dock's infra-red field, named from the dock's own viewpoint. Note the order of the far
    ones.
    """

    NEAR_LEFT = 0x01
    NEAR_CENTER = 0x02
    NEAR_RIGHT = 0x04
    FAR_CENTER = 0x08
    FAR_LEFT = 0x10
    FAR_RIGHT = 0x20


CHARGER_ADAPTER = 0x10
"""Bit of the charger byte: the wall adapter, not the dock, feeds the robot."""


@dataclass(frozen=True, slots=True)
class Basic:
    """ID 1: timestamp in ms (wraps at 65536), contacts, encoder ticks (wrap at 65536), power."""

    timestamp_ms: int
    bumper: int
    wheel_drop: int
    cliff: int
    left_ticks: int
    right_ticks: int
    left_pwm: int
    right_pwm: int
    buttons: int
    charger: int
    battery_dv: int
    """Battery voltage in tenths of a volt."""
    over_current: int


@dataclass(frozen=True, slots=True)
class DockingIr:
    """ID 3: sectors of the dock each receiver sees (bits of DockSector)."""

    right: int
    center: int
    left: int


@dataclass(frozen=True, slots=True)
class Inertial:
    """ID 4: heading in 1/100 degree and its rate in 1/100 degree/s, counter-clockwise positive."""

    angle_cdeg: int
    rate_cdegps: int
    unused: bytes


@dataclass(frozen=True, slots=True)
class CliffAdc:
    """ID 5: cliff distance sensors, 12 bits for 0..3.3 V, larger = closer."""

    right: int
    center: int
    left: int


@dataclass(frozen=True, slots=True)
class MotorCurrent:
    """ID 6: wheel motor currents in 10 mA."""

    left_ca: int
    right_ca: int


@dataclass(frozen=True, slots=True)
class RawGyro:
    """ID 13: the sensor's own three axes, N samples of (x, y, z) digits; the chip is turned 90 degrees about
    z.
    """

    frame_id: int
    """Running number (mod 256) of the first sample."""
    samples: tuple[tuple[int, int, int], ...]


@dataclass(frozen=True, slots=True)
class Inputs:
    """ID 16: digital inputs (bit set = high), four analogue inputs (12 bits for 0..3.3 V), three words
    without meaning.
    """

    digital: int
    analog: tuple[int, int, int, int]
    spare: tuple[int, int, int]


@dataclass(frozen=True, slots=True, order=True)
class Version:
    """Hardware or firmware version."""

    major: int
    minor: int
    patch: int

    def __str__(self) -> str:
        return f"{self.major}.{self.minor}.{self.patch}"


@dataclass(frozen=True, slots=True)
class Udid:
    """ID 19: unique device id, three words."""

    words: tuple[int, int, int]

    def __str__(self) -> str:
        return "-".join(str(word) for word in self.words)


@dataclass(frozen=True, slots=True)
class Gains:
    """Wheel controller gains; `user` False selects the factory ones (100, 0.1, 2)."""

    p: float
    i: float
    d: float
    user: bool = True


FACTORY_GAINS = Gains(100.0, 0.1, 2.0, user=False)


@dataclass(frozen=True, slots=True)
class Eeprom:
    """ID 15 (undocumented): one page of 16 bytes."""

    frame_id: int
    data: bytes


@dataclass(frozen=True, slots=True)
class Feedback:
    """One frame whose checksum, tiling, sizes and value ranges are right. Parts the frame did not carry are
    None.
    """

    basic: Basic
    docking_ir: DockingIr | None = None
    inertial: Inertial | None = None
    cliff_adc: CliffAdc | None = None
    current: MotorCurrent | None = None
    hardware: Version | None = None
    firmware: Version | None = None
    raw_gyro: RawGyro | None = None
    eeprom: Eeprom | None = None
    inputs: Inputs | None = None
    udid: Udid | None = None
    gains: Gains | None = None
    unknown: tuple[tuple[int, bytes], ...] = ()
    """Sub-payloads of ids this table does not know."""


@dataclass(frozen=True, slots=True)
class BadFrame:
    """A run of bytes that belongs to no acceptable frame."""

    data: bytes
    reason: str
