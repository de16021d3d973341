"""Numbers out of the bytes of a line."""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

MOST_DIGITS = 15  # a whole number of so many digits is exact in a float64, ...
MOST_PLACES = 22  # ... and so is this power of ten: their quotient is rounded once, as Python's float() does

Array = NDArray[Any]


@njit(nogil=True, cache=True)
def decimals(line: Array) -> Array:
    """Return the fields of a line of ASCII, apart where str.split() parts them, as float64 (N,).

    line: uint8. A field that is more than a plain decimal of few digits is NaN: the caller reads it.
    """
    values = np.empty(len(line) // 2 + 1)
    found, at = 0, 0
    while at < len(line):
        byte = line[at]
        if byte == 32 or 9 <= byte <= 13 or 28 <= byte <= 31:
            at += 1
            continue
        negative = byte == 45
        if negative or byte == 43:
            at += 1
        mantissa, digits, places, seen, point, plain = 0, 0, 0, 0, False, True
        while at < len(line):
            byte = line[at]
            if byte == 32 or 9 <= byte <= 13 or 28 <= byte <= 31:
                break
            if 48 <= byte <= 57:
                seen += 1
                if digits < MOST_DIGITS:
                    mantissa = 10 * mantissa + (byte - 48)
                if mantissa > 0:
                    digits += 1
                if point:
                    places += 1
            elif byte == 46 and not point:
                point = True
            else:
                plain = False
            at += 1
        value = np.nan
        if plain and seen > 0 and digits <= MOST_DIGITS and places <= MOST_PLACES:
            value = mantissa / 10.0**places
            if negative:
                value = -value
        values[found] = value
        found += 1
    return values[:found]
