"""The whole conversation with a SCIP laser as a pure function of bytes and time: no port, no clock, no
task.
"""

from dataclasses import dataclass, field
from typing import TypeAlias

from lemtomap.drivers.clock import ClockConfig, DeviceClock
from lemtomap.drivers.hokuyo import commands
from lemtomap.drivers.hokuyo.codec import Decoder, Reply
from lemtomap.drivers.hokuyo.connect import Connection
from lemtomap.drivers.hokuyo.events import (
    LaserDown,
    LaserFault,
    LaserScan,
    LaserUp,
    LaserWell,
    SensorInfo,
    WrongDeviceSeen,
)
from lemtomap.drivers.hokuyo.packets import (
    CHECKED_NORMAL,
    STAMP_BITS,
    BadReply,
    Info,
    ScanFrame,
    Status,
    explain_status,
    is_checking,
    is_trouble,
)
from lemtomap.drivers.hokuyo.scans import ScanMaker, View
from lemtomap.drivers.hokuyo.steps import HandshakeStep
from lemtomap.drivers.identify import (
    HOKUYO,
    excerpt,
    name_device,
    name_talker,
)

HokuyoEvent: TypeAlias = (
    LaserScan | SensorInfo | LaserFault | LaserWell | LaserUp | LaserDown | WrongDeviceSeen | BadReply
)

_FOREIGN_LIMIT = 6000  # bytes kept to name a stranger by: longer than any scan somebody left streaming


@dataclass(frozen=True, slots=True)
class HokuyoConfig:
    """Times and limits of the conversation."""

    view: View = field(default_factory=View)
    clock: ClockConfig = field(default_factory=lambda: ClockConfig(STAMP_BITS, latency_s=0.1))
    """Latency without time adjustment: step 768 is passed 75 ms after the stamp, sending takes the rest."""
    time_readings: int = 9  # each narrows the offset; 2 ms apart over USB
    silence_s: float = 0.6
    """Without a scan for this long and five scan periods, the stream is started anew."""
    checking_s: float = 5.0  # a sensor that checks an error (status 21 to 49) gets this long
    first_rest_s: float = 0.5  # urg_node retries every 0.5 s
    longest_rest_s: float = 2.0


@dataclass(slots=True)
class HokuyoCounters:
    """What became of the bytes."""

    scans: int = 0
    partial: int = 0
    """Scans of which some lines failed their checks."""
    damaged: int = 0
    """Runs of bytes the codec refused."""
    implausible: int = 0
    """Scans with right sums whose stamp or echo cannot be right."""
    missed: int = 0
    """Scans that never came, by the stamps of those around them."""
    restarts: int = 0


class HokuyoSession:
    """One laser: feed it what arrives, send what `tick` returns. About every 20 ms is right."""

    def __init__(self, config: HokuyoConfig | None = None) -> None:
        self.config = config or HokuyoConfig()
        self.clock = DeviceClock(self.config.clock)
        self.counters = HokuyoCounters()
        self.reopened()

    def reopened(self) -> None:
        """Start afresh: the port was opened again, maybe with another sensor behind it."""
        self.clock.restart()
        self.info: SensorInfo | None = None
        self.alive = False
        self._decoder = Decoder()
        self._queue: list[HokuyoEvent] = []
        self._foreign: bytearray | None = bytearray()
        self._stranger = False
        self._failures = 0
        self._fault = ""
        self._rest_until_s = float("-inf")
        self._listened_until_s: float | None = None
        self._connection = self._new_connection(None, ask_version=True)
        self._listen_afresh()

    def _new_connection(self, version: Info | None, *, ask_version: bool) -> Connection:
        return Connection(self.config.view, self.config.time_readings, version, ask_version=ask_version)

    def _listen_afresh(self) -> None:
        self._silent_s = 0.0
        self._checking = False
        self._last_stamp: int | None = None

    @property
    def step(self) -> HandshakeStep:
        """Where the conversation is."""
        return self._connection.step

    def receive(self, data: bytes, now_s: float) -> list[HokuyoEvent]:
        """Take bytes that arrived until now; return what they tell, after what `tick` found out before."""
        events, self._queue = self._queue, []
        replies = self._decoder.feed(data)
        self._suspect(data, replies, events)
        for reply in replies:
            if isinstance(reply, BadReply):
                self.counters.damaged += 1
                events.append(reply)
            elif self.step is not HandshakeStep.STREAM:
                self._connect(reply, now_s, events)
            if self.step is HandshakeStep.STREAM and isinstance(reply, ScanFrame):
                self._take_scan(reply, now_s, events)
            elif self.step is HandshakeStep.STREAM and isinstance(reply, Status):
                self._take_status(reply, now_s, events)
        return events

    def tick(self, now_s: float) -> bytes:
        """Return what to send now, and watch for answers and scans that do not come."""
        listened_s = 0.0 if self._listened_until_s is None else now_s - self._listened_until_s
        self._listened_until_s = now_s
        if self._stranger or now_s < self._rest_until_s:
            return b""
        if self.step is HandshakeStep.STREAM:
            self._silent_s += min(listened_s, 0.1)  # a host that slept did not listen
            if self._silent_s > self._patience_s():
                self._break_off(now_s, f"no scan for {self._silent_s:.1f} s", self._queue)
        command = self._connection.command(now_s)
        if self.step is HandshakeStep.FAILED:
            self._rest(now_s, self._queue)
        return command

    def close_bytes(self) -> bytes:
        """Return what stops the stream and the laser: the last bytes a sensor should get."""
        return commands.QUIT

    def _connect(self, reply: Reply, now_s: float, events: list[HokuyoEvent]) -> None:
        connection = self._connection
        connection.answer(reply, now_s)
        if connection.info is not None and connection.info is not self.info:
            self.info = connection.info
            events.append(self.info)
            if not self.info.healthy:
                self._report(now_s, f"the laser says of itself: {self.info.state['STAT']}", "", events)
        if self.step is HandshakeStep.STREAM:
            self._listen_afresh()
            if connection.sync.count and not self.alive:
                self.clock.anchor(connection.sync.first_raw, connection.sync.offset_s, now_s)
        elif self.step is HandshakeStep.FAILED:
            self._rest(now_s, events)

    def _take_scan(self, frame: ScanFrame, now_s: float, events: list[HokuyoEvent]) -> None:
        maker = self._connection.maker
        step0_s = self.clock.map(frame.stamp_ms, now_s) if maker.answers_request(frame) else None
        if step0_s is None:
            self.counters.implausible += 1
            return
        missed = self._count(frame, maker)
        self._silent_s, self._listened_until_s = 0.0, now_s
        self._checking = False
        if not self.alive:
            self.alive = True
            self._failures = 0
            events.append(LaserUp(now_s, clock_synchronised=self._connection.sync.count > 0))
            self._all_well(now_s, events)
        events.append(maker.make(frame, step0_s, now_s, missed))
        if maker.request.count and frame.remaining == 0:
            self._connection.rearm()

    def _count(self, frame: ScanFrame, maker: ScanMaker) -> int:
        missed = 0
        if self._last_stamp is not None:
            elapsed_ms = (frame.stamp_ms - self._last_stamp) % (1 << STAMP_BITS)
            missed = max(0, round(elapsed_ms / (1000.0 * maker.period_s)) - 1)
        self._last_stamp = frame.stamp_ms
        self.counters.scans += 1
        self.counters.partial += not frame.intact
        self.counters.missed += missed
        return missed

    def _take_status(self, reply: Status, now_s: float, events: list[HokuyoEvent]) -> None:
        if not reply.command.startswith("M"):
            return
        if is_checking(reply.status):
            self._checking = True
            self._report(now_s, explain_status(reply.status), reply.status, events)
        elif reply.status == CHECKED_NORMAL:
            self._checking = False
            self._all_well(now_s, events)
        elif is_trouble(reply.status):
            reason = f"{explain_status(reply.status)}: is the window clean, does the motor turn?"
            self._report(now_s, reason, reply.status, events)
            self._break_off(now_s, reason, events)
            self._rest(now_s, events)

    def _patience_s(self) -> float:
        if self._checking:
            return self.config.checking_s
        return max(self.config.silence_s, 5.0 * self._connection.maker.period_s)

    def _break_off(self, now_s: float, reason: str, events: list[HokuyoEvent]) -> None:
        """Begin again from the first step, without another VV."""
        if self.alive:
            events.append(LaserDown(now_s, reason))
        self.alive = False
        self.counters.restarts += 1
        self._connection = self._new_connection(self._connection.version, ask_version=False)
        self._listen_afresh()

    def _rest(self, now_s: float, events: list[HokuyoEvent]) -> None:
        """Wait before the next attempt, longer after each that failed."""
        connection = self._connection
        if self._foreign and self._name(name_talker(bytes(self._foreign), _FOREIGN_LIMIT), events):
            return
        if connection.failure:
            self._report(now_s, connection.failure, connection.failure_code, events)
        wait_s = min(self.config.longest_rest_s, self.config.first_rest_s * 2.0**self._failures)
        self._failures += 1
        self._rest_until_s = now_s + wait_s
        self._break_off(now_s, connection.failure, events)

    def _report(self, now_s: float, reason: str, code: str, events: list[HokuyoEvent]) -> None:
        if reason != self._fault:
            self._fault = reason
            events.append(LaserFault(now_s, reason, code))

    def _all_well(self, now_s: float, events: list[HokuyoEvent]) -> None:
        if self._fault:
            self._fault = ""
            events.append(LaserWell(now_s))

    def _suspect(self, data: bytes, replies: list[Reply], events: list[HokuyoEvent]) -> None:
        """Name whoever sends bytes that are no replies, once."""
        if any(not isinstance(reply, BadReply) for reply in replies):
            self._foreign = None
        if self._foreign is None:
            return
        self._foreign += data[: _FOREIGN_LIMIT - len(self._foreign)]
        self._name(name_device(bytes(self._foreign), _FOREIGN_LIMIT), events)

    def _name(self, name: str | None, events: list[HokuyoEvent]) -> bool:
        """Tell of a stranger by its name and what it sent; return True if there is one."""
        if name is None or name == HOKUYO or self._foreign is None:
            return False
        text = f"not a laser but {name} answers, it sent {excerpt(bytes(self._foreign))}"
        events.append(WrongDeviceSeen(text))
        self._foreign, self._stranger = None, True
        return True
