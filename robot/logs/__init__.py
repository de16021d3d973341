"""Recorded logs of other people's robots, as a stream of (Odometry, Scan): `for odometry, scan in
open_log(path)`.
"""

import gc
import gzip
import lzma
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Protocol

from lemtomap.errors import BadLog
from lemtomap.types import Odometry, Scan
from robot.logs import carmen, tinyslam


class Log(Protocol):
    """A log that was read whole and found sound; iterate as often as needed."""

    path: Path
    remarks: list[str]
    """Oddities that were survived, each with its line number: another number of beams, a teleporting
    odometry.
    """

    def __len__(self) -> int:
        """Return the number of scans."""
        ...

    def __iter__(self) -> Iterator[tuple[Odometry, Scan]]:
        """Yield one pair per laser line, in file order, with the log's own stamps (exact to 1
        microsecond).
        """
        ...


_UNPACKERS: dict[str, Callable[[bytes], bytes]] = {".gz": gzip.decompress, ".xz": lzma.decompress}
_READERS: dict[str, Callable[[Path, list[str]], Log]] = {
    ".clf": carmen.read,
    ".log": carmen.read,
    ".dat": tinyslam.read,
}


def open_log(path: str | Path) -> Log:
    """Read a CARMEN log (.clf, .log) or a tinySLAM log (.dat), plain or packed (.gz, .xz).

    Raises BadLog, one line that names file, line and reason.
    """
    path = Path(path)
    suffixes = path.suffixes
    packed = bool(suffixes) and suffixes[-1] in _UNPACKERS
    kind = suffixes[-2] if packed and len(suffixes) > 1 else (suffixes[-1] if suffixes else "")
    if kind not in _READERS:
        known = ", ".join(sorted(_READERS))
        raise BadLog(f"{path}: unknown kind of log '{kind}': known are {known}, each also with .gz or .xz")
    log = _READERS[kind](path, _lines(path, suffixes[-1]))
    gc.freeze()  # its records stay: looking through them for garbage again and again holds the mapping up
    return log


def _lines(path: Path, suffix: str) -> list[str]:
    try:
        data = path.read_bytes()
        if suffix in _UNPACKERS:
            data = _UNPACKERS[suffix](data)
    except FileNotFoundError:
        raise BadLog(f"{path}: no such file") from None
    except (EOFError, gzip.BadGzipFile, lzma.LZMAError, zlib.error) as error:
        raise BadLog(f"{path}: not a whole {suffix} file: {error}") from None
    except OSError as error:
        raise BadLog(f"{path}: cannot be read: {error.strerror or error}") from None
    text = data.decode("ascii", errors="replace")
    if not text.strip():
        raise BadLog(f"{path}: the file is empty")
    return text.splitlines(keepends=True)


__all__ = ["Log", "open_log"]
