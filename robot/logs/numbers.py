"""Numbers out of a line of text, each within what its quantity can be."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lemtomap import se2

FARTHEST_M = 1e7  # of an odometry pose: the earth's quarter, so that map projections fit
LARGEST_YAW_RAD = 1e6  # unwrapped headings grow
LATEST_S = 1e11  # of a stamp; above it microseconds are lost
LONGEST_RANGE_M = 1000.0
MOST_BEAMS = 100_000


class BrokenLine(Exception):
    """A line that cannot be used; the text is the reason."""


def number(text: str, limit: float) -> float:
    """Return the text as a number within -limit .. limit; raises BrokenLine with the offending text."""
    try:
        value = float(text)
    except ValueError:
        raise BrokenLine(f"'{_short(text)}' stands where a number belongs") from None
    if not math.isfinite(value):
        raise BrokenLine(f"'{text}' is not a finite number")
    if abs(value) > limit:
        raise BrokenLine(f"'{_short(text)}' is out of range (at most {limit:g} is plausible here)")
    return value


def pose(texts: Sequence[str]) -> NDArray[np.float64]:
    """Return three texts as x, y (metres) and yaw (radians), float64 (3,); raises BrokenLine."""
    x, y, yaw = texts
    return se2.pose(number(x, FARTHEST_M), number(y, FARTHEST_M), number(yaw, LARGEST_YAW_RAD))


def stamp(text: str) -> float:
    """Return the text as seconds; raises BrokenLine."""
    return number(text, LATEST_S)


def count(text: str, least: int = 0) -> int:
    """Return the text as a number of things that follow in the line; raises BrokenLine."""
    value = number(text, MOST_BEAMS)
    if value != int(value) or value < least:
        raise BrokenLine(f"'{_short(text)}' is no number of readings")
    return int(value)


def readings(texts: Sequence[str], longest: float = LONGEST_RANGE_M) -> NDArray[np.float64]:
    """Return the texts as float64 (N,), NaN where one is not finite or farther than any laser sees: a reading
    less does no harm. Raises BrokenLine where text stands.
    """
    try:
        values = np.array(list(map(float, texts)))
    except ValueError:
        values = np.array([float(text) if _is_number(text) else number(text, math.inf) for text in texts])
    values[~(np.abs(values) <= longest)] = np.nan
    return values


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _short(text: str) -> str:
    return text if len(text) <= 30 else text[:30] + "..."
