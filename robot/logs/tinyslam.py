"""tinySLAM logs (.dat): the rover of Steux and El Hamzaoui with a real URG-04LX, one line a scan.

Column 0 is the time in microseconds, 2 and 3 the left and right wheel ticks, then come other sensors and the
682 ranges in mm; readings below 20 are the laser's error codes (hokuyo-scip: URG-04LX data below 20). There
are two layouts, told apart by their width.
"""

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import chain, islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lemtomap import se2
from lemtomap.errors import BadLog, BadSetting
from lemtomap.robot.logs.numbers import LATEST_S, BrokenLine, Fields
from lemtomap.robot.logs.oddities import note_oddities
from lemtomap.robot.logs.records import Laser, Record, RecordedLog
from lemtomap.robot.logs.remarks import Remarks

RANGES = 682
WHEEL_RADIUS_M = 0.077  # of the rover, as tinySLAM's own program has it
HALF_AXLE_M = 0.165  # likewise
METRES_PER_TICK = 2.0 * math.pi * WHEEL_RADIUS_M / 2000.0  # 2000 ticks for each turn of a wheel
MOST_TICKS = 1e9
LASER_AHEAD_M = 0.145  # likewise
FIRST_ERROR_FREE_MM = 20  # URG-04LX: below it an error code
LONGEST_MM = 1e6  # no laser sees a kilometre
ANGLE_STEP_RAD = 2.0 * math.pi / 1024.0  # URG-04LX data sheet: 0.36 degrees
TURN_S = 0.1  # URG-04LX data sheet: 100 ms a turn of 1024 steps
URG_04LX = Laser(
    angle_min_rad=-(RANGES - 1) / 2.0 * ANGLE_STEP_RAD,
    angle_step_rad=ANGLE_STEP_RAD,
    range_max_m=5.6,
    time_step_s=TURN_S / 1024.0,
)
LINES_TO_JUDGE = 20


@dataclass(frozen=True, slots=True)
class _Layout:
    """Where things stand in a line."""

    first_range: int
    right_sign: int
    """-1: the right wheel counts down when the rover drives ahead."""

    @property
    def fields(self) -> int:
        return self.first_range + RANGES


_LAYOUTS = (_Layout(24, 1), _Layout(12, -1))  # the wider first: exp*.dat, test_lab*.dat


def read(path: Path, lines: Iterable[tuple[int, str]], field_of_view_rad: float | None) -> RecordedLog:
    """Read every line; those that are broken are skipped and noted. Raises BadLog when no scan is left."""
    if field_of_view_rad is not None:
        raise BadSetting(f"{path}: the laser of a tinySLAM log is known: --field-of-view is for CARMEN logs")
    pairs = ((place, Fields(line)) for place, line in lines)
    rows = ((place, fields) for place, fields in pairs if len(fields))
    first = list(islice(rows, LINES_TO_JUDGE))
    layout = _layout([len(fields) for _, fields in first])
    rover, remarks, reason = _Rover(layout), Remarks(), ""
    for place, fields in chain(first, rows):
        try:
            rover.take(place, fields)
        except BrokenLine as broken:
            remarks.add("broken lines are skipped", place, str(broken))
            reason = reason or f":{place}: {broken}"
    if not rover.records:
        raise BadLog(f"{path}{reason}; no line is left to map")
    note_oddities(rover.records, remarks)
    return RecordedLog(path, rover.records, remarks)


def _layout(widths: list[int]) -> _Layout:
    """Return the layout of most of the lines."""
    fitting = Counter(
        next((layout for layout in _LAYOUTS if width >= layout.fields), _LAYOUTS[0]) for width in widths
    )
    return fitting.most_common(1)[0][0] if fitting else _LAYOUTS[0]


class _Rover:
    """The rover's drive, line by line."""

    def __init__(self, layout: _Layout) -> None:
        self.records: list[Record] = []
        self._layout = layout
        self._ticks: tuple[float, float] | None = None
        self._T_odom_base = se2.pose(0.0, 0.0, 0.0)

    def take(self, place: int, fields: Fields) -> None:
        """Read one line; raises BrokenLine, then it changes nothing."""
        first, end = self._layout.first_range, self._layout.fields
        if len(fields) < end:
            raise BrokenLine(f"cut in the middle? {len(fields)} fields of {end}")
        stamp_s = fields.number(0, 1e6 * LATEST_S) / 1e6
        left = fields.number(2, MOST_TICKS)
        right = self._layout.right_sign * fields.number(3, MOST_TICKS)
        millimetres = fields.readings(first, end, LONGEST_MM)
        before = self._ticks if self._ticks is not None else (left, right)
        step = _wheel_step(left - before[0], right - before[1])
        self._ticks, self._T_odom_base = (left, right), se2.compose(self._T_odom_base, step)
        since_s = max(stamp_s - self.records[-1].stamp_s, TURN_S / 2.0) if self.records else TURN_S
        ranges_m = np.where(millimetres < FIRST_ERROR_FREE_MM, np.nan, millimetres / 1000.0)
        self.records.append(
            Record(
                place=place,
                stamp_s=stamp_s,
                ranges_m=ranges_m.astype(np.float32),
                laser=URG_04LX,
                T_odom_base=self._T_odom_base,
                T_base_laser=se2.pose(LASER_AHEAD_M, 0.0, 0.0),
                v_mps=float(step[0]) / since_s,  # up to 0.9 m/s: a scan must be de-skewed
                w_radps=float(step[2]) / since_s,
                missing=int(np.isnan(millimetres).sum()),
            )
        )


def _wheel_step(left_ticks: float, right_ticks: float) -> NDArray[np.float64]:
    """Return the motion of the base, driven on a circle, that turns the wheels by these ticks."""
    left_m, right_m = left_ticks * METRES_PER_TICK, right_ticks * METRES_PER_TICK
    turn = (right_m - left_m) / (2.0 * HALF_AXLE_M)
    forward = (left_m + right_m) / 2.0 * float(np.sinc(turn / (2.0 * math.pi)))
    return se2.pose(forward * math.cos(turn / 2.0), forward * math.sin(turn / 2.0), turn)
