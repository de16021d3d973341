"""Names a device by the bytes it sent, so that swapped ports and strangers are told in one line."""

import re
from dataclasses import dataclass
from typing import Final

KOBUKI: Final = "a Kobuki base"
HOKUYO: Final = "a SCIP laser scanner"
NMEA: Final = "a device that speaks NMEA (a GPS receiver?)"
TEXT: Final = "a device that speaks plain text"
UNKNOWN: Final = "an unknown device"
TEXT_LINES: Final = 3  # the end of a scan that somebody left has two
TEXT_SHARE: Final = 0.9  # of printable bytes; the rest may be half a character at the start, or a broken bit

_SCIP_ECHO: Final = re.compile(
    rb"(?:^|\n)(?:VV|PP|II|QT|RS|BM|TM[012]|SCIP2\.0|[MG][DS]\d{8,13})\n(?:0|E|[0-9])"
)
_SCIP_BLOCK: Final = re.compile(rb"\n[0-o]{65}(?=\n)")
_NMEA_SENTENCE: Final = re.compile(rb"(?:^|[\r\n])[$!][A-Z]{2}[A-Z0-9]{3},")
_PRINTABLE: Final = re.compile(rb"[\t\r\n -~]")
_PLAIN_LINE: Final = re.compile(rb"[\t -~]{2,}[\r\n]")
_SCIP_LINE: Final = re.compile(rb"[0-o]+\n")
_KOBUKI_FRAME: Final = re.compile(rb"\xaa\x55[\x11-\xff]\x01\x0f", re.DOTALL)


@dataclass(frozen=True, slots=True)
class WrongDeviceSeen:
    """Another kind of device answers on this port."""

    reason: str


def name_device(data: bytes, enough: int = 400) -> str | None:
    """Return what kind of device sent these bytes, or None when they tell nothing (yet).

    After `enough` bytes without anything known it is a stranger.
    """
    if len(_KOBUKI_FRAME.findall(data)) >= 2:
        return KOBUKI
    if _SCIP_ECHO.search(data) or len(_SCIP_BLOCK.findall(data)) >= 2:
        return HOKUYO
    return _name_stranger(data) or UNKNOWN if len(data) >= enough else None


def name_talker(data: bytes, enough: int = 400) -> str | None:
    """Return what kind of device sent these bytes and did not answer what the right one answers at once.

    Then a single line tells enough: a stranger may print no more than one a second. Half a line, noise, and
    what may be the end of a scan tell nothing.
    """
    return name_device(data, enough) or _name_stranger(data)


def _name_stranger(data: bytes) -> str | None:
    if _NMEA_SENTENCE.search(data):
        return NMEA
    if len(_PRINTABLE.findall(data)) < TEXT_SHARE * len(data):
        return None
    lines = _PLAIN_LINE.findall(data)
    foreign = len(lines) >= TEXT_LINES or any(not _SCIP_LINE.fullmatch(line) for line in lines)
    return TEXT if foreign else None


def excerpt(data: bytes, limit: int = 24) -> str:
    """Return the first bytes for an error line: text when it is text, hexadecimal otherwise."""
    head = data[:limit]
    if head and all(32 <= byte < 127 or byte in b"\r\n\t" for byte in head):
        return repr(head.decode("ascii"))
    return head.hex(" ")
