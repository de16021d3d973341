"""What the host can tell a Kobuki: one frozen dataclass a command, each knowing its id and its bytes."""

import math
import struct
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from typing import Protocol

from lemtomap.drivers.kobuki.packets import WHEEL_BASE_M, Gains


class Command(Protocol):
    """Anything `encode` can put into a frame."""

    @property
    def id(self) -> int:
        """Sub-payload id."""
        ...

    def data(self) -> bytes:
        """Sub-payload bytes after id and size."""
        ...


_EPSILON = 1e-4  # kobuki_core: slower than this is standing, or straight
_HALF_BASE_MM = 500.0 * WHEEL_BASE_M


def _int16(value: float) -> int:
    return int(max(-32768.0, min(32767.0, value)))


@dataclass(frozen=True, slots=True)
class BaseControl:
    """Speed of the outer wheel and radius of the arc (positive: centre to the left; 0 straight; 1 on the
    spot).
    """

    speed_mmps: int
    radius_mm: int
    id: int = 0x01

    @classmethod
    def from_twist(cls, v_mps: float, w_radps: float) -> "BaseControl":
        """Convert as the official driver does (truncation and saturation included). Raises ValueError if not
        finite.
        """
        if not (math.isfinite(v_mps) and math.isfinite(w_radps)):
            raise ValueError(f"velocity is not finite: v={v_mps} m/s, w={w_radps} rad/s")
        if abs(w_radps) < _EPSILON:
            return cls(_int16(1000.0 * v_mps), 0)
        radius = 1000.0 * v_mps / w_radps
        if abs(v_mps) < _EPSILON or abs(radius) <= 1.0:
            return cls(_int16(_HALF_BASE_MM * w_radps), 1)
        arm = radius + math.copysign(_HALF_BASE_MM, radius)
        return cls(_int16(arm * w_radps), _int16(radius))

    def data(self) -> bytes:
        """Return speed and radius."""
        return struct.pack("<hh", self.speed_mmps, self.radius_mm)


STOP = BaseControl(0, 0)


@dataclass(frozen=True, slots=True)
class Sound:
    """A tone: `note` = 1 / (f * 2.75e-6)."""

    note: int
    duration_ms: int
    id: int = 0x03

    @classmethod
    def from_frequency(cls, frequency_hz: float, duration_s: float) -> "Sound":
        """Convert; the device plays at most 255 ms and nothing below 5.6 Hz. Raises ValueError outside
        these.
        """
        note, duration_ms = int(1.0 / (frequency_hz * 0.00000275)), round(1000 * duration_s)
        if not (0 < note <= 0xFFFF and 0 < duration_ms <= 0xFF):
            raise ValueError(
                f"no such tone: {frequency_hz} Hz for {duration_s} s (5.6 Hz to 363 kHz, to 0.255 s)"
            )
        return cls(note, duration_ms)

    def data(self) -> bytes:
        """Return note and duration."""
        return struct.pack("<HB", self.note, self.duration_ms)


class Tune(IntEnum):
    """Sequences the firmware knows."""

    ON = 0
    OFF = 1
    RECHARGE = 2
    BUTTON = 3
    ERROR = 4
    CLEANING_START = 5
    CLEANING_END = 6


@dataclass(frozen=True, slots=True)
class SoundSequence:
    """Play one of the firmware's tunes."""

    tune: Tune
    id: int = 0x04

    def data(self) -> bytes:
        """Return the index."""
        return bytes([self.tune])


class Extra(IntFlag):
    """What RequestExtra can ask for."""

    HARDWARE = 0x01
    FIRMWARE = 0x02
    UDID = 0x08


@dataclass(frozen=True, slots=True)
class RequestExtra:
    """Ask for versions and unique id; each comes once, in a later frame."""

    what: Extra
    id: int = 0x09

    def data(self) -> bytes:
        """Return the flags."""
        return struct.pack("<H", self.what)


@dataclass(frozen=True, slots=True)
class ChangeFrame:
    """Undocumented; known from the official driver's source."""

    frame_id: int
    id: int = 0x0A

    def data(self) -> bytes:
        """Return the frame id."""
        return bytes([self.frame_id])


@dataclass(frozen=True, slots=True)
class RequestEeprom:
    """Undocumented; answered by one Eeprom page."""

    frame_id: int
    id: int = 0x0B

    def data(self) -> bytes:
        """Return the frame id."""
        return bytes([self.frame_id])


class Output(IntFlag):
    """Bits of the one output register: open-drain outputs, power rails, LEDs (red + green = orange)."""

    DO0 = 0x0001
    DO1 = 0x0002
    DO2 = 0x0004
    DO3 = 0x0008
    POWER_3V3 = 0x0010
    POWER_5V = 0x0020
    POWER_12V_5A = 0x0040
    POWER_12V_1A5 = 0x0080
    LED1_RED = 0x0100
    LED1_GREEN = 0x0200
    LED2_RED = 0x0400
    LED2_GREEN = 0x0800


ALL_POWER = Output.POWER_3V3 | Output.POWER_5V | Output.POWER_12V_5A | Output.POWER_12V_1A5


class Led(IntEnum):
    """Colours of LED1 and LED2."""

    OFF = 0
    RED = 1
    GREEN = 2
    ORANGE = 3


@dataclass(frozen=True, slots=True)
class GeneralOutput:
    """Set the whole output register; who sends it must remember the last value."""

    bits: Output
    id: int = 0x0C

    def data(self) -> bytes:
        """Return the register."""
        return struct.pack("<H", self.bits)


@dataclass(frozen=True, slots=True)
class SetGains:
    """Set the wheel controller's gains (firmware 1.2.0 and later)."""

    gains: Gains
    id: int = 0x0D

    def data(self) -> bytes:
        """Return type and thousandths."""
        g = self.gains
        return struct.pack("<BIII", g.user, round(1000 * g.p), round(1000 * g.i), round(1000 * g.d))


@dataclass(frozen=True, slots=True)
class GetGains:
    """Ask for the wheel controller's gains (firmware 1.2.0 and later)."""

    id: int = 0x0E

    def data(self) -> bytes:
        """Return the one unused byte."""
        return b"\x00"
