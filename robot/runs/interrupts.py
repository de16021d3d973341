"""How somebody ends a command: Ctrl-C, SIGTERM, or SIGHUP when the terminal or the SSH connection is gone.

Each means the same: stop what you do, keep what you have. What was started under `nohup` does not end with
its terminal. Writing to a terminal that is gone is no error: what nobody can read is dropped.
"""

import os
import signal
import stat
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@contextmanager
def on_interrupt(act: Callable[[], None]) -> Iterator[None]:
    """Call `act` in the main thread for each interrupt while the body runs; then as it was before.

    In any other thread the body runs as it is: signals are the main thread's.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def handle(number: int, _frame: FrameType | None) -> None:
        if number == signal.SIGHUP:
            drop_terminal()
        act()

    before = {number: signal.getsignal(number) for number in SIGNALS}
    if before[signal.SIGHUP] is signal.SIG_IGN:  # nohup
        del before[signal.SIGHUP]
    for number in before:
        signal.signal(number, handle)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def raise_interrupt() -> None:
    """Raise KeyboardInterrupt, whichever signal it was."""
    raise KeyboardInterrupt


def drop_terminal() -> None:
    """Send what is still written to the terminal nowhere."""
    for number in (sys.__stdout__, sys.__stderr__):
        with suppress(OSError, AttributeError, ValueError):  # no such stream, or closed
            _redirect(number.fileno())  # type: ignore[union-attr]


def _redirect(descriptor: int) -> None:
    """Point a terminal's descriptor at the null device; files and pipes stay as they are."""
    if stat.S_ISCHR(os.fstat(descriptor).st_mode):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, descriptor)
        os.close(null)
