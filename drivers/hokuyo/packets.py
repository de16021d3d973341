"""Facts of SCIP 2.0: status codes, echo grammar, sensor parameters, and what a reply can be.

Source: SCIP 2.0 communication specification C-42-03320B and recorded replies of URG-04LX(-UG01) and UTM-30LX.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

STAMP_BITS: Final = 24
BLOCK: Final = 64  # characters of a data line before its sum

_ANY: Final = rb"[ -:<-~]"  # printable, but not the semicolon that begins the tag
_COMMANDS: Final = (
    rb"VV|PP|II|BM|QT|RS|RT|RB|%ST|%SL|SCIP2\.0",
    rb"(?:TM|HS)" + _ANY,
    rb"(?:CR|DB)" + _ANY + rb"{2}",
    rb"SS" + _ANY + rb"{6}",
    rb"G[DSE]" + _ANY + rb"{10}",
    rb"M[DSE]" + _ANY + rb"{13}",
    rb"[NH][DE]" + _ANY + rb"{10,13}",
    rb"\$IP" + _ANY + rb"{0,40}",
)
_TAG: Final = rb"[A-Za-z0-9 ._+@]{0,16}"
ECHO: Final = re.compile(rb"(?P<command>" + b"|".join(_COMMANDS) + rb")(?:;(?P<tag>" + _TAG + rb"))?")
"""The first line of a reply repeats the command; the tag is whatever the host put behind `;`."""
REPLY_START: Final = re.compile(
    rb"(?:" + b"|".join(_COMMANDS) + rb")(?:;" + _TAG + rb")?\n[0-9][0-9A-Z][0-o]\n"
)
"""An echo and a status line: what a reply looks like inside bytes that were refused."""

ACCEPTED: Final = "00"
DATA: Final = "99"
CHECKED_NORMAL: Final = "98"

_STATUS_MEANING: Final = {
    "0A": "the sensor could not build a reply",
    "0B": "buffer shortage, or the command came twice",
    "0C": "bad parameters",
    "0D": "undefined command",
    "0E": "undefined command, or the sensor is in time-adjust mode",
    "0F": "bad parameters",
    "0G": "user string too long",
    "0H": "user string has invalid characters",
    "0I": "the sensor is in firmware-update mode",
    "0L": "abnormal state",
    "0M": "unstable",
    "10": "the laser is off",
}


def explain_status(status: str) -> str:
    """Return what a status means, for an error line."""
    if status in _STATUS_MEANING:
        return _STATUS_MEANING[status]
    if is_checking(status):
        return "measuring paused: the sensor checks an error"
    if is_trouble(status):
        return "hardware trouble: laser or motor"
    return "refused"


def is_checking(status: str) -> bool:
    """Return True if the sensor paused measuring to check an error (21 to 49)."""
    return status.isdigit() and 21 <= int(status) <= 49


def is_trouble(status: str) -> bool:
    """Return True if the laser or the motor failed and the stream is over (50 to 97)."""
    return status.isdigit() and 50 <= int(status) <= 97


@dataclass(frozen=True, slots=True)
class SensorParameters:
    """What PP tells: distances in mm, steps of the full turn, motor speed in rpm."""

    model: str
    min_mm: int
    max_mm: int
    steps_per_turn: int
    first_step: int
    last_step: int
    front_step: int
    rpm: int

    @classmethod
    def from_fields(cls, fields: Mapping[str, str]) -> "SensorParameters":
        """Read PP's fields. Raises ValueError that names the one missing or impossible."""
        names = ("DMIN", "DMAX", "ARES", "AMIN", "AMAX", "AFRT", "SCAN")
        for name in names:
            if not fields.get(name, "").strip().isdecimal():
                raise ValueError(f"{name} is {fields.get(name)!r} in the sensor's parameters")
        low, high, turn, first, last, front, rpm = (int(fields[name]) for name in names)
        if not (low < high and first < last < turn and front < turn and rpm > 0):
            raise ValueError(f"the sensor's parameters contradict one another: {dict(fields)}")
        return cls(fields.get("MODL", ""), low, high, turn, first, last, front, rpm)

    @property
    def period_s(self) -> float:
        """Time of one turn."""
        return 60.0 / self.rpm

    @property
    def step_rad(self) -> float:
        """Angle of one step."""
        return 2.0 * np.pi / self.steps_per_turn


URG_04LX_UG01: Final = SensorParameters(
    "URG-04LX-UG01(Simple-URG)(Hokuyo Automatic Co.,Ltd.)", 20, 5600, 1024, 44, 725, 384, 600
)


@dataclass(frozen=True, slots=True)
class Status:
    """A reply without data: accepted, or refused with a code."""

    command: str
    """Echoed command with its parameters, without the tag."""
    status: str
    """Two characters; one for the switch to SCIP 2.0 of a SCIP 1.1 sensor, which also answers `E...`."""
    tag: str = ""


@dataclass(frozen=True, slots=True)
class Info:
    """Reply to VV, PP or II."""

    command: str
    fields: Mapping[str, str]
    doubtful: frozenset[str] = frozenset()
    """Keys whose line failed its sum (some old sensors send a wrong one) or that came twice."""
    stray_lines: int = 0
    tag: str = ""


@dataclass(frozen=True, slots=True)
class ClockReading:
    """Reply to TM1: the sensor's ms timer, 24 bits."""

    stamp_ms: int
    tag: str = ""


@dataclass(frozen=True, slots=True)
class ScanFrame:
    """One scan as sent: reply to GD/GS or one of those that follow MD/MS."""

    command: str
    """Echo without interval and counter: command, start, end, cluster."""
    start: int
    end: int
    cluster: int
    interval: int | None
    """None for GD and GS."""
    remaining: int | None
    """Scans still to come; stays 0 when an endless run was asked for."""
    stamp_ms: int
    raw_mm: NDArray[np.int32]
    """int32 (N,): millimetres, below DMIN an error code; 0 where `valid` is False."""
    valid: NDArray[np.bool_] | None = None
    """bool (N,); None when every line was intact. False: the beam lies on a line that failed its sum."""
    tag: str = ""

    @property
    def intact(self) -> bool:
        """Return True if every byte of the frame was right."""
        return self.valid is None


@dataclass(frozen=True, slots=True)
class BadReply:
    """Bytes that belong to no acceptable reply."""

    data: bytes
    reason: str
