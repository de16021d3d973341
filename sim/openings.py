"""Who opens and closes a file, from the kernel's inotify; where there is none, nothing is ever heard."""

import ctypes
import os
import struct

IN_CLOSE, IN_OPEN = 0x08 | 0x10, 0x20
HEADER = struct.Struct("iIII")  # watch, mask, cookie, length of a name that a watched file never has


class FileOpenings:
    """Watches one file."""

    def __init__(self, path: str) -> None:
        self._fd = _watch(path)

    def fileno(self) -> int:
        """For select; -1 when the kernel cannot tell."""
        return self._fd

    def heard(self) -> list[bool]:
        """Return what happened since the last call, in order: True for an opening, False for a closing."""
        if self._fd < 0:
            return []
        try:
            data = os.read(self._fd, 1 << 16)
        except BlockingIOError:
            return []
        masks = [mask for _, mask, _, _ in HEADER.iter_unpack(data)]
        return [bool(mask & IN_OPEN) for mask in masks if mask & (IN_OPEN | IN_CLOSE)]

    def close(self) -> None:
        """Stop watching. Closing twice is fine."""
        if self._fd >= 0:
            os.close(self._fd)
        self._fd = -1


def _watch(path: str) -> int:
    """Return an inotify descriptor, -1 where the system has none left or no such thing."""
    libc = ctypes.CDLL(None, use_errno=True)
    if not hasattr(libc, "inotify_init1"):
        return -1
    fd: int = libc.inotify_init1(os.O_NONBLOCK | os.O_CLOEXEC)
    if fd >= 0 and libc.inotify_add_watch(fd, os.fsencode(path), IN_OPEN | IN_CLOSE) < 0:
        os.close(fd)
        return -1
    return fd
