"""What every kind of log is read into: one record a scan, and the stream of (Odometry, Scan) made of them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lemtomap.robot.logs.clock import tells_time
from lemtomap.robot.logs.kernels import ranges
from lemtomap.robot.logs.remarks import Remarks
from lemtomap.se2 import Pose
from lemtomap.types import Odometry, Scan


@dataclass(frozen=True, slots=True)
class Laser:
    """How a laser looks out; shared by all scans it made."""

    angle_min_rad: float
    angle_step_rad: float
    range_max_m: float
    no_return_m: float = np.inf
    """From this reading on a beam saw nothing."""
    time_step_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Record:
    """One scan of a log and the odometry that belongs to it."""

    place: int
    """Where in the file: the number of the line."""
    stamp_s: float
    ranges_m: NDArray[np.float32]
    """float32 (N,), metres as they stand in the log; NaN where no number stood."""
    laser: Laser
    T_odom_base: Pose
    T_base_laser: Pose
    v_mps: float = 0.0
    w_radps: float = 0.0
    """Mean velocity during the scan, by which a scan with a time step is de-skewed."""
    missing: int = 0
    """How many ranges were no numbers."""


@dataclass(frozen=True)
class RecordedLog:
    """The scans of one log; see lemtomap.robot.logs.Log."""

    path: Path
    records: Sequence[Record]
    notes: Remarks
    no_return_m: float = np.inf
    """From this reading on a beam of any laser in the log saw nothing."""
    has_clock: bool = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "has_clock", tells_time(self._stamps_s(), self._steps_m()))

    @property
    def remarks(self) -> list[str]:
        """Return a line for each kind of oddity."""
        untimed = ["the stamps are no clock: times and rates are left out"] if not self.has_clock else []
        return self.notes.lines() + (untimed if len(self) > 1 else [])

    def __len__(self) -> int:
        return len(self.records)

    def __iter__(self) -> Iterator[tuple[Odometry, Scan]]:
        for record in self.records:
            odometry = Odometry(record.stamp_s, record.T_odom_base, record.v_mps, record.w_radps)
            yield odometry, self._scan(record)

    def _scan(self, record: Record) -> Scan:
        laser = record.laser
        no_return_m = min(self.no_return_m, laser.no_return_m)
        return Scan(
            stamp_s=record.stamp_s,
            ranges_m=ranges.told_apart(record.ranges_m, float(np.float32(no_return_m))),
            angle_min_rad=laser.angle_min_rad,
            angle_step_rad=laser.angle_step_rad,
            time_step_s=laser.time_step_s,
            range_max_m=min(no_return_m, laser.range_max_m),
            T_base_laser=record.T_base_laser,
        )

    def _stamps_s(self) -> NDArray[np.float64]:
        return np.array([record.stamp_s for record in self.records])

    def _steps_m(self) -> NDArray[np.float64]:
        path = np.array([record.T_odom_base[:2] for record in self.records]).reshape(-1, 2)
        steps = np.diff(path, axis=0)
        return np.hypot(steps[:, 0], steps[:, 1])
