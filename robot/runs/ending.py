"""The end of a run, step by step: each step runs whatever became of the others, and none for ever."""

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")


class Ending:
    """Runs steps, tells which went wrong and goes on."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self.failed: list[str] = []
        """What went wrong, a line each."""

    def step(self, what: str, limit_s: float, work: Callable[[], T]) -> T | None:
        """Do one step within its time and return its result; None when it failed, which is told."""
        attempt = _Attempt(work)
        attempt.start()
        attempt.join(limit_s)
        if attempt.is_alive():
            self._fail(f"{what}: not done after {limit_s:g} s, left as it is")
        elif attempt.error is not None:
            self._fail(f"{what}: {reason_of(attempt.error)}")
        return attempt.result

    def _fail(self, line: str) -> None:
        self.failed.append(line)
        self._say(line)


class _Attempt(threading.Thread, Generic[T]):
    """Work in a thread of its own, so that it can be left behind; it never keeps the program from ending."""

    def __init__(self, work: Callable[[], T]) -> None:
        super().__init__(daemon=True)
        self._work = work
        self.result: T | None = None
        self.error: BaseException | None = None

    def run(self) -> None:
        """Do the work; an error is kept for whoever waits."""
        try:
            self.result = self._work()
        except BaseException as error:  # noqa: BLE001 - told by whoever waits
            self.error = error


def reason_of(error: BaseException) -> str:
    """Return an error in one line."""
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    return " ".join(str(error).split()) or type(error).__name__
