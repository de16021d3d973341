"""A progress bar for long work: share, rate, speed against real time, time left; silent on no terminal.

Work without an end shows the time since its begin. A terminal that is gone is no error.
"""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import timedelta

from numba.core import event
from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TaskID, TextColumn, TimeRemainingColumn
from rich.text import Text

COMPILING = "compiling for this machine: about a minute, this once"


@dataclass(slots=True)
class Bar:
    """What the work tells the bar."""

    _progress: Progress
    _task: TaskID
    _unit: str

    def show(self, share: float | None, count: int = 0, speed: float | None = None) -> None:
        """Move to `share` (0..1; None: nobody knows the end) with `count` units done.

        `speed` is how many times faster than real time.
        """
        elapsed_s = self._progress.tasks[self._task].elapsed or 0.0
        rate = f"{count / elapsed_s:,.0f} {self._unit}/s" if count and elapsed_s > 0.5 else ""
        faster = f"{speed:.1f}x real time" if speed else ""
        if share is None:
            self._progress.tasks[self._task].total = None
        self._progress.update(self._task, completed=share, rate=rate, faster=faster)

    def say(self, text: str) -> None:
        """Print a line above the bar."""
        with suppress(OSError):  # nobody reads any more
            self._progress.console.print(text, highlight=False, markup=False, soft_wrap=True)


class ShareColumn(ProgressColumn):
    """How much is done, or, where nobody knows the end, since when."""

    def render(self, task: Task) -> Text:
        """Return the text of this column."""
        if task.total is None:
            return Text(str(timedelta(seconds=int(task.elapsed or 0.0))))
        return Text(f"{task.percentage:>3.0f} %")


class LeftColumn(TimeRemainingColumn):
    """How long it will take; nothing where nobody knows the end."""

    def render(self, task: Task) -> Text:
        """Return the text of this column."""
        return Text("") if task.total is None else Text.assemble(super().render(task), " left")


@contextmanager
def first_use(bar: Bar) -> Iterator[None]:
    """Say so when the body runs a kernel that must be compiled, not loaded; and then how long it took."""
    compiling = _Compiling(bar)
    with event.install_listener("numba:compile", compiling):
        yield
    if compiling.told:
        bar.say(f"compiled: {compiling.took_s:.0f} s")


class _Compiling(event.Listener):
    """Speaks up at the first kernel that is compiled, and adds up the time."""

    def __init__(self, bar: Bar) -> None:
        self.told = False
        self.took_s = 0.0
        self._bar = bar
        self._nested = 0
        self._begun_s = 0.0

    def on_start(self, event: object) -> None:  # noqa: ARG002 - numba's signature
        """Take note that a kernel is being compiled; those it calls are compiled within its time."""
        if self._nested == 0:
            self._begun_s = time.perf_counter()
        self._nested += 1
        if not self.told:
            self.told = True
            self._bar.say(COMPILING)

    def on_end(self, event: object) -> None:  # noqa: ARG002 - numba's signature
        """Take note that it is done."""
        self._nested -= 1
        if self._nested == 0:
            self.took_s += time.perf_counter() - self._begun_s


@contextmanager
def progress_bar(title: str, unit: str = "scans") -> Iterator[Bar]:
    """Show a bar on stderr while the body runs; on no terminal only the lines said are printed."""
    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=30),
        ShareColumn(),
        TextColumn("{task.fields[rate]}"),
        TextColumn("{task.fields[faster]}"),
        LeftColumn(compact=True),
    )
    shown = sys.stderr.isatty()
    with Progress(
        *columns, console=console, transient=True, disable=not shown, refresh_per_second=5
    ) as progress:
        task = progress.add_task(title, total=1.0, rate="", faster="")
        yield Bar(progress, task, unit)
