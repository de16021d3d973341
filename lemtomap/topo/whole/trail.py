"""Where each scan was taken, streamed to disk: memory stays flat however long the drive."""

import math
import struct
import tempfile
import weakref
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from lemtomap.se2 import Pose
from lemtomap.types import SlamUpdate

RECORD = np.dtype(
    [
        ("stamp_s", "<f8"),
        ("node_id", "<i8"),
        ("T_node_base", "<f8", (3,)),
        (
            "T_grid_base",
            "<f8",
            (3,),
        ),  # the window's own, smooth track: what joins one node's stretch to the next
        ("step", "<f4", (3, 3)),  # covariance of the motion since the scan before, axes of the base before
        ("tie", "<f4", (3, 3)),  # covariance of T_grid_node, axes of the node; NaN while it is only predicted
    ]
)
_BUFFERED = 256
LOOK_M, LOOK_RAD = 0.25, 0.35  # motion between two scans whose hits are kept as well
HIT_STEP_M = 0.001


@dataclass(frozen=True, slots=True)
class TrailScan:
    """The hits of one scan of the drive."""

    scan: int
    """Its number in the trail."""
    hits_base: NDArray[np.float32]
    """float32 (N, 2), metres, base frame."""


class _LookFile:
    """Every so often a scan's hits, a kilobyte or less each: scan, count, then x and y in millimetres."""

    def __init__(self) -> None:
        self._file = tempfile.TemporaryFile()  # noqa: SIM115 - closed by the finaliser below
        weakref.finalize(self, self._file.close)
        self._last: Pose | None = None

    def offer(self, scan: int, T_grid_base: Pose, hits_base: NDArray[np.floating]) -> None:
        """Keep a scan's hits if the robot has moved enough since the last that were kept."""
        if self._last is not None:
            x, y, turn = (T_grid_base - self._last).tolist()
            if math.hypot(x, y) < LOOK_M and math.cos(turn) > math.cos(LOOK_RAD):
                return
        self._last = np.array(T_grid_base)
        limit = np.iinfo(np.int16).max
        hits = np.clip(np.rint(hits_base / HIT_STEP_M), -limit, limit).astype("<i2")
        self._file.write(struct.pack("<qi", scan, len(hits)) + hits.tobytes())

    def looks(self) -> Iterator[TrailScan]:
        self._file.seek(0)
        while head := self._file.read(12):
            scan, count = struct.unpack("<qi", head)
            hits = np.frombuffer(self._file.read(4 * count), "<i2").reshape(-1, 2)
            yield TrailScan(scan, hits.astype(np.float32) * np.float32(HIT_STEP_M))
        self._file.seek(0, 2)

    def close(self) -> None:
        self._file.close()


class _Columns(NamedTuple):
    """The fields of the records in the buffer: looked up once, not at every scan."""

    stamp_s: NDArray[np.float64]
    node_id: NDArray[np.int64]
    T_node_base: NDArray[np.float64]
    T_grid_base: NDArray[np.float64]
    step: NDArray[np.float32]
    tie: NDArray[np.float32]


class ScanTrail:
    """Append-only file of (stamp, node, T_node_base), one record for each scan. Not part of the map."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        weakref.finalize(self, file.close)
        self._buffer = np.zeros(_BUFFERED, RECORD)
        self._columns = _Columns(*(self._buffer[name] for name in _Columns._fields))
        self._filled = 0
        self.count = 0
        self._looks = _LookFile()

    @classmethod
    def temporary(cls) -> Self:
        """Keep the trail in a file that goes with the process."""
        return cls(tempfile.TemporaryFile())

    @classmethod
    def create(cls, path: Path) -> Self:
        """Keep the trail in a file of its own."""
        return cls(path.open("w+b"))

    def append(
        self,
        slam: SlamUpdate,
        node_id: int,
        T_node_base: Pose,
        tie: NDArray[np.float64] | None,
        hits_base: NDArray[np.floating] | None = None,
    ) -> None:
        """Add one scan; tie: covariance of the node's pose in the window, None while it is only predicted;
        hits_base: float (N, 2), metres, base frame, of which some scans' are kept.
        """
        if hits_base is not None and len(hits_base) and slam.matched:
            self._looks.offer(self.count, slam.T_grid_base, hits_base)
        at, columns = self._filled, self._columns
        columns.stamp_s[at], columns.node_id[at], columns.T_node_base[at] = slam.stamp_s, node_id, T_node_base
        columns.T_grid_base[at], columns.step[at] = slam.T_grid_base, slam.step_covariance
        columns.tie[at] = np.nan if tie is None else tie
        self._filled += 1
        self.count += 1
        if self._filled == _BUFFERED:
            self._flush()

    def records(self, at_once: int = 65536) -> Iterator[NDArray[np.void]]:
        """Iterate over the trail from its start in arrays of RECORD, at most `at_once` long."""
        self._flush()
        position = 0
        while position < self.count:
            self._file.seek(position * RECORD.itemsize)
            data = self._file.read(at_once * RECORD.itemsize)
            yield np.frombuffer(data, RECORD)
            position += at_once

    def looks(self) -> Iterator[TrailScan]:
        """Iterate over the scans whose hits were kept, in the order of the drive."""
        return self._looks.looks()

    def close(self) -> None:
        """Write what is left and close."""
        if not self._file.closed:
            self._flush()
            self._file.close()
            self._looks.close()

    def _flush(self) -> None:
        self._file.seek(0, 2)
        self._file.write(self._buffer[: self._filled].tobytes())
        self._filled = 0
