"""Parameters of a SCIP measurement: which steps, how clustered, how many scans (hokuyo-scip, 5.11)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

STEPS = 769
MIN_MM = 20


@dataclass(slots=True)
class Stream:
    """A running MD or MS."""

    echo: str
    characters: int
    first: int
    last: int
    cluster: int
    interval: int
    left: int
    endless: bool
    tail: str
    asked_s: float
    skip: int = 0
    sent: int = 0


def remaining(stream: Stream) -> str:
    """Return the echo of the next frame, with the number of scans still to come."""
    return f"{stream.echo}{stream.left:02d}{stream.tail}"


def check_range(rest: str, length: int) -> str | None:
    """Return the status that refuses start, end and cluster, or None when they are good."""
    if len(rest) != length:
        return "0C"
    for digits, status in ((rest[:4], "01"), (rest[4:8], "02"), (rest[8:10], "03")):
        if not digits.isdigit():
            return status
    if int(rest[4:8]) >= STEPS:
        return "04"
    return "05" if int(rest[4:8]) < int(rest[:4]) else None


def cut(ranges_mm: NDArray[np.int64], first: int, last: int, cluster: int) -> NDArray[np.int64]:
    """Return the asked steps; of each group the smallest valid distance, else its first error code."""
    values = ranges_mm[first : last + 1]
    if cluster <= 1:
        return values
    groups = range(0, len(values), cluster)
    return np.array([_smallest_valid(values[start : start + cluster]) for start in groups])


def _smallest_valid(group: NDArray[np.int64]) -> int:
    valid = group[group >= MIN_MM]
    return int(valid.min()) if len(valid) else int(group[0])
