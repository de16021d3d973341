"""A recording in parts: run.mcap, run.0002.mcap, run.0003.mcap, ... Beyond a limit the oldest goes."""

import re
from pathlib import Path

from lemtomap.errors import BadSetting

PARTS = 8  # on the disk at once: a full recording holds at least seven eighths of its limit
SMALLEST_LIMIT = 8 * 10**6
DEFAULT_LIMIT = 2 * 10**9  # run.mcap: more than a day of driving; run.rrd: six to nine hours
UNITS = {"": 1, "k": 10**3, "M": 10**6, "G": 10**9, "T": 10**12}


class PartFiles:
    """The files of one recording that is being written."""

    def __init__(self, first: Path, limit_bytes: int = DEFAULT_LIMIT) -> None:
        self.part_bytes = limit_bytes // PARTS
        """A part of this size is full."""
        self.number = 1
        self.dropped = 0
        """How many parts went because of the limit."""
        self._first = first
        self._past_bytes = 0

    @property
    def path(self) -> Path:
        """The part that is being written."""
        return part_path(self._first, self.number)

    @property
    def full(self) -> bool:
        """Whether the next part is due."""
        return _size(self.path) >= self.part_bytes

    @property
    def written_bytes(self) -> int:
        """Everything written so far, with what went."""
        return self._past_bytes + _size(self.path)

    def advance(self) -> Path:
        """Go on to the next part, and remove the oldest when there are too many; return the new path."""
        self._past_bytes = self.written_bytes
        self.number += 1
        oldest = self.number - PARTS
        if oldest > 0:
            part_path(self._first, oldest).unlink(missing_ok=True)
            self.dropped = oldest
        return self.path


def part_path(first: Path, number: int) -> Path:
    """Return the path of a part, counted from 1."""
    return first if number == 1 else first.with_name(f"{first.stem}.{number:04d}{first.suffix}")


def part_number(path: Path) -> int:
    """Return which part a file is by its name, counted from 1."""
    match = re.fullmatch(r"\.([0-9]{4,9})", path.with_suffix("").suffix)
    return int(match[1]) if match else 1


def parts_of(first: Path) -> list[Path]:
    """Return the parts that are there, oldest first; `first` need not be among them."""
    found = [path for path in first.parent.glob(f"{first.stem}.*{first.suffix}") if part_number(path) > 1]
    return [path for path in (first, *sorted(found, key=part_number)) if path.is_file()]


def parse_size(text: str) -> int:
    """Return the bytes meant by "500MB" or "2 GB". Raises BadSetting."""
    match = re.fullmatch(r"([0-9]{1,15}(?:\.[0-9]{1,9})?)\s*([kMGT]?)B?", text.strip())
    if match is None:
        raise BadSetting(f"size '{text}': must be a number of bytes like 500MB or 2GB")
    size = int(float(match[1]) * UNITS[match[2]])
    if size < SMALLEST_LIMIT:
        raise BadSetting(f"size '{text}': a recording needs at least {SMALLEST_LIMIT // 10**6}MB")
    return size


def _size(path: Path) -> int:
    return path.stat().st_size if path.exists() else 0
