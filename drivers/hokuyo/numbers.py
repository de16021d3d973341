"""SCIP's numbers and sums: 6 bits a character, each plus 0x30, most significant first."""

import numpy as np
from numpy.typing import NDArray

_OFFSET = 0x30
_DIGIT = 0x3F


class BadDigitError(ValueError):
    """A character outside 0x30..0x6F."""


def line_sum(text: bytes) -> int:
    """Return the sum character of a line."""
    return (sum(text) & _DIGIT) + _OFFSET


def encode_number(value: int, chars: int) -> bytes:
    """Return a number of `chars` characters. Raises ValueError when it does not fit."""
    if not 0 <= value < 1 << 6 * chars:
        raise ValueError(f"{value} does not fit into {chars} characters")
    return bytes((value >> 6 * i & _DIGIT) + _OFFSET for i in reversed(range(chars)))


def decode_number(text: bytes) -> int:
    """Return one number. Raises BadDigitError."""
    value = 0
    for char in text:
        if not _OFFSET <= char <= _OFFSET + _DIGIT:
            raise BadDigitError(f"character {char:#04x} in a number")
        value = value << 6 | char - _OFFSET
    return value


def digits_of(text: bytes) -> NDArray[np.uint8]:
    """Return uint8 (len(text),): 0..63, above 63 for characters that are no digits."""
    return np.frombuffer(text, dtype=np.uint8) - np.uint8(_OFFSET)


def join_digits(digits: NDArray[np.uint8], chars: int) -> NDArray[np.int32]:
    """Return int32 (N,) from uint8 (N * chars,) digits."""
    groups = digits.reshape(-1, chars).astype(np.int32)
    values = groups[:, 0]
    for column in range(1, chars):
        values = values << 6 | groups[:, column]
    return values
