"""Keeps one device talking: opens its port, feeds its session, reopens after an unplug, stops it at the
end.
"""

import asyncio
import contextlib
import signal
from collections.abc import Awaitable, Callable, Iterator
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

from lemtomap.drivers.errors import (
    DriverError,
    PortClosed,
    PortError,
    WrongDevice,
)
from lemtomap.drivers.identify import WrongDeviceSeen
from lemtomap.drivers.port import BytePort

E = TypeVar("E")


class Session(Protocol[E]):
    """A conversation as a pure function of bytes and time."""

    @property
    def alive(self) -> bool:
        """Return True if the right device answers."""
        ...

    def receive(self, data: bytes, now_s: float) -> list[E]:
        """Take bytes, return what they tell."""
        ...

    def tick(self, now_s: float) -> bytes:
        """Return what to send now."""
        ...

    def reopened(self) -> None:
        """Begin afresh on a newly opened port."""
        ...

    def close_bytes(self) -> bytes:
        """Return the last bytes the device should get."""
        ...


@dataclass(frozen=True, slots=True)
class PortOpened:
    """The port is open; the conversation begins."""

    stamp_s: float


@dataclass(frozen=True, slots=True)
class PortLost:
    """The port went away, or cannot be opened; the driver goes on trying."""

    stamp_s: float
    error: DriverError


@dataclass(frozen=True, slots=True)
class DriverConfig:
    """How a driver waits."""

    tick_s: float = 0.02
    """Between two ticks while the device is not there yet: each step of connecting waits for one."""
    watch_s: float = 0.05
    """The same while it is there and every packet ticks anyway: this only notices silence."""
    first_wait_s: float = 0.1
    """Before the first attempt to reopen; each further one waits twice as long."""
    longest_wait_s: float = 0.8  # data must flow within 3 s of a replug, and a laser takes 1 s to connect
    insist: bool = True
    """True: the very first opening must succeed and find the right device, else `run` raises."""


class Driver(Generic[E]):
    """One device. `run` lives until it is cancelled; whatever ends it, the device's last bytes are a stop."""

    def __init__(
        self,
        open_port: Callable[[], Awaitable[BytePort]],
        session: Session[E],
        clock: Callable[[], float],
        on_event: Callable[[E | PortOpened | PortLost], None],
        config: DriverConfig | None = None,
    ) -> None:
        self.config = config or DriverConfig()
        self._open_port = open_port
        self._session = session
        self._clock = clock
        self._on_event = on_event
        self._port: BytePort | None = None
        self._insist = self.config.insist
        self._complaint = ""

    @property
    def is_open(self) -> bool:
        """Return True if bytes can be sent."""
        return self._port is not None

    def write(self, data: bytes) -> bool:
        """Send a command now; False when there is no port to send it to. Never waits, never raises."""
        if self._port is None or not data:
            return False
        try:
            self._port.write(data)
        except PortError:  # the reader finds the same, and reopens
            return False
        return True

    async def run(self) -> None:
        """Open, converse, reopen, for ever.

        Raises PortError or WrongDevice when the first opening fails and `insist` is set; what `on_event`
        raises ends it too.
        """
        wait_s = self.config.first_wait_s
        while True:
            opened_s = self._clock()
            try:
                await self._converse(await self._open_port())
            except (PortError, WrongDevice) as error:
                if self._insist or isinstance(error, PortClosed):
                    raise
                self._complain(error)
            if self._clock() - opened_s > 2.0 * self.config.longest_wait_s:  # it had worked: try again soon
                wait_s = self.config.first_wait_s
            await asyncio.sleep(wait_s)
            wait_s = min(2.0 * wait_s, self.config.longest_wait_s)

    async def _converse(self, port: BytePort) -> None:
        """Talk until the port breaks. Raises PortError, WrongDevice."""
        self._session.reopened()
        self._port = port
        self._complaint = ""
        self._on_event(PortOpened(self._clock()))
        reading = asyncio.create_task(self._read(port))
        try:
            while not reading.done():
                self._take(b"")
                wait_s = self.config.watch_s if self._session.alive else self.config.tick_s
                await asyncio.wait({reading}, timeout=wait_s)
            reading.result()
        finally:
            self._port = None
            reading.cancel()
            with contextlib.suppress(PortError):
                port.write(self._session.close_bytes())
            with contextlib.suppress(asyncio.CancelledError, Exception):
                await reading
            await port.aclose()

    async def _read(self, port: BytePort) -> None:
        while True:
            self._take(await port.read())

    def _take(self, data: bytes) -> None:
        now_s = self._clock()
        for event in self._session.receive(data, now_s):
            if isinstance(event, WrongDeviceSeen):
                self._on_event(event)
                where = getattr(self._port, "path", "")  # a real port has one, others need not
                raise WrongDevice(f"{where}: {event.reason}" if where else event.reason)
            self._on_event(event)
        self._insist = self._insist and not self._session.alive
        self.write(self._session.tick(now_s))

    def _complain(self, error: DriverError) -> None:
        if str(error) != self._complaint:
            self._complaint = str(error)
            self._on_event(PortLost(self._clock(), error))


@contextlib.contextmanager
def cancelled_by_signals(task: "asyncio.Task[Any]") -> Iterator[None]:
    """Cancel a task on SIGTERM and SIGINT, so that its `finally` blocks stop the devices. Main thread
    only.
    """
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, task.cancel)
    try:
        yield
    finally:
        for number in (signal.SIGTERM, signal.SIGINT):
            loop.remove_signal_handler(number)
