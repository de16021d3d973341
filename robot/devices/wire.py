"""Recorded sessions, and one device of a world that is stepped: port, session and record in one."""

from collections.abc import Callable
from typing import Generic, Protocol, TypeVar

from lemtomap.drivers.hokuyo.session import HokuyoConfig, HokuyoEvent, HokuyoSession
from lemtomap.drivers.kobuki.session import KobukiConfig, KobukiEvent, KobukiSession
from lemtomap.robot.clock import stamp_ns
from lemtomap.robot.devices.recording import (
    HOKUYO,
    KOBUKI,
    LOST,
    OPENED,
    UP,
    Call,
    RecordedCall,
)

E = TypeVar("E")

Sink = Callable[[RecordedCall], None]


class RecordedSession(Protocol[E]):
    """What both devices' sessions share."""

    def receive(self, data: bytes, now_s: float) -> list[E]:
        """Take bytes, return events."""
        ...

    def tick(self, now_s: float) -> bytes:
        """Return the bytes to send now."""
        ...

    def reopened(self) -> None:
        """Begin anew after the port was opened again."""
        ...


class RecordedKobukiSession(KobukiSession):
    """Writes down every call that changes what comes out."""

    def __init__(self, record: Sink, config: KobukiConfig | None = None) -> None:
        self._record = record
        super().__init__(config)

    def receive(self, data: bytes, now_s: float) -> list[KobukiEvent]:
        """Take bytes, return events."""
        events = super().receive(data, now_s)
        if data or events:
            self._record(RecordedCall(KOBUKI, Call.RECEIVE, stamp_ns(now_s), data))
        return events

    def tick(self, now_s: float) -> bytes:
        """Return the bytes to send now."""
        self._record(RecordedCall(KOBUKI, Call.TICK, stamp_ns(now_s)))
        return super().tick(now_s)


class RecordedHokuyoSession(HokuyoSession):
    """Writes down every call that changes what comes out, and when the laser began to stream."""

    def __init__(self, record: Sink, config: HokuyoConfig | None = None) -> None:
        self._record = record
        super().__init__(config)

    def reopened(self) -> None:
        """Begin anew after the port was opened again."""
        super().reopened()
        self._streams = False

    def receive(self, data: bytes, now_s: float) -> list[HokuyoEvent]:
        """Take bytes, return events."""
        events = super().receive(data, now_s)
        if data or events:
            self._record(RecordedCall(HOKUYO, Call.RECEIVE, stamp_ns(now_s), data))
        if self.alive and not self._streams:
            self._streams = True
            self._record(RecordedCall(HOKUYO, Call.PORT, stamp_ns(now_s), UP))
        return events

    def tick(self, now_s: float) -> bytes:
        """Return the bytes to send now."""
        self._record(RecordedCall(HOKUYO, Call.TICK, stamp_ns(now_s)))
        return super().tick(now_s)


class SteppedPort(Protocol):
    """The host's end of an in-memory cable."""

    def read(self) -> bytes:
        """Return everything that has arrived."""
        ...

    def write(self, data: bytes) -> None:
        """Send."""
        ...


class Wire(Generic[E]):
    """One device in lock-step. An unplugged cable is noticed, and its session begins anew when it is back."""

    def __init__(
        self, name: str, port: SteppedPort, session: RecordedSession[E], record: Sink, broken: type[Exception]
    ) -> None:
        self.name, self.session = name, session
        self._port, self._record, self._broken = port, record, broken
        self._open = True
        self.lost: tuple[str, ...] = ()
        """This device's name when the last poll found its cable out."""

    def poll(self, now_s: float) -> list[E]:
        """Read, ask the session what it wants to send, send it; return what the device told."""
        try:
            data = self._port.read()
        except self._broken:
            if self._open:
                self._open = False
                self._record(RecordedCall(self.name, Call.PORT, stamp_ns(now_s), LOST))
            data, self.lost = b"", (self.name,)
        else:
            self.lost = ()
            if not self._open:
                self._open = True
                self.session.reopened()
                self._record(RecordedCall(self.name, Call.PORT, stamp_ns(now_s), OPENED))
        events = self.session.receive(data, now_s)
        self.write(self.session.tick(now_s), now_s)
        return events

    def write(self, data: bytes, now_s: float) -> None:
        """Send, unless the cable is out."""
        if not data or not self._open:
            return
        try:
            self._port.write(data)
        except self._broken:
            return
        self._record(RecordedCall(self.name, Call.SEND, stamp_ns(now_s), data))
