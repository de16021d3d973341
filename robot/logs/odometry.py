"""The odometry of lines of its own, and where it says a scan was taken."""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from lemtomap import se2
from lemtomap.errors import BadLog
from lemtomap.robot.logs.records import Record
from lemtomap.robot.logs.remarks import Remarks
from lemtomap.se2 import Pose

FARTHEST_S = 1.0  # from a scan to the odometry next to it; robots send it several times a second


class OdometryLines:
    """Poses of the base by their stamps."""

    def __init__(self) -> None:
        self._found: list[tuple[float, Pose]] = []

    def add(self, stamp_s: float, T_odom_base: Pose) -> None:
        """Take the next line."""
        self._found.append((stamp_s, T_odom_base))

    def placed(self, path: Path, scans: Sequence[Record], remarks: Remarks) -> list[Record]:
        """Return the scans with the poses at their stamps; raises BadLog when there is no odometry at all."""
        if not self._found:
            raise BadLog(f"{path}: RAWLASER1 lines without ODOM lines: nothing tells how the robot moved")
        self._found.sort(key=lambda found: found[0])
        stamps_s = [stamp_s for stamp_s, _ in self._found]
        placed = []
        for scan in scans:
            after = bisect_right(stamps_s, scan.stamp_s)
            near = stamps_s[max(after - 1, 0) : after + 1]
            apart_s = min(abs(scan.stamp_s - stamp_s) for stamp_s in near)
            if apart_s > FARTHEST_S:
                remarks.add("scans without odometry near them", scan.place, f"{apart_s:,.1f} s off")
            placed.append(replace(scan, T_odom_base=self._at(after, scan.stamp_s)))
        return placed

    def _at(self, after: int, stamp_s: float) -> Pose:
        """Return the pose between the lines before and after a stamp, or at the nearer end."""
        if after in (0, len(self._found)):
            return self._found[min(after, len(self._found) - 1)][1]
        (begin_s, begin), (end_s, end) = self._found[after - 1], self._found[after]
        return se2.compose(begin, (stamp_s - begin_s) / (end_s - begin_s) * se2.between(begin, end))
