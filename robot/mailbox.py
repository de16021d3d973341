"""How threads hand things over: the latest of a kind, or a bounded queue that counts what it drops.

What is put in must be immutable. Putting never waits for a reader.
"""

import threading
from collections import deque
from typing import Generic, TypeVar

T = TypeVar("T")


class Latest(Generic[T]):
    """One slot: a reader gets the newest value, however slow it is."""

    def __init__(self) -> None:
        self._condition = threading.Condition()
        self._value: T | None = None
        self._version = 0

    @property
    def version(self) -> int:
        """How many values were put in so far."""
        return self._version

    def put(self, value: T) -> None:
        """Replace the value and wake who waits."""
        with self._condition:
            self._value = value
            self._version += 1
            self._condition.notify_all()

    def get(self) -> T | None:
        """Return the newest value, None before the first."""
        return self._value

    def wait(self, after_version: int, timeout_s: float) -> tuple[T | None, int]:
        """Wait for a value newer than `after_version`; return the newest and its version, changed or not."""
        with self._condition:
            self._condition.wait_for(lambda: self._version > after_version, timeout_s)
            return self._value, self._version


class BoundedQueue(Generic[T]):
    """First in, first out; when full the oldest goes, and is counted."""

    def __init__(self, name: str, capacity: int) -> None:
        self.name = name
        self.dropped = 0
        """How many values no reader ever got."""
        self._items: deque[T] = deque()
        self._capacity = capacity
        self._condition = threading.Condition()

    def put(self, value: T) -> None:
        """Append a value; drop the oldest when there is no room."""
        with self._condition:
            if len(self._items) >= self._capacity:
                self._items.popleft()
                self.dropped += 1
            self._items.append(value)
            self._condition.notify()

    def get(self, timeout_s: float = 0.0) -> T | None:
        """Return the oldest value, waiting for one up to `timeout_s`; None when there is none."""
        with self._condition:
            if timeout_s > 0.0:
                self._condition.wait_for(lambda: bool(self._items), timeout_s)
            return self._items.popleft() if self._items else None

    def drain(self) -> list[T]:
        """Return everything that waits, oldest first."""
        with self._condition:
            items = list(self._items)
            self._items.clear()
        return items

    def __len__(self) -> int:
        return len(self._items)
