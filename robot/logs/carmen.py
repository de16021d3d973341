"""CARMEN logs: text, one message a line; only FLASER lines are used, with the odometry pose inside them.

    FLASER n r1 .. rn  laser_x laser_y laser_theta  robot_x robot_y robot_theta  ipc_stamp host logger_stamp

The lines have no angles: n beams cover 180 degrees from right to left.
"""

import math
from collections import Counter
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

TAIL_FIELDS = 9  # laser pose, robot pose, stamp, host, logger stamp
PILE_WIDTH_M = (
    0.12  # a SICK's no-return code scatters this far below its most frequent value (unit conversions)
)
PILE_BEAMS = 5  # a code comes from beams of many directions, a real surface at one distance does not


@dataclass(frozen=True, slots=True)
class _Record(Record):
    T_base_laser: NDArray[np.float64]


class CarmenLog:
    """The laser lines of one CARMEN log; see robot.logs.Log."""

    def __init__(self, path: Path, records: list[_Record]) -> None:
        self.path = path
        self.no_return_m = infer_no_return_m([record.ranges_m for record in records])
        self.remarks = oddities(records)
        self._records = records

    def __len__(self) -> int:
        return len(self._records)

    def __iter__(self) -> Iterator[tuple[Odometry, Scan]]:
        for record in self._records:
            yield Odometry(record.stamp_s, record.T_odom_base), self._scan(record)

    def _scan(self, record: _Record) -> Scan:
        count = len(record.ranges_m)
        ranges_m = np.where(record.ranges_m >= self.no_return_m, np.float32(np.inf), record.ranges_m)
        ranges_m[ranges_m <= 0.0] = np.nan
        return Scan(
            stamp_s=record.stamp_s,
            ranges_m=ranges_m,
            angle_min_rad=-math.pi / 2.0,
            angle_step_rad=math.pi / (count - 1 if count % 2 else count),
            range_max_m=min(self.no_return_m, 80.0),
            T_base_laser=record.T_base_laser,
        )


def read(path: Path, lines: list[str]) -> CarmenLog:
    """Read every FLASER line; raises BadLog at the first line that is damaged."""
    _refuse_cut_end(path, lines)
    records = [
        _record(path, number, line) for number, line in enumerate(lines, start=1) if line.startswith("FLASER")
    ]
    if not records:
        raise BadLog(f"{path}: no FLASER line in {len(lines)} lines: not a CARMEN log")
    return CarmenLog(path, records)


def infer_no_return_m(scans: list[NDArray[np.float32]]) -> float:
    """Return the reading from which on a beam saw nothing, metres; infinity when the log has no such code.

    A laser writes a fixed code, its largest reading, for a beam that does not come back. The code shows as
    a pile of equal readings at the top of the log that comes from many directions.
    """
    seen = (ranges[~np.isnan(ranges)] for ranges in scans)
    largest_m = max((float(ranges.max()) for ranges in seen if len(ranges)), default=0.0)
    counts: Counter[int] = Counter()
    beams: dict[int, set[int]] = {}
    for ranges in scans:
        for beam in np.flatnonzero(ranges >= largest_m - 2.0 * PILE_WIDTH_M):
            centimetres = round(100.0 * float(ranges[beam]))
            counts[centimetres] += 1
            beams.setdefault(centimetres, set()).add(int(beam))
    pile, _ = counts.most_common(1)[0] if counts else (0, 0)
    if len(beams.get(pile, ())) < PILE_BEAMS:
        return math.inf
    return max(pile / 100.0 - PILE_WIDTH_M / 2.0, 0.0)


def _refuse_cut_end(path: Path, lines: list[str]) -> None:
    """Raise BadLog when the last line has no end and is too short for any message of a robot."""
    last = lines[-1]
    if not last.endswith("\n") and not last.startswith("#") and len(last.split()) < TAIL_FIELDS + 1:
        raise BadLog(f"{path}:{len(lines)}: the file is cut in the middle of this line")


def _record(path: Path, number: int, line: str) -> _Record:
    fields = line.split()
    (count,) = (int(value) for value in finite(path, number, fields[1:2])) if len(fields) > 1 else (0,)
    if count < 2 or len(fields) < 2 + count + TAIL_FIELDS:
        reason = (
            f"FLASER promises {count} ranges and {TAIL_FIELDS} more fields, the line has {len(fields) - 2}"
        )
        raise BadLog(f"{path}:{number}: cut in the middle of the line? {reason}")
    tail = fields[2 + count : 2 + count + TAIL_FIELDS]
    ranges = np.array(readings(path, number, fields[2 : 2 + count]), dtype=np.float32)
    numbers = finite(path, number, tail[:7])
    laser, robot = np.array(numbers[:3]), np.array(numbers[3:6])
    missing = int(np.isnan(ranges).sum())
    return _Record(number, numbers[6], ranges, robot, missing, se2.between(robot, laser))
