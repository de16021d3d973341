"""What is odd about scans that were read, seen from one to the next."""

import math
from collections.abc import Sequence

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
    for index in _strange_steps(records):
        before, here = records[index], records[index + 1]
        if len(before.ranges_m) != len(here.ranges_m):
            beams = f"{len(here.ranges_m)} after {len(before.ranges_m)}"
            remarks.add("the number of beams changes", here.place, beams)
        x, y, yaw = np.abs(se2.between(before.T_odom_base, here.T_odom_base)).tolist()
        if math.hypot(x, y) > TELEPORT_M or yaw > TELEPORT_RAD:
            leap = f"by {math.hypot(x, y):,.2f} m, {math.degrees(yaw):.0f} degrees"
            remarks.add("the odometry leaps", here.place, leap)
        if here.stamp_s < before.stamp_s:
            back = f"by {before.stamp_s - here.stamp_s:,.3f} s"
            remarks.add("the clock goes back, scans are used in file order", here.place, back)


def _strange_steps(records: Sequence[Record]) -> list[int]:
    """Return which scans differ from the next one in what a remark may tell, in order."""
    poses = np.array([record.T_odom_base for record in records]).reshape(-1, 3)
    turned_rad = np.abs(se2.wrap_angle(np.diff(poses[:, 2])))
    way_m = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    beams = np.diff([len(record.ranges_m) for record in records])
    steps_s = np.diff([record.stamp_s for record in records])
    strange = (beams != 0) | (steps_s < 0.0)
    return np.flatnonzero(strange | (way_m > 0.99 * TELEPORT_M) | (turned_rad > 0.99 * TELEPORT_RAD)).tolist()
