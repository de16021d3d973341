"""A pseudo-terminal that behaves like a USB serial port: raw, never hanging up, never blocking the device."""

import errno
import fcntl
import os
import struct
import termios
import tty
from pathlib import Path

FULL_BYTES = 3500  # the kernel's line discipline holds 4095; beyond this nobody is reading in time


class PtyPort:
    """The device's end of one pseudo-terminal; `path` is what a client opens."""

    def __init__(self, link: Path | None = None) -> None:
        """Open the port; `link` keeps the same name when it is unplugged and plugged in again."""
        self._link = link
        self._rest = b""
        self._master = self._slave = -1
        self.path = ""
        self.dropped_frames = 0
        """Frames nobody read in time."""
        self.plug(into=True)

    def plug(self, *, into: bool) -> None:
        """Pull the cable out (the client sees a hang-up), or plug it in again; what is done is done."""
        if into and not self.plugged:
            self._master, self._slave = os.openpty()  # kept open, or a client's close would hang up
            tty.setraw(self._slave)
            os.set_blocking(self._master, False)
            self.path = os.ttyname(self._slave)
            if self._link is not None:
                self._link.symlink_to(self.path)
                self.path = str(self._link)
        elif not into and self.plugged:
            self.close()

    @property
    def plugged(self) -> bool:
        """Whether there is a port."""
        return self._master >= 0

    def fileno(self) -> int:
        """For select."""
        return self._master

    def read(self) -> bytes:
        """Return what the client has written, perhaps nothing."""
        try:
            return os.read(self._master, 65536)
        except BlockingIOError:
            return b""
        except OSError as error:
            if error.errno == errno.EIO:
                return b""
            raise

    def write(self, frame: bytes) -> None:
        """Send one whole frame, or drop it as a whole when the client does not keep up."""
        if self._rest:
            self._push(self._rest)
        waiting = self._waiting()
        if self._rest or (waiting and waiting + len(frame) > FULL_BYTES):
            self.dropped_frames += 1
            return
        self._push(frame)

    def _push(self, data: bytes) -> None:
        try:
            self._rest = data[os.write(self._master, data) :]
        except BlockingIOError:
            self._rest = data

    def _waiting(self) -> int:
        """Return how many bytes the client has not read yet."""
        answer = fcntl.ioctl(self._slave, termios.FIONREAD, b"\0\0\0\0")
        return int(struct.unpack("i", answer)[0])

    def close(self) -> None:
        """Hang up. Closing twice is fine."""
        for fd in (self._master, self._slave):
            if fd >= 0:
                os.close(fd)
        self._master = self._slave = -1
        self._rest = b""
        if self._link is not None:
            self._link.unlink(missing_ok=True)
