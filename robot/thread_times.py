"""CPU time of the whole process, thread by thread, so that the parts add up to it."""

import time
from collections.abc import Iterator
from contextlib import contextmanager


class ThreadTimes:
    """What the process spent: before the robot ran, in each thread while it did, and since."""

    def __init__(self) -> None:
        self._threads_s: dict[str, float] = {}
        self._begun_s = self._ended_s = 0.0

    @contextmanager
    def running(self) -> Iterator[None]:
        """Take the body for the time in which the robot runs."""
        self._begun_s = time.process_time()
        try:
            yield
        finally:
            self._ended_s = time.process_time()

    @contextmanager
    def thread(self, name: str) -> Iterator[None]:
        """Book the body, which is all that this thread does while the robot runs, under a name."""
        begun_s = time.thread_time()
        try:
            yield
        finally:
            self._threads_s[name] = time.thread_time() - begun_s

    def spent_s(self) -> dict[str, float]:
        """Return CPU seconds of the process so far by part.

        `start`: imports and the loading of kernels; `libraries`: threads that are none of ours, and what
        joins the parts. Holds: the parts add up to the CPU time of the process.
        """
        running_s = self._ended_s - self._begun_s
        return {
            "start": self._begun_s,
            **self._threads_s,
            "libraries": running_s - sum(self._threads_s.values()),
            "results": time.process_time() - self._ended_s,
        }
