"""Numbers out of a line of text, each within what its quantity can be."""

import math

import numpy as np
from numpy.typing import NDArray

from lemtomap import se2
from lemtomap.robot.logs.kernels.decimals import decimals

FARTHEST_M = 1e7  # of an odometry pose: the earth's quarter, so that map projections fit
LARGEST_YAW_RAD = 1e6  # unwrapped headings grow
LATEST_S = 1e11  # of a stamp; above it microseconds are lost
LONGEST_RANGE_M = 1000.0
MOST_BEAMS = 100_000


class BrokenLine(Exception):
    """A line that cannot be used; the text is the reason."""


class Fields:
    """The fields of one line. Plain decimals, all but a few, are read in one go; the rest when asked for."""

    def __init__(self, line: str) -> None:
        self._line = line
        self._texts: list[str] | None = None
        if line.isascii():
            self._values = decimals(np.frombuffer(line.encode("ascii"), np.uint8))
        else:
            self._values = np.full(len(line.split()), np.nan)

    def __len__(self) -> int:
        return len(self._values)

    def text(self, at: int) -> str:
        """Return a field as it stands."""
        if self._texts is None:
            self._texts = self._line.split()
        return self._texts[at]

    def number(self, at: int, limit: float) -> float:
        """Return a field as a number within -limit .. limit; raises BrokenLine with the offending text."""
        value: float = self._values.item(at)
        if math.isnan(value):
            value = self._read(at)
        if not math.isfinite(value):
            raise BrokenLine(f"'{self.text(at)}' is not a finite number")
        if abs(value) > limit:
            raise BrokenLine(
                f"'{_short(self.text(at))}' is out of range (at most {limit:g} is plausible here)"
            )
        return value

    def pose(self, at: int) -> NDArray[np.float64]:
        """Return three fields as x, y (metres) and yaw (radians), float64 (3,); raises BrokenLine."""
        x, y, yaw = self._values[at : at + 3].tolist()
        if not (abs(x) <= FARTHEST_M and abs(y) <= FARTHEST_M and abs(yaw) <= LARGEST_YAW_RAD):
            x, y = self.number(at, FARTHEST_M), self.number(at + 1, FARTHEST_M)
            yaw = self.number(at + 2, LARGEST_YAW_RAD)
        return se2.pose(x, y, yaw)

    def stamp(self, at: int) -> float:
        """Return a field as seconds; raises BrokenLine."""
        return self.number(at, LATEST_S)

    def count(self, at: int, least: int = 0) -> int:
        """Return a field as a number of things that follow in the line; raises BrokenLine."""
        value = self.number(at, MOST_BEAMS)
        if value != int(value) or value < least:
            raise BrokenLine(f"'{_short(self.text(at))}' is no number of readings")
        return int(value)

    def readings(self, first: int, end: int, longest: float = LONGEST_RANGE_M) -> NDArray[np.float64]:
        """Return fields as float64 (N,), NaN where one is not finite or farther than any laser sees: one
        reading less does no harm. Raises BrokenLine where text stands.
        """
        values = self._values[first:end].copy()
        for i in np.flatnonzero(np.isnan(values)).tolist():
            values[i] = self._read(first + i)
        values[~(np.abs(values) <= longest)] = np.nan
        return values

    def _read(self, at: int) -> float:
        """Return what Python takes a field for; raises BrokenLine."""
        text = self.text(at)
        try:
            return float(text)
        except ValueError:
            raise BrokenLine(f"'{_short(text)}' stands where a number belongs") from None


def _short(text: str) -> str:
    return text if len(text) <= 30 else text[:30] + "..."
