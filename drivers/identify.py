"""Names a device by the bytes it sent, so that swapped ports and strangers are told in one line."""

import re
from typing import Final

KOBUKI: Final = "a Kobuki base"
HOKUYO: Final = "a SCIP laser scanner"

_SCIP_REPLY: Final = re.compile(
    rb"(?:^|\n)(?:VV|PP|II|QT|RS|TM[012]|SCIP2\.0|[MG][DS]\d{8,13}|BM)[^\n]{0,17}\n(?:0|E|[0-9A-Z]{2}.)\n"
)
_KOBUKI_FRAME: Final = re.compile(rb"\xaa\x55[\x11-\xff]\x01\x0f", re.DOTALL)
_ENOUGH: Final = 200  # bytes without any frame of ours before they count as a stranger's


def name_device(data: bytes) -> str | None:
    """Return what kind of device sent these bytes, or None when they tell nothing (yet)."""
    if len(_KOBUKI_FRAME.findall(data)) >= 2:
        return KOBUKI
    if _SCIP_REPLY.search(data):
        return HOKUYO
    if len(data) < _ENOUGH:
        return None
    return "an unknown device"


def excerpt(data: bytes, limit: int = 24) -> str:
    """Return the first bytes for an error line: text when it is text, hexadecimal otherwise."""
    head = data[:limit]
    if head and all(32 <= byte < 127 or byte in b"\r\n\t" for byte in head):
        return repr(head.decode("ascii"))
    return head.hex(" ")
