"""CARMEN logs: text, one message a line; laser lines are used, with the odometry pose inside them.

    FLASER n r1 .. rn  laser_x laser_y laser_theta  robot_x robot_y robot_theta  ipc_stamp host logger_stamp
    ROBOTLASER1 type start fov resolution max_range accuracy remission  n r1 .. rn  m e1 .. em
                laser_x laser_y laser_theta  robot_x robot_y robot_theta  tv rv forward side turn
                ipc_stamp host logger_stamp
    RAWLASER1   as ROBOTLASER1 up to em, then the stamps
    ODOM x y theta tv rv acceleration  ipc_stamp host logger_stamp
    PARAM name value

FLASER lines have no angles: PARAM lines or the number of beams tell them. RAWLASER1 lines have no pose: it
comes from the ODOM lines; they are used in a log that has no other laser lines.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lemtomap import se2
from lemtomap.errors import BadLog
from lemtomap.robot.logs.fans import (
    Fan,
    UnknownFan,
    fan_of_line,
    fan_over,
    fan_told,
)
from lemtomap.robot.logs.no_return import infer_no_return_m
from lemtomap.robot.logs.numbers import BrokenLine, Fields
from lemtomap.robot.logs.oddities import note_oddities
from lemtomap.robot.logs.odometry import OdometryLines
from lemtomap.robot.logs.records import Laser, Record, RecordedLog
from lemtomap.robot.logs.remarks import Remarks
from lemtomap.se2 import Pose

FARTHEST_SEEN_M = 80.0  # what a SICK LMS can see
POSED = ("FLASER", "ROBOTLASER1")  # lines with the odometry pose in them
RAW = "RAWLASER1"
STAMPS = 3  # fields at the end of every message: ipc_stamp host logger_stamp
POSES = 6  # of laser and robot
MOTION = 5  # of ROBOTLASER1: velocities and distances
SHORTEST_MESSAGE = 10  # fields of an ODOM line
CODE_ROUNDED_M = 0.005  # a reading of "no return" may be rounded below the maximum range
BROKEN = "broken lines are skipped"
ASK = "give it with --field-of-view DEGREES"


@dataclass(frozen=True, slots=True)
class _Beams:
    """What all laser lines have: readings, and where in the line they end."""

    fan: Fan
    ranges_m: NDArray[np.float32]
    max_range_m: float
    end: int


class _Reader:
    """What was read of a log so far."""

    def __init__(self, path: Path, field_of_view_rad: float | None) -> None:
        self.path = path
        self.field_of_view_rad = field_of_view_rad
        self.remarks = Remarks()
        self.records: dict[str, list[Record]] = {kind: [] for kind in (*POSED, RAW)}
        self.odometry = OdometryLines()
        self.first_broken = ""
        self._params: dict[str, float] = {}
        self._lasers: dict[tuple[Fan, float], Laser] = {}

    def take(self, place: int, line: str) -> None:
        """Read one line; a broken one is noted."""
        name = _name(line)
        try:
            if name in self.records:
                self.records[name].append(self._record(name, place, Fields(line)))
            elif name == "ODOM" and self.kind() == RAW:
                fields = Fields(line)
                _refuse_other_length(name, len(fields), SHORTEST_MESSAGE)
                self.odometry.add(fields.stamp(SHORTEST_MESSAGE - STAMPS), fields.pose(1))
            elif name == "PARAM":
                self._set(Fields(line))
        except BrokenLine as reason:
            self.remarks.add(BROKEN, place, str(reason))
            self.first_broken = self.first_broken or f":{place}: {reason}"
        except UnknownFan as reason:
            raise BadLog(f"{self.path}:{place}: {reason}: {ASK}") from None

    def end(self, place: int, last: str) -> None:
        """Note a last line that has no end and is too short for any message of a robot."""
        read = _name(last) in ({"PARAM", "SYNC", *self.records} | ({"ODOM"} if self.kind() == RAW else set()))
        short = 0 < len(last.split()) < SHORTEST_MESSAGE and not last.endswith("\n")
        if short and not read and not last.startswith("#"):
            self.remarks.add(BROKEN, place, "the file ends in the middle of it")

    def kind(self) -> str:
        """Return the kind of laser line the log is made of."""
        posed = max(POSED, key=lambda kind: len(self.records[kind]))
        return posed if self.records[posed] else RAW

    def _set(self, fields: Fields) -> None:
        """Keep a setting of the laser."""
        if len(fields) > 2 and fields.text(1) in _SETTINGS:
            name = fields.text(1)
            self._params[name] = fields.number(2, _SETTINGS[name])

    def _record(self, name: str, place: int, fields: Fields) -> Record:
        beams = self._flaser(fields) if name == "FLASER" else self._laser1(name, fields)
        at = beams.end
        if name == RAW:  # the pose follows when all odometry is known
            robot, T_base_laser = se2.IDENTITY, self._mounting()
        else:
            laser, robot = fields.pose(at), fields.pose(at + 3)
            T_base_laser = se2.between(robot, laser)
            at += POSES + (MOTION if name == "ROBOTLASER1" else 0)
        return Record(
            place=place,
            stamp_s=fields.stamp(at),
            ranges_m=beams.ranges_m,
            laser=self._laser(beams),
            T_odom_base=robot,
            T_base_laser=T_base_laser,
            missing=int(np.isnan(beams.ranges_m).sum()),
        )

    def _flaser(self, fields: Fields) -> _Beams:
        """Read the beams of `FLASER n r1 .. rn`."""
        count = fields.count(1, 2) if len(fields) > 1 else 2
        end = 2 + count
        _refuse_other_length("FLASER", len(fields), end + POSES + STAMPS)
        if self.field_of_view_rad is not None:
            fan = fan_over(count, self.field_of_view_rad)
        else:
            told = self._told("laser_front_laser_fov"), self._told("laser_front_laser_resolution")
            fan = fan_told(count, *told)
        return _Beams(fan, fields.readings(2, end).astype(np.float32), math.inf, end)

    def _laser1(self, name: str, fields: Fields) -> _Beams:
        """Read the beams of `NAME type start fov resolution max_range accuracy remission n r1 .. rn m ..`."""
        _refuse_shorter(name, len(fields), 9)
        start_rad, fov_rad, step_rad, max_range_m = (fields.number(at, 1e4) for at in range(2, 6))
        count = fields.count(8, 2)
        at = 9 + count
        _refuse_shorter(name, len(fields), at + 1)
        end = at + 1 + fields.count(at)
        _refuse_other_length(name, len(fields), end + STAMPS + (0 if name == RAW else POSES + MOTION))
        if self.field_of_view_rad is not None:
            fan = fan_over(count, self.field_of_view_rad)
        else:
            fan = _fan_of_line(count, start_rad, fov_rad, step_rad)
        ranges_m = fields.readings(9, at).astype(np.float32)
        return _Beams(fan, ranges_m, max_range_m if max_range_m > 0.0 else math.inf, end)

    def _laser(self, beams: _Beams) -> Laser:
        """Return the laser, one object for all scans with the same."""
        key = beams.fan, beams.max_range_m
        if key not in self._lasers:
            self._lasers[key] = Laser(
                angle_min_rad=beams.fan.angle_min_rad,
                angle_step_rad=beams.fan.step_rad,
                range_max_m=FARTHEST_SEEN_M,
                no_return_m=beams.max_range_m - CODE_ROUNDED_M,
            )
        return self._lasers[key]

    def _told(self, name: str) -> float | None:
        """Return an angle of the settings; CARMEN's 0 says nothing."""
        value = self._params.get(name, 0.0)
        return value if value > 0.0 else None

    def _mounting(self) -> Pose:
        """Return T_base_laser as the settings tell it."""
        ahead, aside, turned = (self._params.get(f"robot_frontlaser_{name}offset", 0.0) for name in _OFFSETS)
        return se2.pose(ahead, aside, turned)


_OFFSETS = ("", "side_", "angular_")
_SETTINGS = {  # name: the largest value that makes sense
    "laser_front_laser_fov": 361.0,
    "laser_front_laser_resolution": 361.0,
    **{f"robot_frontlaser_{name}offset": 100.0 for name in _OFFSETS},
}


def read(path: Path, lines: Iterable[tuple[int, str]], field_of_view_rad: float | None) -> RecordedLog:
    """Read every laser line; those that are broken are skipped and noted.

    field_of_view_rad: what the laser covers, whatever the log says. Raises BadLog when no scan is left, and
    when nothing tells where the beams point.
    """
    reader = _Reader(path, field_of_view_rad)
    place, line = 0, ""
    for place, raw in lines:
        line = raw.lstrip("\ufeff \t")
        reader.take(place, line)
    reader.end(place, line)
    kind = reader.kind()
    records = reader.records[kind]
    if not records:
        if reader.first_broken:
            raise BadLog(f"{path}{reader.first_broken}; no line is left to map")
        raise BadLog(f"{path}: no FLASER, ROBOTLASER1 or RAWLASER1 line in {place} lines: not a CARMEN log")
    if kind == RAW:
        records = reader.odometry.placed(path, records, reader.remarks)
    for other in POSED:
        if other != kind and reader.records[other]:
            for record in reader.records[other]:
                reader.remarks.add(f"{other} lines are left out", record.place, f"beside {kind}")
    note_oddities(records, reader.remarks)
    return RecordedLog(path, records, reader.remarks, infer_no_return_m(records))


def _name(line: str) -> str:
    """Return the message's name."""
    return line[: line.find(" ")] if " " in line else line.strip()


def _fan_of_line(beams: int, start_rad: float, fov_rad: float, step_rad: float) -> Fan:
    """Return the fan of a line that tells it; raises BrokenLine where it contradicts itself."""
    try:
        return fan_of_line(beams, start_rad, fov_rad, step_rad)
    except UnknownFan as reason:
        raise BrokenLine(f"{reason}: {ASK}") from None


def _refuse_other_length(name: str, found: int, needed: int) -> None:
    if found != needed:
        raise BrokenLine(f"cut in the middle? {name} promises {needed} fields, the line has {found}")


def _refuse_shorter(name: str, found: int, needed: int) -> None:
    _refuse_other_length(name, min(found, needed), needed)
