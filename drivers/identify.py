"""Names a device by the bytes it sent, so that swapped ports and strangers are told in one line."""

import re
from dataclasses import dataclass
from typing import Final

KOBUKI: Final = "a Kobuki base"
HOKUYO: Final = "a SCIP laser scanner"

_SCIP_ECHO: Final = re.compile(
    rb"(?:^|\n)(?:VV|PP|II|QT|RS|BM|TM[012]|SCIP2\.0|[MG][DS]\d{8,13})\n(?:0|E|[0-9])"
)
_SCIP_BLOCK: Final = re.compile(rb"\n[0-o]{65}(?=\n)")
_KOBUKI_FRAME: Final = re.compile(rb"\xaa\x55[\x11-\xff]\x01\x0f", re.DOTALL)


@dataclass(frozen=True, slots=True)
class WrongDeviceSeen:
    """Another kind of device answers on this port."""

    reason: str


def name_device(data: bytes, enough: int = 400) -> str | None:
    """Return what kind of device sent these bytes, or None when they tell nothing (yet).

    After `enough` bytes without anything known it is an unknown device.
    """
    if len(_KOBUKI_FRAME.findall(data)) >= 2:
        return KOBUKI
    if _SCIP_ECHO.search(data) or len(_SCIP_BLOCK.findall(data)) >= 2:
        return HOKUYO
    return "an unknown device" if len(data) >= enough else None


def excerpt(data: bytes, limit: int = 24) -> str:
    """Return the first bytes for an error line: text when it is text, hexadecimal otherwise."""
    head = data[:limit]
    if head and all(32 <= byte < 127 or byte in b"\r\n\t" for byte in head):
        return repr(head.decode("ascii"))
    return head.hex(" ")
