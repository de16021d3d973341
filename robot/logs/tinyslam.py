"""tinySLAM logs (.dat): the rover of Steux and El Hamzaoui with a real URG-04LX, one line a scan.

Column 0 is the time in microseconds, 2 and 3 the left and right wheel ticks, 24 to 705 the 682 ranges in mm;
readings below 20 are the laser's error codes (hokuyo-scip: URG-04LX data below 20).
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lemtomap import se2
from lemtomap.errors import BadLog
from lemtomap.types import Odometry, Scan
from robot.logs.numbers import finite, readings
from robot.logs.oddities import Record, oddities

FIELDS = 706
FIRST_RANGE, RANGES = 24, 682
WHEEL_RADIUS_M = 0.077
HALF_AXLE_M = 0.165
METRES_PER_TICK = WHEEL_RADIUS_M * math.pi / 2000.0
LASER_AHEAD_M = 0.145
FIRST_ERROR_FREE_MM = 20
RANGE_MAX_M = 5.6
ANGLE_STEP_RAD = 2.0 * math.pi / 1024.0  # URG-04LX data sheet: 0.36 degrees
TURN_S = 0.1  # URG-04LX data sheet: 100 ms a turn of 1024 steps
ANGLE_MIN_RAD = -(RANGES - 1) / 2.0 * ANGLE_STEP_RAD


@dataclass(frozen=True, slots=True)
class _Record(Record):
    v_mps: float
    w_radps: float
    """Mean velocity since the scan before; the rover drives up to 0.9 m/s, so a scan must be de-skewed."""


class TinySlamLog:
    """The scans of one .dat log; see robot.logs.Log."""

    def __init__(self, path: Path, records: list[_Record]) -> None:
        self.path = path
        self.remarks = oddities(records)
        self._records = records

    def __len__(self) -> int:
        return len(self._records)

    def __iter__(self) -> Iterator[tuple[Odometry, Scan]]:
        for record in self._records:
            yield Odometry(record.stamp_s, record.T_odom_base, record.v_mps, record.w_radps), _scan(record)


def read(path: Path, lines: list[str]) -> TinySlamLog:
    """Read every line; raises BadLog at the first that is damaged."""
    records: list[_Record] = []
    ticks_before: tuple[float, float] | None = None
    T_odom_base, step = se2.pose(0.0, 0.0, 0.0), se2.pose(0.0, 0.0, 0.0)
    for number, line in enumerate(lines, start=1):
        fields = line.split()
        if not fields:
            continue
        if len(fields) < FIELDS:
            raise BadLog(f"{path}:{number}: cut in the middle of the line? {len(fields)} fields of {FIELDS}")
        stamp_s = finite(path, number, fields[:1])[0] / 1e6
        left, right = finite(path, number, fields[2:4])
        millimetres = np.array(readings(path, number, fields[FIRST_RANGE : FIRST_RANGE + RANGES]))
        if ticks_before is not None:
            step = _wheel_step(left - ticks_before[0], right - ticks_before[1])
            T_odom_base = se2.compose(T_odom_base, step)
        ticks_before = (left, right)
        since_s = max(stamp_s - records[-1].stamp_s, TURN_S / 2.0) if records else TURN_S
        ranges = np.where(millimetres < FIRST_ERROR_FREE_MM, np.nan, millimetres / 1000.0).astype(np.float32)
        v_mps, w_radps = float(step[0]) / since_s, float(step[2]) / since_s
        missing = int(np.isnan(millimetres).sum())
        records.append(_Record(number, stamp_s, ranges, T_odom_base, missing, v_mps, w_radps))
    return TinySlamLog(path, records)


def _wheel_step(left_ticks: float, right_ticks: float) -> NDArray[np.float64]:
    """Return the motion of the base, driven on a circle, that turns the wheels by these ticks."""
    left_m, right_m = left_ticks * METRES_PER_TICK, right_ticks * METRES_PER_TICK
    turn = (right_m - left_m) / (2.0 * HALF_AXLE_M)
    forward = (left_m + right_m) / 2.0 * float(np.sinc(turn / (2.0 * math.pi)))
    return se2.pose(forward * math.cos(turn / 2.0), forward * math.sin(turn / 2.0), turn)


def _scan(record: _Record) -> Scan:
    return Scan(
        stamp_s=record.stamp_s,
        ranges_m=record.ranges_m,
        angle_min_rad=ANGLE_MIN_RAD,
        angle_step_rad=ANGLE_STEP_RAD,
        time_step_s=TURN_S / 1024.0,
        range_max_m=RANGE_MAX_M,
        T_base_laser=se2.pose(LASER_AHEAD_M, 0.0, 0.0),
    )
