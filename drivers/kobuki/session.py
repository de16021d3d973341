"""The whole conversation with a Kobuki as a pure function of bytes and time: no port, no clock, no task."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TypeAlias

from lemtomap.drivers.clock import ClockConfig, DeviceClock
from lemtomap.drivers.identify import (
    KOBUKI,
    excerpt,
    name_device,
    name_talker,
)
from lemtomap.drivers.kobuki.battery import BatteryConfig, BatteryModel
from lemtomap.drivers.kobuki.codec import Decoder, encode
from lemtomap.drivers.kobuki.commands import (
    STOP,
    BaseControl,
    Led,
    Output,
    SetGains,
    Tune,
)
from lemtomap.drivers.kobuki.events import (
    BaseInfo,
    GainsReport,
    KobukiSample,
    LinkDown,
    LinkUp,
    PowerEvent,
    WrongDeviceSeen,
)
from lemtomap.drivers.kobuki.identity import GAINS_SINCE, AskConfig, BaseIdentity
from lemtomap.drivers.kobuki.packets import BadFrame, Feedback, Gains
from lemtomap.drivers.kobuki.panel import Panel
from lemtomap.drivers.kobuki.plausibility import PERIOD_MS, FrameGate, PlausibilityConfig
from lemtomap.drivers.kobuki.samples import EdgeEvent, edges, sample_of

KobukiEvent: TypeAlias = (
    KobukiSample
    | EdgeEvent
    | PowerEvent
    | BaseInfo
    | GainsReport
    | LinkUp
    | LinkDown
    | WrongDeviceSeen
    | BadFrame
)

_FOREIGN_LIMIT = 512  # bytes kept to name a stranger by


@dataclass(frozen=True, slots=True)
class KobukiConfig:
    """Times and limits of the conversation."""

    silence_s: float = 0.1  # kobuki_core: "not alive" without a packet for 0.1 s (five periods)
    clock_forgets_s: float = 0.5  # the base cannot boot faster
    probe_after_s: float = 1.5  # a base streams at once; what stays silent is asked whether it is a laser
    judge_after_s: float = 2.5  # ... and judged by whatever it said until then
    ask: AskConfig = field(default_factory=AskConfig)
    clock: ClockConfig = field(default_factory=lambda: ClockConfig(bits=16, latency_s=0.008))
    """81 bytes at 115200 baud take 7 ms, the FTDI's latency timer 1 ms."""
    battery: BatteryConfig = field(default_factory=BatteryConfig)
    plausibility: PlausibilityConfig = field(default_factory=PlausibilityConfig)


@dataclass(slots=True)
class KobukiCounters:
    """What became of the bytes."""

    frames: int = 0
    damaged: int = 0
    """Runs of bytes the codec refused."""
    implausible: int = 0
    """Frames with a right checksum that cannot follow the one before."""
    missed: int = 0
    """Packets that never came, by the timestamps of those around them."""


class KobukiSession:
    """One base: feed it what arrives, send what it returns.

    `receive` and `tick` may be called with any rhythm; about every 20 ms is right. Nothing here moves the
    robot but the bytes of `drive`.
    """

    def __init__(self, config: KobukiConfig | None = None) -> None:
        self.config = config or KobukiConfig()
        self.clock = DeviceClock(self.config.clock)
        self.counters = KobukiCounters()
        self.panel = Panel()
        self._battery = BatteryModel(self.config.battery)
        self.reopened()

    def reopened(self) -> None:
        """Start afresh: the port was opened again, maybe with another robot behind it."""
        self.clock.restart()
        self.identity = BaseIdentity(self.config.ask)
        self.alive = False
        self._decoder = Decoder()
        self._gate = FrameGate(self.config.plausibility)
        self._before: Feedback | None = None
        self._queue: list[KobukiEvent] = []
        self._ever_alive = False
        self._silent_s = 0.0
        self._listened_until_s: float | None = None
        self._probed = False
        self._foreign: bytearray | None = bytearray()

    def receive(self, data: bytes, now_s: float) -> list[KobukiEvent]:
        """Take bytes that arrived until now; return what they tell, after what `tick` found out before."""
        events, self._queue = self._queue, []
        frames = self._decoder.feed(data)
        if self.clock.fresh:
            stamps = [frame.basic.timestamp_ms for frame in frames if isinstance(frame, Feedback)]
            if stamps:
                self.clock.begin(stamps[0], stamps[-1], now_s)
        for frame in frames:
            if isinstance(frame, BadFrame):
                self.counters.damaged += 1
                events.append(frame)
            else:
                self._accept(frame, now_s, events)
        if not self._ever_alive:
            self._suspect(data, events)
        return events

    def tick(self, now_s: float) -> bytes:
        """Return the requests to send now, and watch for silence."""
        config = self.config
        if self._listened_until_s is not None:  # a host that slept did not listen: count one silence at most
            self._silent_s += min(now_s - self._listened_until_s, config.silence_s)
        self._listened_until_s = now_s
        if self.alive and self._silent_s > config.silence_s:
            self.alive = False
            self._queue.append(LinkDown(now_s, f"no packet from the base for {self._silent_s:.2f} s"))
        if self._silent_s > config.clock_forgets_s:
            self.clock.restart()
            self._gate.restart()
        if not self._ever_alive and not self._probed and self._silent_s > config.probe_after_s:
            self._probed = True
            self._queue.append(LinkDown(now_s, "nothing from the base: is it switched on?"))
            return b"\nQT\n"  # means nothing to a base that wakes up late; a laser answers, and can be named
        if self._foreign and self._silent_s > config.judge_after_s:
            self._name(name_talker(bytes(self._foreign)), self._queue)
        return self.identity.requests(now_s) if self.alive else b""

    def drive(self, v_mps: float, w_radps: float) -> bytes:
        """Return the velocity command (raises ValueError if not finite); repeat it every 20 ms."""
        return encode(BaseControl.from_twist(v_mps, w_radps))

    def stop_bytes(self) -> bytes:
        """Return the stop command."""
        return encode(STOP)

    def close_bytes(self) -> bytes:
        """Return the last bytes a base should get: a stop."""
        return self.stop_bytes()

    def sound(self, tune: Tune) -> bytes:
        """Return the command that plays a tune of the firmware."""
        return self.panel.sound(tune)

    def melody(self, tones: Iterable[tuple[float, float]]) -> list[bytes]:
        """Return a command for each (frequency in Hz, duration in s, at most 0.255)."""
        return self.panel.melody(tones)

    def led(self, number: int, colour: Led) -> bytes:
        """Return the command that sets LED 1 or 2."""
        return self.panel.led(number, colour)

    def digital_output(self, number: int, *, on: bool) -> bytes:
        """Return the command that sets open-drain output 0 to 3."""
        return self.panel.digital_output(number, on=on)

    def external_power(self, rail: Output, *, on: bool) -> bytes:
        """Return the command that switches a power rail."""
        return self.panel.external_power(rail, on=on)

    def set_gains(self, gains: Gains) -> bytes:
        """Return the command that sets the wheel controller's gains; a GainsReport tells what the base took.

        Raises ValueError for negative gains, or when the firmware is known to be too old.
        """
        if min(gains.p, gains.i, gains.d) < 0.0 or max(gains.p, gains.i, gains.d) > 0xFFFFFFFF / 1000:
            raise ValueError(f"gains must lie between 0 and 4294967: {gains}")
        if self.identity.firmware is not None and not self.identity.has_gains:
            raise ValueError(f"gains need firmware {GAINS_SINCE}, this base has {self.identity.firmware}")
        self.identity.ask_gains_again()
        return encode(SetGains(gains))

    def _accept(self, frame: Feedback, now_s: float, events: list[KobukiEvent]) -> None:
        reason = self._gate.check(frame)
        stamp_s = None if reason else self.clock.map(frame.basic.timestamp_ms, now_s)
        if stamp_s is None:
            self.counters.implausible += 1
            events.append(BadFrame(b"", f"implausible: {reason or 'the timestamp does not fit the clock'}"))
            return
        self.counters.frames += 1
        self._silent_s, self._listened_until_s = 0.0, now_s
        if not self.alive:
            self.alive = self._ever_alive = True
            self._foreign = None
            events.append(LinkUp(now_s))
        self._count_missed(frame)
        events.extend(self.identity.take(frame))
        battery, changes = self._battery.update(0.1 * frame.basic.battery_dv, frame.basic.charger, stamp_s)
        events.append(sample_of(frame, stamp_s, now_s, battery))
        events.extend(edges(self._before, frame, stamp_s))
        events.extend(PowerEvent(stamp_s, change, battery) for change in changes)
        self._before = frame

    def _count_missed(self, frame: Feedback) -> None:
        if self._before is not None:
            elapsed_ms = (frame.basic.timestamp_ms - self._before.basic.timestamp_ms) & 0xFFFF
            self.counters.missed += max(0, round(elapsed_ms / PERIOD_MS) - 1)

    def _suspect(self, data: bytes, events: list[KobukiEvent]) -> None:
        """Name whoever sends bytes that are no frames, once."""
        if self._foreign is None:
            return
        self._foreign += data[: _FOREIGN_LIMIT - len(self._foreign)]
        self._name(name_device(bytes(self._foreign)), events)

    def _name(self, name: str | None, events: list[KobukiEvent]) -> None:
        """Tell of a stranger by its name and what it sent."""
        if name is None or name == KOBUKI or self._foreign is None:
            return
        text = f"not a Kobuki base but {name} answers, it sent {excerpt(bytes(self._foreign))}"
        events.append(WrongDeviceSeen(text))
        self._foreign = None
