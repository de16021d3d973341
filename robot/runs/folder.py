"""The folder a run writes into: one run at a time, with room kept for the results, and noticed when it goes.

The lock is the system's and lies on the folder itself: it leaves no file and ends with the program. The room
is a file without a name, which ends with the program, too.
"""

import fcntl
import os
import shutil
import tempfile
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

from lemtomap.errors import BadSetting

MB = 1_000_000
KEPT_BYTES = 8 * MB  # trajectory of two hours, grid, picture, summary, the end of the map
RECORDINGS_BYTES = 64 * MB  # what they leave free: an hour of map, and whatever else writes here
LEAST_BYTES = MB  # a run that maps anything leaves more


class RunFolder:
    """A folder that belongs to this run. Close it at the end; a program that dies lets go of it."""

    def __init__(self, path: Path) -> None:
        """Make and lock the folder. Raises BadSetting when that cannot be; then none is left behind."""
        self.path = path
        self._made: list[Path] = []
        self._lock = self._claim(path)

    def _claim(self, path: Path) -> int:
        """Make the folder and return the descriptor that holds its lock."""
        if path.exists() and not path.is_dir():
            raise BadSetting(f"{path}: is a file; --out needs a folder")
        made = [folder for folder in (path, *path.parents) if not folder.exists()]
        try:
            path.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
        except OSError as error:
            raise BadSetting(f"{path}: cannot write there ({error.strerror})") from error
        self._made = made
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(descriptor)
            raise BadSetting(f"{path}: another run writes there; give another --out") from None
        except OSError:  # a file system without locks: then there is none
            return descriptor
        return descriptor

    @property
    def here(self) -> bool:
        """Return True if the folder still stands at its path, not deleted, moved or replaced."""
        try:
            return os.path.samestat(os.fstat(self._lock), self.path.stat())
        except OSError:
            return False

    def renew(self) -> Path:
        """Make the folder anew after it went; beside it, or in the system's own, where it cannot be."""
        os.close(self._lock)
        try:
            self._lock = self._claim(self.path)
        except BadSetting:
            self.path = self._elsewhere()
            self._lock = self._claim(self.path)
        return self.path

    def _elsewhere(self) -> Path:
        prefix = f"{self.path.name}-"
        with suppress(OSError):
            return Path(tempfile.mkdtemp(prefix=prefix, dir=self.path.parent))
        return Path(tempfile.mkdtemp(prefix=prefix))

    def close(self) -> None:
        """Let go of the folder. Closing twice is fine."""
        if self._lock >= 0:
            os.close(self._lock)
            self._lock = -1

    def take_back(self) -> None:
        """Let go of the folder and remove it, if this run made it and nothing stands in it."""
        self.close()
        for folder in self._made:
            with suppress(OSError):  # not empty: something of value stands there
                folder.rmdir()


@dataclass(slots=True)
class Space:
    """The room left on the disk of a folder, some of it kept for what a run leaves at its end.

    All limits are shares of what was free at the start, so that a small disk is used as well.
    """

    folder: Path
    recordings_bytes: int = 0
    """Below this recordings end."""
    least_bytes: int = 0
    """Below this the run ends."""
    scarce: bool = False
    """True: recordings have ended for the sake of this disk."""
    _kept: IO[bytes] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        """Keep the room. Raises BadSetting when there is none."""
        free = self.free_bytes()
        if free < LEAST_BYTES:
            raise BadSetting(f"{self.folder}: the disk is full; a run needs {LEAST_BYTES // MB} MB at least")
        kept = min(KEPT_BYTES, free // 8)
        self.recordings_bytes = min(RECORDINGS_BYTES, free // 4)
        self.least_bytes = kept // 2
        try:
            self._kept = tempfile.TemporaryFile(dir=self.folder)  # noqa: SIM115 - until released
            os.posix_fallocate(self._kept.fileno(), 0, kept)
        except OSError as error:
            raise BadSetting(f"{self.folder}: cannot write there ({error.strerror})") from error

    def free_bytes(self) -> int:
        """Return how much may still be written."""
        return shutil.disk_usage(self.folder).free

    def release(self) -> None:
        """Give the kept room to whoever writes the results. May be called again."""
        kept, self._kept = self._kept, None
        if kept is not None:
            kept.close()
