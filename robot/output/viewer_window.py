"""The live view: Rerun's own window, fed through a pipe that nobody ever waits for.

The window hears on a port of its own, of this machine alone, and goes with the run; `lemtomap view` shows the
recording afterwards.
"""

import os
import subprocess
from collections import deque
from collections.abc import Callable
from contextlib import suppress

from lemtomap.robot.output.viewer_command import Process, end_viewer, start_viewer

BACKLOG_BYTES = 32 << 20  # some ten minutes of a run: a window that takes nothing for so long is stuck
KILLED = 128  # codes from here on stand for a signal
MEMORY_LIMIT = "1GB"  # its own default is 75 % of the machine


class ViewerWindow:
    """One window. Calls come from one thread."""

    def __init__(self, say: Callable[[str], None], backlog_bytes: int = BACKLOG_BYTES) -> None:
        """Open the window; a run goes on without it, which is said."""
        self._say = say
        self._backlog_bytes = backlog_bytes
        self._waiting: deque[memoryview] = deque()
        self._process: Process | None = None
        options = ["--port", "auto", "--memory-limit", MEMORY_LIMIT, "--hide-welcome-screen", "-"]
        try:
            self._process = start_viewer(*options, stdin=subprocess.PIPE, quiet=True)
        except OSError as error:
            say(f"no live view: {error}")
            return
        os.set_blocking(self._descriptor(), False)

    @property
    def open(self) -> bool:
        """Return True while the window takes anything."""
        return self._process is not None

    def put(self, data: bytes) -> None:
        """Hand over what the window shall show; never waits."""
        if self._process is None:
            return
        self._waiting.append(memoryview(data))
        try:
            self._write()
        except OSError:  # its end of the pipe is closed
            code = self._process.poll()
            failed = code is not None and 0 < code < KILLED
            how = f"ended with code {code}" if failed else "was closed"
            self._end(f"the live view {how}; the run goes on")
            return
        if sum(len(piece) for piece in self._waiting) > self._backlog_bytes:
            self._end("the live view takes nothing any more and is closed; the run goes on")

    def close(self) -> None:
        """Close the window and its port. Closing twice is fine."""
        process, self._process = self._process, None
        self._waiting.clear()
        if process is None:
            return
        assert process.stdin is not None  # noqa: S101 - opened as a pipe
        with suppress(OSError):
            process.stdin.close()
        end_viewer(process)

    def _end(self, why: str) -> None:
        self.close()
        self._say(why)

    def _descriptor(self) -> int:
        assert self._process is not None and self._process.stdin is not None  # noqa: S101, PT018
        return self._process.stdin.fileno()

    def _write(self) -> None:
        """Write as much as the pipe takes now."""
        while self._waiting:
            piece = self._waiting[0]
            try:
                written = os.write(self._descriptor(), piece)
            except BlockingIOError:
                return
            if written < len(piece):
                self._waiting[0] = piece[written:]
            else:
                self._waiting.popleft()
