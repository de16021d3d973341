"""What is odd about scans that were read, seen from one to the next."""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from lemtomap import se2
from lemtomap.robot.logs.records import Record
from lemtomap.robot.logs.remarks import Remarks

TELEPORT_M, TELEPORT_RAD = 1.0, 0.7  # more than a wheeled robot does between two scans


def note_oddities(records: Sequence[Record], remarks: Remarks) -> None:
    """Add a remark for every oddity."""
    for record in records:
        if record.missing:
            remarks.add(
                "ranges that are no numbers count as no answer", record.place, f"{record.missing} of them"
            )
    for before, here in pairwise(records):
        if len(before.ranges_m) != len(here.ranges_m):
            beams = f"{len(here.ranges_m)} after {len(before.ranges_m)}"
            remarks.add("the number of beams changes", here.place, beams)
        x, y, yaw = np.abs(se2.between(before.T_odom_base, here.T_odom_base))
        if math.hypot(x, y) > TELEPORT_M or yaw > TELEPORT_RAD:
            leap = f"by {math.hypot(x, y):,.2f} m, {math.degrees(yaw):.0f} degrees"
            remarks.add("the odometry leaps", here.place, leap)
        if here.stamp_s < before.stamp_s:
            back = f"by {before.stamp_s - here.stamp_s:,.3f} s"
            remarks.add("the clock goes back, scans are used in file order", here.place, back)
