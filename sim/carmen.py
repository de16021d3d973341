"""Tours recorded as CARMEN logs that `lemtomap map` and other SLAM programs read.

FLASER lines have no angles: n beams cover 180 degrees. Of the URG's 682 beams the 513 from -90 to +90 degrees
go in (0.3516 degrees apart exactly); a beam without answer is written as NO_RETURN_M. The pose is wheels and
gyro, as Kobuki's own driver joins them (kobuki-protocol, section 7), at the time of the middle beam; TRUEPOS
lines tell the truth beside it.
"""

import math
from collections import deque
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from sim.base import TICKS_PER_M
from sim.hokuyo import FRONT_STEP, SLITS
from sim.simulator import Simulator
from sim.tours import Tour, drive

FIRST, LAST = FRONT_STEP - SLITS // 4, FRONT_STEP + SLITS // 4
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


def record_tour(simulator: Simulator, tour: Tour, path: Path) -> int:
    """Drive a tour and write its log; return the number of scans."""
    simulator.hokuyo.write(b"BM\n")
    odometry = DeadReckoning()
    history: deque[tuple[float, NDArray[np.float64], NDArray[np.float64]]] = deque(maxlen=16)
    scans, written_s = 0, -1.0
    with path.open("w", encoding="ascii") as log:
        log.write("# simulated TurtleBot 2, URG-04LX-UG01 cut to 180 degrees, truth in TRUEPOS\n")
        for _ in drive(simulator, tour):
            simulator.kobuki.read()
            simulator.hokuyo.read()
            sent = simulator.base.last
            if sent is not None:
                odometry.update(sent.readings.left_ticks, sent.readings.right_ticks, sent.readings.angle_cdeg)
                history.append((sent.stamp_s, odometry.pose, np.array(sent.state.pose)))
            scan = simulator.last_scan
            if scan is not None and scan.started_s > written_s and len(history) > 8:
                written_s = scan.started_s
                _write(log, scan.started_s + MIDDLE_S, scan.ranges_mm, list(history))
                scans += 1
    return scans


def _write(
    log: TextIO,
    stamp_s: float,
    ranges_mm: NDArray[np.int64],
    history: list[tuple[float, NDArray[np.float64], NDArray[np.float64]]],
) -> None:
    """Write one scan with the poses at its middle beam."""
    times = [entry[0] for entry in history]
    odometry = _at(stamp_s, times, np.array([entry[1] for entry in history]))
    truth = _at(stamp_s, times, np.array([entry[2] for entry in history]))
    ranges_m = ranges_mm[FIRST : LAST + 1] / 1000.0
    ranges_m[ranges_m < 0.02] = NO_RETURN_M
    values = " ".join(f"{value:.3f}" for value in ranges_m)
    tail = f"{stamp_s:.6f} sim {stamp_s:.6f}"
    log.write(f"TRUEPOS {truth} {odometry} {tail}\n")
    log.write(f"FLASER {len(ranges_m)} {values} {odometry} {odometry} {tail}\n")


def _at(stamp_s: float, times: list[float], poses: NDArray[np.float64]) -> str:
    yaws = np.unwrap(poses[:, 2])
    x, y, yaw = (float(np.interp(stamp_s, times, column)) for column in (poses[:, 0], poses[:, 1], yaws))
    return f"{x:.5f} {y:.5f} {_wrap(yaw):.6f}"


def _wrap(angle: float) -> float:
    return (angle + math.pi) % (2 * math.pi) - math.pi
