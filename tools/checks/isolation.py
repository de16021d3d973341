"""One piece of work in a process of its own, with limits: what it said, how it ended, what it cost.

The process is a fork of this one, so what is loaded here needs no loading there. Linux only.
"""

import os
import resource
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

POLL_S = 0.01
KB = 1024
MB = 10**6
CRASHED = 70  # an exception that nobody caught


@dataclass(frozen=True, slots=True)
class Limits:
    """What the work may use."""

    cpu_s: float = 10.0
    wall_s: float = 60.0  # with other programs on the machine; a process that waits for ever is caught here
    memory_mb: float = 1000.0


@dataclass(frozen=True, slots=True)
class Task:
    """Work to do in a folder, which it leaves as it likes; it returns an exit code."""

    name: str
    folder: Path
    work: Callable[[], int]


@dataclass(frozen=True, slots=True)
class Outcome:
    """How it ended."""

    code: int
    """Exit code; minus the signal's number when one ended it."""
    stdout: str
    stderr: str
    cpu_s: float
    peak_mb: float
    overrun: str = ""
    """Which limit was passed, "" for none."""


@dataclass(slots=True)
class _Running:
    task: Task
    pid: int
    begun_s: float


def run_all(tasks: Iterable[Task], limits: Limits, jobs: int) -> Iterator[tuple[Task, Outcome]]:
    """Yield each task with its outcome, as they end; at most `jobs` at a time."""
    waiting, running = iter(tasks), list[_Running]()
    more = True
    while more or running:
        while more and len(running) < jobs:
            task = next(waiting, None)
            if task is None:
                more = False
            else:
                running.append(_Running(task, _fork(task, limits), time.monotonic()))
        for child in list(running):
            outcome = _ended(child, limits)
            if outcome is not None:
                running.remove(child)
                yield child.task, outcome
        time.sleep(POLL_S)


def _fork(task: Task, limits: Limits) -> int:
    """Start the work; return the process' id."""
    sys.stdout.flush()
    sys.stderr.flush()
    pid = os.fork()
    if pid:
        return pid
    code = CRASHED
    try:
        _confine(task.folder, limits)
        code = task.work()
    except BaseException:  # noqa: BLE001 - the child must never return into its parent's code
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def _confine(folder: Path, limits: Limits) -> None:
    """Take away the terminal and all that is beyond the limits."""
    os.setsid()
    for name, stream in ((".stdout", sys.stdout), (".stderr", sys.stderr)):
        target = os.open(folder / name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
        os.dup2(target, {".stdout": 1, ".stderr": 2}[name])
        os.close(target)
        stream.flush()
    os.chdir(folder)
    held = int(_status_kb("VmData") * KB)
    data = held + int(limits.memory_mb * MB)
    resource.setrlimit(resource.RLIMIT_DATA, (data, data))
    cpu = int(limits.cpu_s) + 1
    resource.setrlimit(resource.RLIMIT_CPU, (cpu, cpu + 1))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _status_kb(name: str) -> float:
    """Return one of this process' figures from /proc, kB."""
    for line in Path("/proc/self/status").read_text(encoding="ascii").splitlines():
        if line.startswith(name + ":"):
            return float(line.split()[1])
    return 0.0


def _ended(child: _Running, limits: Limits) -> Outcome | None:
    """Return the outcome if the process is over; end it when its time is up."""
    late = time.monotonic() - child.begun_s > limits.wall_s
    if late:
        os.killpg(child.pid, signal.SIGKILL)
    pid, status, used = os.wait4(child.pid, 0 if late else os.WNOHANG)
    if pid == 0:
        return None
    cpu_s, peak_mb = used.ru_utime + used.ru_stime, used.ru_maxrss * KB / MB
    code = os.waitstatus_to_exitcode(status)
    overrun = ""
    if late:
        overrun = f"still running after {limits.wall_s:g} s"
    elif cpu_s > limits.cpu_s:
        overrun = f"{cpu_s:.1f} s of CPU"
    elif peak_mb > limits.memory_mb:
        overrun = f"{peak_mb:.0f} MB of memory"
    folder = child.task.folder
    return Outcome(code, _text(folder / ".stdout"), _text(folder / ".stderr"), cpu_s, peak_mb, overrun)


def _text(path: Path) -> str:
    """Return what was written, as far as a person would read it, and take the file away."""
    if not path.exists():
        return ""
    text = path.read_bytes()[:100_000].decode(errors="replace")
    path.unlink()
    return text
