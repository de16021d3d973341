"""How SCIP 2.0 writes replies: sums, 6-bit characters, 64-character blocks (hokuyo-scip, 2 and 3)."""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

BLOCK = 64
MS_MAX_MM = 4095


def checksum(text: bytes) -> bytes:
    """Return the sum character of a line."""
    return bytes(((sum(text) & 0x3F) + 0x30,))


def summed(text: bytes, before_sum: str = "") -> bytes:
    """Return text with its sum; `before_sum` stands between and is not counted."""
    return text + before_sum.encode() + checksum(text)


def encode(values: ArrayLike, characters: int) -> bytes:
    """Return numbers as 2, 3 or 4 characters each, most significant first."""
    array = np.asarray(values, dtype=np.int64)
    shifts = np.arange(characters - 1, -1, -1) * 6
    return bytes((((array[:, None] >> shifts) & 0x3F) + 0x30).astype(np.uint8).tobytes())


def measurement(stamp_ms: int, values: NDArray[np.int64], characters: int) -> list[bytes]:
    """Return the lines of one scan: time stamp, then data blocks, each with its sum."""
    if characters == 2:
        values = np.minimum(values, MS_MAX_MM)
    return [summed(encode([stamp_ms], 4)), *_blocks(encode(values, characters))]


def _blocks(data: bytes) -> Iterable[bytes]:
    return (summed(data[start : start + BLOCK]) for start in range(0, len(data), BLOCK))


def reply(echo: str, status: str, lines: Sequence[bytes] = ()) -> bytes:
    """Return a whole reply: echo, status with sum, lines, empty line."""
    return b"\n".join([echo.encode("latin-1"), summed(status.encode()), *lines, b"", b""])
