"""Kobuki sub-payloads: the table of ids and sizes, and how each one's data are read and checked.

A field that holds what the device can never send shows a damaged frame: every such value is refused.
"""

import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from lemtomap.drivers.kobuki.packets import (
    CHARGER_ADAPTER,
    Basic,
    CliffAdc,
    DockingIr,
    Eeprom,
    Gains,
    Inertial,
    Inputs,
    MotorCurrent,
    RawGyro,
    Udid,
    Version,
)


class ImpossibleValueError(ValueError):
    """A field holds what the device can never send; the frame is damaged."""


def _demand(possible: bool, what: str) -> None:  # noqa: FBT001
    if not possible:
        raise ImpossibleValueError(what)


_BASIC = struct.Struct("<HBBBHHbbBBBB")
_INERTIAL = struct.Struct("<hh3s")
_THREE_WORDS = struct.Struct("<HHH")
_INPUTS = struct.Struct("<8H")
_UDID = struct.Struct("<III")
_GAINS = struct.Struct("<BIII")


def _basic(data: bytes) -> Basic:
    basic = Basic(*_BASIC.unpack(data))
    flags = basic.bumper <= 0x07 and basic.wheel_drop <= 0x03 and basic.cliff <= 0x07
    _demand(flags and basic.buttons <= 0x07 and basic.over_current <= 0x03, "flag bits that do not exist")
    _demand(basic.charger & ~CHARGER_ADAPTER in {0, 2, 6}, "charger state that does not exist")
    return basic


def _docking_ir(data: bytes) -> DockingIr:
    _demand(max(data) <= 0x3F, "dock sectors that do not exist")
    return DockingIr(*data)


def _inertial(data: bytes) -> Inertial:
    return Inertial(*_INERTIAL.unpack(data))


def _cliff_adc(data: bytes) -> CliffAdc:
    words = _THREE_WORDS.unpack(data)
    _demand(max(words) <= 0x0FFF, "cliff value above 12 bits")
    return CliffAdc(*words)


def _current(data: bytes) -> MotorCurrent:
    return MotorCurrent(data[0], data[1])


def _raw_gyro(data: bytes) -> RawGyro:
    _demand(data[1] * 2 + 2 == len(data), "gyro word count against size")
    words = struct.unpack_from(f"<{data[1]}h", data, 2)
    return RawGyro(data[0], tuple(zip(words[0::3], words[1::3], words[2::3], strict=True)))


def _inputs(data: bytes) -> Inputs:
    digital, a0, a1, a2, a3, *spare = _INPUTS.unpack(data)
    _demand(digital <= 0x0F and max(a0, a1, a2, a3) <= 0x0FFF, "input value above its range")
    return Inputs(digital, (a0, a1, a2, a3), (spare[0], spare[1], spare[2]))


_LEGACY_FIRMWARE = {
    123: (1, 0, 0),
    10100: (1, 1, 0),
    110: (1, 1, 0),
    10101: (1, 1, 1),
    111: (1, 1, 1),
}  # kobuki_core


def _version(data: bytes) -> Version:
    if len(data) == 4:
        _demand(data[3] == 0, "version above 24 bits")
        return Version(data[2], data[1], data[0])
    number = int.from_bytes(data, "little")
    return Version(*_LEGACY_FIRMWARE.get(number, (number // 100, number // 10 % 10, number % 10)))


def _eeprom(data: bytes) -> Eeprom:
    return Eeprom(data[0], data[1:])


def _udid(data: bytes) -> Udid:
    return Udid(_UDID.unpack(data))


def _gains(data: bytes) -> Gains:
    kind, p, i, d = _GAINS.unpack(data)
    _demand(kind <= 1, "gain type that does not exist")
    return Gains(p / 1000, i / 1000, d / 1000, user=kind == 1)


@dataclass(frozen=True, slots=True)
class SubPayload:
    """How one sub-payload is recognised and read."""

    field: str
    """Name of the field of Feedback it fills."""
    sizes: frozenset[int]
    parse: Callable[[bytes], Any]


_RAW_GYRO_SIZES = frozenset(2 + 6 * n for n in range(9))  # the official driver's buffer holds 8 samples

SUB_PAYLOADS: dict[int, SubPayload] = {
    1: SubPayload("basic", frozenset({15}), _basic),
    3: SubPayload("docking_ir", frozenset({3}), _docking_ir),
    4: SubPayload("inertial", frozenset({7}), _inertial),
    5: SubPayload("cliff_adc", frozenset({6}), _cliff_adc),
    6: SubPayload("current", frozenset({2}), _current),
    10: SubPayload("hardware", frozenset({4, 2}), _version),
    11: SubPayload("firmware", frozenset({4, 2}), _version),
    13: SubPayload("raw_gyro", _RAW_GYRO_SIZES, _raw_gyro),
    15: SubPayload("eeprom", frozenset({17}), _eeprom),
    16: SubPayload("inputs", frozenset({16}), _inputs),
    19: SubPayload("udid", frozenset({12}), _udid),
    21: SubPayload("gains", frozenset({13}), _gains),
}
