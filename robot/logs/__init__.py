"""Recorded logs of other people's robots, as a stream of (Odometry, Scan): `for odometry, scan in
open_log(path)`.
"""

import gc
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Protocol

from lemtomap.errors import BadLog
from lemtomap.robot.logs import carmen, text, tinyslam
from lemtomap.robot.logs.records import RecordedLog
from lemtomap.types import Odometry, Scan


class Log(Protocol):
    """A log that was read whole; iterate as often as needed."""

    @property
    def path(self) -> Path:
        """Return where it was read from."""
        ...

    @property
    def remarks(self) -> list[str]:
        """Return the oddities that were survived, a line for each kind: how often, and where first."""
        ...

    @property
    def has_clock(self) -> bool:
        """Return True if the stamps tell how long the drive took."""
        ...

    def __len__(self) -> int:
        """Return the number of scans."""
        ...

    def __iter__(self) -> Iterator[tuple[Odometry, Scan]]:
        """Yield one pair per scan, in file order, with the log's own stamps (exact to 1 microsecond)."""
        ...


_Reader = Callable[[Path, Iterable[tuple[int, str]], float | None], RecordedLog]
_READERS: dict[str, _Reader] = {".clf": carmen.read, ".log": carmen.read, ".dat": tinyslam.read}


def open_log(path: str | Path, field_of_view_rad: float | None = None) -> Log:
    """Read a CARMEN log (.clf, .log) or a tinySLAM log (.dat), plain or packed (.gz, .xz).

    field_of_view_rad: what the laser of a CARMEN log covers, whatever the log says.

    Raises BadLog, one line that names file, line and reason; BadSetting for a field of view that is known.
    """
    path = Path(path)
    suffixes = [suffix.lower() for suffix in path.suffixes]
    packed = bool(suffixes) and suffixes[-1] in text.PACKED
    kind = suffixes[-2] if packed and len(suffixes) > 1 else (suffixes[-1] if suffixes else "")
    if kind not in _READERS:
        known = ", ".join(sorted(_READERS))
        raise BadLog(f"{path}: unknown kind of log '{kind}': known are {known}, each also with .gz or .xz")
    log = _READERS[kind](path, text.lines(path), field_of_view_rad)
    gc.freeze()  # its records stay: looking through them for garbage again and again holds the mapping up
    return log


__all__ = ["Log", "open_log"]
