"""Tours recorded as CARMEN logs that `lemtomap map` and other SLAM programs read.

    python -m lemtomap.sim.carmen WORLD OUT.log [SECONDS [SEED]]

FLASER lines have no angles and no time for each beam: n beams cover 180 degrees at once. So each scan is
moved to the pose of its middle beam (the URG takes 67 ms for its 240 degrees) and the 513 directions from -90
to +90 degrees, 0.3516 degrees apart, are written; one without answer is NO_RETURN_M. The pose is wheels and
gyro as Kobuki's own driver joins them (kobuki-protocol, section 7); TRUEPOS lines tell the truth beside it.
"""

import math
import sys
from collections import deque
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from lemtomap.sim import worlds
from lemtomap.sim.base import TICKS_PER_M
from lemtomap.sim.errors import BadWorld
from lemtomap.sim.hokuyo import (
    FIRST_STEP,
    FRONT_STEP,
    LAST_STEP,
    SLITS,
)
from lemtomap.sim.simulator import Simulator
from lemtomap.sim.tours import (
    SMALL_S,
    ScriptedTour,
    drive,
    plan_tour,
)
from lemtomap.sim.urg import ANGLES_RAD

COUNT = SLITS // 2 + 1
NO_RETURN_M = 8.0
MIDDLE_S = 0.1 * FRONT_STEP / SLITS


@dataclass
class DeadReckoning:
    """Kobuki's odometry: distance from the wheels, heading from the gyro."""

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0
    _last: tuple[int, int, int] | None = None
    _first_cdeg: int = 0

    @property
    def pose(self) -> NDArray[np.float64]:
        """Return x m, y m, yaw rad, where the first packet is the origin."""
        return np.array([self.x, self.y, self.yaw])

    def update(self, left_ticks: int, right_ticks: int, angle_cdeg: int) -> None:
        """Take the next packet's counters."""
        if self._last is None:
            self._last, self._first_cdeg = (left_ticks, right_ticks, angle_cdeg), angle_cdeg
            return
        left, right = left_ticks - self._last[0], right_ticks - self._last[1]
        forward = (left + right) / 2 / TICKS_PER_M
        yaw = math.radians((angle_cdeg - self._first_cdeg) / 100.0)
        middle = self.yaw + _wrap(yaw - self.yaw) / 2
        self.x += forward * math.cos(middle)
        self.y += forward * math.sin(middle)
        self.yaw = _wrap(yaw)
        self._last = (left_ticks, right_ticks, angle_cdeg)


@dataclass(frozen=True, slots=True)
class _Moment:
    """Poses when a packet was sent."""

    stamp_s: float
    odometry: NDArray[np.float64]
    truth: NDArray[np.float64]


def record_tour(simulator: Simulator, tour: ScriptedTour, path: Path, limit_s: float | None = None) -> int:
    """Drive a tour, at most so long, and write its log; return the number of scans."""
    simulator.hokuyo.write(b"BM\n")
    odometry = DeadReckoning()
    history: deque[_Moment] = deque(maxlen=16)
    scans, written_s = 0, -1.0
    with path.open("w", encoding="ascii") as log:
        log.write("# simulated TurtleBot 2, URG-04LX-UG01 cut to 180 degrees, truth in TRUEPOS\n")
        for _ in drive(simulator, tour, limit_s):
            simulator.kobuki.read()
            simulator.hokuyo.read()
            sent = simulator.base.last
            if sent is not None and not (history and history[-1].stamp_s == sent.stamp_s):
                odometry.update(sent.readings.left_ticks, sent.readings.right_ticks, sent.readings.angle_cdeg)
                history.append(_Moment(sent.stamp_s, odometry.pose, np.array(sent.state.pose)))
            scan = simulator.last_scan
            if scan is not None and scan.started_s > written_s and len(history) > 8:
                written_s = scan.started_s
                _write(log, scan.started_s + MIDDLE_S, scan.ranges_mm, list(history))
                scans += 1
    return scans


def _write(log: TextIO, stamp_s: float, ranges_mm: NDArray[np.int64], history: list[_Moment]) -> None:
    """Write one scan as seen from its middle beam's pose."""
    times = np.array([moment.stamp_s for moment in history])
    odometry = np.array([moment.odometry for moment in history])
    odometry[:, 2] = np.unwrap(odometry[:, 2])
    truth = np.array([moment.truth for moment in history])
    here = _at(np.array([stamp_s]), times, odometry)[0]
    beams_s = stamp_s + ANGLES_RAD * (0.1 / (2 * math.pi))
    ranges_m = deskew(ranges_mm[FIRST_STEP : LAST_STEP + 1] / 1000.0, _at(beams_s, times, odometry), here)
    values = " ".join(f"{value:.3f}" for value in ranges_m)
    pose, true = _text(here), _text(_at(np.array([stamp_s]), times, truth)[0])
    tail = f"{stamp_s:.6f} sim {stamp_s:.6f}"
    log.write(f"TRUEPOS {true} {pose} {tail}\n")
    log.write(f"FLASER {len(ranges_m)} {values} {pose} {pose} {tail}\n")


def deskew(
    ranges_m: NDArray[np.float64], poses: NDArray[np.float64], here: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the scan as one pose would have seen it, float64 (513,) from -90 to +90 degrees.

    `ranges_m`, float64 (682,), were measured from `poses`, float64 (682, 3). Of several beams one way the
    nearest counts; a direction between two that agree is filled with their mean.
    """
    seen = ranges_m >= 0.02
    yaw = poses[seen, 2] + ANGLES_RAD[seen]
    dx = poses[seen, 0] + ranges_m[seen] * np.cos(yaw) - here[0]
    dy = poses[seen, 1] + ranges_m[seen] * np.sin(yaw) - here[1]
    bearing = (np.arctan2(dy, dx) - here[2] + math.pi) % (2 * math.pi) - math.pi
    place = np.rint(bearing * SLITS / (2 * math.pi)).astype(np.int64) + SLITS // 4
    inside = (place >= 0) & (place < COUNT)
    result = np.full(COUNT, NO_RETURN_M)
    np.minimum.at(result, place[inside], np.hypot(dx, dy)[inside])
    left, right = result[:-2], result[2:]
    gap = (result[1:-1] == NO_RETURN_M) & (np.abs(left - right) < 0.1) & (left < NO_RETURN_M)
    result[1:-1][gap] = ((left + right) / 2)[gap]
    return result


def _at(
    stamps_s: NDArray[np.float64], times: NDArray[np.float64], poses: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return poses at other times, float64 (N, 3), yaw not wrapped."""
    return np.stack([np.interp(stamps_s, times, column) for column in poses.T], axis=1)


def _text(pose: NDArray[np.float64]) -> str:
    return f"{pose[0]:.5f} {pose[1]:.5f} {_wrap(float(pose[2])):.6f}"


def main(arguments: list[str]) -> int:
    """Record one tour."""
    if not 2 <= len(arguments) <= 4:
        sys.stderr.write(f"{__doc__}\n")
        return 2
    name, path, *rest = arguments
    try:
        world = worlds.load(name)
        tour = plan_tour(world, float(rest[0]) if rest else SMALL_S)
        simulator = Simulator(world, int(rest[1]) if len(rest) > 1 else 0)
    except (BadWorld, ValueError) as error:
        sys.stderr.write(f"{error}\n")
        return 2
    scans = record_tour(simulator, tour, Path(path))
    truth = simulator.truth()
    simulator.close()
    sys.stdout.write(f"{path}: {scans} scans, {truth.path_m:.0f} m in {truth.stamp_s:.0f} s\n")
    return 0


def _wrap(angle: float) -> float:
    return (angle + math.pi) % (2 * math.pi) - math.pi


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
