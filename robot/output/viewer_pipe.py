"""Where the viewer's recording goes: Rerun writes into a pipe, a thread carries it to file and window.

Rerun would wait for a frozen window, and lose what it cannot write without a word; so it knows neither.
"""

import os
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

from lemtomap.robot.output.viewer_window import ViewerWindow

PIECE_BYTES = 1 << 16


class ViewerPipe:
    """Carries one part of a recording. Raises OSError when its file cannot be made."""

    def __init__(self, path: Path, say: Callable[[str], None], window: ViewerWindow | None = None) -> None:
        self._path, self._say, self._window = path, say, window
        self._lock = threading.Lock()
        self._file: BinaryIO | None = path.open("wb", buffering=0)
        self._read_end, self._write_end = os.pipe()
        self._carrier = threading.Thread(target=self._carry, name="viewer", daemon=True)
        self._carrier.start()

    @property
    def sink(self) -> str:
        """The path that Rerun shall write to."""
        return f"/dev/fd/{self._write_end}"

    @property
    def writes(self) -> bool:
        """Whether the file is still written."""
        return self._file is not None

    def taken(self) -> None:
        """Rerun has opened its end: the recording ends when it closes it."""
        os.close(self._write_end)

    def end_file(self, why: str) -> None:
        """Write no further; what stands in the file stays readable. `why` ends the line that is said."""
        with self._lock:
            file, self._file = self._file, None
        if file is None:
            return
        with suppress(OSError):
            file.close()
        self._say(f"{self._path} ends here: {why}")

    def close(self, patience_s: float) -> None:
        """Wait for the last bytes and close the file. Rerun must have closed its end."""
        self._carrier.join(patience_s)
        self._close_file()

    def _close_file(self) -> None:
        with self._lock:
            file, self._file = self._file, None
        if file is not None:
            file.close()

    def _carry(self) -> None:
        """Take whatever comes, until Rerun closes its end."""
        while data := os.read(self._read_end, PIECE_BYTES):
            self._keep(data)
            if self._window is not None:
                self._window.put(data)
        os.close(self._read_end)
        self._close_file()

    def _keep(self, data: bytes) -> None:
        try:
            with self._lock:
                if self._file is None:
                    return
                _write_all(self._file, data)
        except OSError as error:
            self.end_file(error.strerror or str(error))


def _write_all(file: BinaryIO, data: bytes) -> None:
    """Write everything to an unbuffered file."""
    rest = memoryview(data)
    while rest:
        rest = rest[file.write(rest) :]
