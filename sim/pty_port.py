"""A pseudo-terminal that behaves like a USB serial port: raw, never hanging up, never blocking the device.

As in a serial port's tty, what the last client leaves unread at its close reaches nobody. The kernel would
keep it, so the port drops it when it hears of the close; only a client that reopens and reads at that very
moment may be faster.
"""

import errno
import fcntl
import os
import select
import struct
import termios
import tty
from pathlib import Path

from lemtomap.sim.openings import FileOpenings

FULL_BYTES = 3500  # the kernel's line discipline holds 4095; beyond this nobody is reading in time
OWED_BYTES = 1 << 16  # answers kept for a client that asks faster than it reads


class PtyPort:
    """The device's end of one pseudo-terminal; `path` is what a client opens."""

    def __init__(self, link: Path | None = None) -> None:
        """Open the port; `link` keeps the same name when it is unplugged and plugged in again."""
        self._link = link
        self._owed = bytearray()
        self._master = self._slave = -1
        self._tty = self.path = ""
        self._clients = 0
        self._attended = False
        self._openings: FileOpenings | None = None
        self.dropped_frames = 0
        """Frames nobody read in time."""
        self.plug(into=True)

    def plug(self, *, into: bool) -> None:
        """Pull the cable out (the client sees a hang-up), or plug it in again; what is done is done."""
        if into and not self.plugged:
            self._master, self._slave = os.openpty()
            tty.setraw(self._slave)
            os.set_blocking(self._master, False)
            self._tty = self.path = os.ttyname(self._slave)
            self._openings = FileOpenings(self._tty)
            self._attended = self._openings.fileno() < 0  # a kernel that cannot tell: somebody may be there
            if not self._attended:
                self._let_go()
            if self._link is not None:
                self._link.symlink_to(self.path)
                self.path = str(self._link)
        elif not into and self.plugged:
            self.close()

    @property
    def plugged(self) -> bool:
        """Whether there is a port."""
        return self._master >= 0

    @property
    def awaited(self) -> list[int]:
        """What to select for reading, file descriptors: commands, openings and closings."""
        openings = self._openings.fileno() if self._openings is not None else -1
        # a master whose client is away counts as readable all the time
        return [fd for fd in (self._master if self._attended else -1, openings) if fd >= 0]

    def heard(self) -> list[bytes | None]:
        """Return what clients have written since the last call, in order; None where the last one closed."""
        closed = self._follow_clients()
        data = self._read()
        if not closed:
            return [data] if data else []
        return [None, data] if self._attended else [data, None]

    def _follow_clients(self) -> bool:
        """Return whether the port has been closed by its last client since the last call.

        While there is a client the port holds the client's end open as well, to ask how much is unread there.
        Only when it lets go of it does the kernel tell whether anybody else is there.
        """
        if self._openings is None or self._openings.fileno() < 0:
            return False
        events = self._openings.heard()
        attended = self._attended
        if attended and all(events):
            self._clients += len(events)
            return False
        closed = False
        for opened in events:
            self._clients += 1 if opened else -1
            closed |= not opened and self._clients <= 0
        self._let_go()
        if not self._look():
            closed |= attended
            self._clients = 0
        if closed:
            self._forget()
        return closed

    def _look(self) -> bool:
        """Return whether a client is there, and hold the port then."""
        poll = select.poll()
        poll.register(self._master, 0)
        self._attended = not any(event & select.POLLHUP for _, event in poll.poll(0))
        if self._attended:
            self._clients = max(self._clients, 1)
            self._hold()
        return self._attended

    def _hold(self) -> None:
        if self._slave >= 0:
            return
        try:
            self._slave = os.open(self._tty, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        except OSError:
            return  # a client has it to itself
        self._own_events()

    def _let_go(self) -> None:
        if self._slave >= 0:
            os.close(self._slave)
            self._slave = -1
            self._own_events()

    def _own_events(self) -> None:
        if self._openings is not None:
            self._openings.heard()

    def _forget(self) -> None:
        """Drop what is on its way to a client that is gone."""
        self._owed.clear()
        termios.tcflush(self._master, termios.TCOFLUSH)
        self._hold()
        if self._slave >= 0:
            termios.tcflush(self._slave, termios.TCIFLUSH)
        if not self._attended:
            self._let_go()

    def _read(self) -> bytes:
        try:
            return os.read(self._master, 65536)
        except BlockingIOError:
            return b""
        except OSError as error:
            if error.errno == errno.EIO:
                return b""
            raise

    def write(self, frame: bytes, *, answer: bool = False) -> None:
        """Send one whole frame; when the client reads slowly an answer waits, any other frame is dropped."""
        if not self._attended and not self._look():
            return
        late = self._owed or self._room() < min(len(frame), FULL_BYTES)
        if late and (not answer or len(self._owed) + len(frame) > OWED_BYTES):
            self.dropped_frames += 1
            return
        self._owed += frame
        self.push()

    def push(self) -> None:
        """Send on what the client had no room for."""
        room = self._room()
        if not self._owed or room <= 0:
            return
        try:
            sent = os.write(self._master, self._owed[:room])
        except BlockingIOError:
            return
        del self._owed[:sent]

    def _room(self) -> int:
        """Return how many bytes may be sent, as the client has read so much."""
        if self._slave < 0:
            return FULL_BYTES
        answer = fcntl.ioctl(self._slave, termios.FIONREAD, b"\0\0\0\0")
        return FULL_BYTES - int(struct.unpack("i", answer)[0])

    def close(self) -> None:
        """Hang up. Closing twice is fine."""
        for fd in (self._master, self._slave):
            if fd >= 0:
                os.close(fd)
        self._master = self._slave = -1
        self._owed.clear()
        self._clients, self._attended = 0, False
        if self._openings is not None:
            self._openings.close()
        if self._link is not None:
            self._link.unlink(missing_ok=True)
