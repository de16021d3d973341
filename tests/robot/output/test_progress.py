"""What a person is told while they wait."""

import numba
import pytest
from numba.core import event

from lemtomap.robot.output.progress import COMPILING, first_use


class Said:
    """A bar that keeps what it is told to say."""

    def __init__(self):
        self.lines = []

    def say(self, text):
        self.lines.append(text)


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled here")
def test_compiling_is_told_once_with_its_time_when_something_is_compiled():
    bar = Said()
    with first_use(bar):
        for step in (1, 2):
            numba.njit(lambda x, step=step: x + step)(1.0)
    assert bar.lines[0] == COMPILING
    assert [line for line in bar.lines if line.startswith("compiled: ")] == bar.lines[1:]
    assert len(bar.lines) == 2


def test_compiling_is_not_told_however_long_it_takes_when_nothing_is_compiled():
    bar = Said()
    with first_use(bar):
        sum(range(10**6))
    assert bar.lines == []


def test_the_time_of_kernels_within_kernels_counts_once(monkeypatch):
    bar, now = Said(), iter([0.0, 30.0])
    monkeypatch.setattr("lemtomap.robot.output.progress.time.perf_counter", lambda: next(now))
    with first_use(bar), event.trigger_event("numba:compile"), event.trigger_event("numba:compile"):
        pass
    assert bar.lines == [COMPILING, "compiled: 30 s"]
