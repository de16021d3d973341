"""What is odd in a log and does no harm to the rest of it, each with its line."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lemtomap import se2

TELEPORT_M, TELEPORT_RAD = 1.0, 0.7  # more than a wheeled robot does between two scans


@dataclass(frozen=True, slots=True)
class Record:
    """One line of a log, read."""

    line_number: int
    stamp_s: float
    ranges_m: NDArray[np.float32]
    T_odom_base: NDArray[np.float64]
    missing: int
    """How many ranges of the line were no numbers."""


def oddities(records: Sequence[Record]) -> list[str]:
    """Return a remark for every oddity."""
    remarks = [
        f"line {record.line_number}: ranges that are no numbers ({record.missing}) count as no answer"
        for record in records
        if record.missing
    ]
    for before, here in pairwise(records):
        if len(before.ranges_m) != len(here.ranges_m):
            beams = f"{len(here.ranges_m)} beams after {len(before.ranges_m)}"
            remarks.append(f"line {here.line_number}: {beams}")
        x, y, yaw = np.abs(se2.between(before.T_odom_base, here.T_odom_base))
        if math.hypot(x, y) > TELEPORT_M or yaw > TELEPORT_RAD:
            leap = f"{math.hypot(x, y):.2f} m, {math.degrees(yaw):.0f} degrees"
            remarks.append(f"line {here.line_number}: odometry leaps by {leap}")
    back = [here.line_number for before, here in pairwise(records) if here.stamp_s < before.stamp_s]
    if back:
        more = f" and {len(back) - 1} more" if len(back) > 1 else ""
        remarks.append(f"line {back[0]}{more}: the stamp goes back; lines are used in file order")
    return remarks
