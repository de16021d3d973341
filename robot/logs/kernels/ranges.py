"""Readings of a laser, made to say what they mean."""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[Any]


@njit(nogil=True, cache=True)
def told_apart(readings: Array, no_return: float) -> Array:
    """Return float32 (N,): +inf for a reading from `no_return` on, NaN for none above zero, else itself.

    readings: float32 (N,), metres; NaN stays.
    """
    ranges = np.empty(len(readings), np.float32)
    for i in range(len(readings)):
        reading = readings[i]
        if reading >= no_return:
            ranges[i] = np.inf
        elif reading <= 0.0:
            ranges[i] = np.nan
        else:
            ranges[i] = reading
    return ranges
