"""Where each scan was taken, streamed to disk: memory stays flat however long the drive."""

import tempfile
import weakref
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, Self

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


class ScanTrail:
    """Append-only file of (stamp, node, T_node_base), one record for each scan. Not part of the map."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        weakref.finalize(self, file.close)
        self._buffer = np.zeros(_BUFFERED, RECORD)
        self._filled = 0
        self.count = 0

    @classmethod
    def temporary(cls) -> Self:
        """Keep the trail in a file that goes with the process."""
        return cls(tempfile.TemporaryFile())

    @classmethod
    def create(cls, path: Path) -> Self:
        """Keep the trail in a file of its own."""
        return cls(path.open("w+b"))

    def append(
        self, slam: SlamUpdate, node_id: int, T_node_base: Pose, tie: NDArray[np.float64] | None
    ) -> None:
        """Add one scan; tie: covariance of the node's pose in the window, None while it is only predicted."""
        record = self._buffer[self._filled]
        record["stamp_s"], record["node_id"], record["T_node_base"] = slam.stamp_s, node_id, T_node_base
        record["T_grid_base"], record["step"] = slam.T_grid_base, slam.step_covariance
        record["tie"] = np.nan if tie is None else tie
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

    def close(self) -> None:
        """Write what is left and close."""
        if not self._file.closed:
            self._flush()
            self._file.close()

    def _flush(self) -> None:
        self._file.seek(0, 2)
        self._file.write(self._buffer[: self._filled].tobytes())
        self._filled = 0
