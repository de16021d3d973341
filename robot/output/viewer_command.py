"""Rerun's viewer as a process: the one that came with the library, heard by this machine alone."""

import os
import signal
import subprocess
from contextlib import suppress

from lemtomap.robot.child import python

LOOPBACK = "127.0.0.1"
RERUN = "import sys; from rerun_cli.__main__ import main; sys.exit(main())"  # `-m rerun_cli` forgets the code
GRACE_S = 1.0  # to close by itself

Process = subprocess.Popen[bytes]


def start_viewer(*options: str, stdin: int | None = None, quiet: bool = False) -> Process:
    """Start the viewer in a session of its own, which Ctrl-C does not reach; whatever port it opens, no other
    machine does.

    Raises OSError when it cannot be started.
    """
    said = subprocess.DEVNULL if quiet else None
    command = python("-c", RERUN, "--bind", LOOPBACK, *options)
    return subprocess.Popen(  # noqa: S603 - our own interpreter and options
        command, stdin=stdin, stdout=said, stderr=said, start_new_session=True
    )


def end_viewer(process: Process) -> None:
    """Close the viewer, its port and all it started, frozen or not."""
    for number in (signal.SIGTERM, signal.SIGKILL):
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, number)
        with suppress(subprocess.TimeoutExpired):
            process.wait(GRACE_S)
