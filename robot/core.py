"""The whole robot as one synchronous object: `step(samples, now_s) -> commands`.

It is made of three steps that share nothing but the mailboxes of the Exchange: base (every 20 ms), mapping
(every scan) and navigation (every 100 ms). The lock-step runner calls `step`; the threaded runtime calls each
of the three in a thread of its own. Nothing about behaviour lives in either of them.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

from lemtomap.drivers.hokuyo.session import HokuyoEvent
from lemtomap.drivers.kobuki.session import KobukiEvent
from lemtomap.robot.base import BaseStep, Commands
from lemtomap.robot.config import DevicesConfig
from lemtomap.robot.exchange import Exchange, TimedScan
from lemtomap.robot.mapping import MappingStep
from lemtomap.robot.navigating import NavigationStep
from lemtomap.robot.thread_times import ThreadTimes


@dataclass(frozen=True, slots=True)
class Samples:
    """What the devices told since the last step."""

    base: Sequence[KobukiEvent] = ()
    laser: Sequence[HokuyoEvent] = ()
    lost: Sequence[str] = ()
    """Devices whose port went away ("kobuki", "hokuyo"): what they told last is no evidence any more."""


@dataclass(slots=True)
class Effort:
    """CPU time of one part: how often, how much, and how long the worst took."""

    calls: int = 0
    cpu_s: float = 0.0
    worst_s: float = 0.0
    last_s: float = 0.0


@dataclass(slots=True)
class Efforts:
    """CPU time of each part, by the clock of the thread that ran it. Reported, never acted on."""

    base: Effort = field(default_factory=Effort)
    mapping: Effort = field(default_factory=Effort)
    navigation: Effort = field(default_factory=Effort)
    threads: ThreadTimes = field(default_factory=ThreadTimes)


class RobotCore:
    """The robot between its drivers and its user."""

    def __init__(
        self,
        exchange: Exchange,
        base: BaseStep,
        mapping: MappingStep,
        navigation: NavigationStep,
        devices: DevicesConfig | None = None,
    ) -> None:
        self.exchange = exchange
        self.devices = devices or DevicesConfig()
        """How whoever brings the samples talks to the devices."""
        self.base, self.mapping, self.navigation = base, mapping, navigation
        self.efforts = Efforts()
        self._navigate_at_s = 0.0

    def step(self, samples: Samples, now_s: float) -> Commands:
        """Run everything that is due, in the order in which data flows."""
        self.take(samples, now_s)
        while self.map_one(0.0):
            pass
        if now_s >= self._navigate_at_s - 1e-6:
            self._navigate_at_s = now_s + self.navigation.navigator.config.period_s
            self.navigate(now_s)
        return self.command(now_s)

    def take(self, samples: Samples, now_s: float) -> None:
        """Base: take what the devices told."""
        _timed(self.efforts.base, lambda: self._take(samples, now_s))

    def _take(self, samples: Samples, now_s: float) -> None:
        for device in samples.lost:
            self.base.lost(device)
        self.base.take(samples.base, samples.laser, now_s)

    def command(self, now_s: float) -> Commands:
        """Base: return what to send now."""
        return _timed(self.efforts.base, lambda: self.base.command(now_s))

    def map_one(self, timeout_s: float) -> bool:
        """Mapping: take one scan if there is one within the time; return True if there was."""
        timed = self.exchange.scans.get(timeout_s)
        if timed is not None:
            self.map(timed)
        return timed is not None

    def map(self, timed: TimedScan) -> None:
        """Mapping: take this scan."""
        _timed(self.efforts.mapping, lambda: self.mapping.step(timed))
        self.exchange.mapped.put(timed.scan.stamp_s)

    def navigate(self, now_s: float) -> None:
        """Navigation: run one cycle."""
        self.exchange.cycle.put(now_s)
        _timed(self.efforts.navigation, lambda: self.navigation.step(now_s))

    def permit(self) -> None:
        """Let the robot move from now on."""
        self.base.gate.permit()

    def halt(self) -> None:
        """Let nothing move any more."""
        self.base.gate.revoke()

    def close(self) -> None:
        """Write the map and close its file."""
        try:
            self.navigation.close()
        finally:
            self.mapping.close()


T = TypeVar("T")


def _timed(effort: Effort, work: Callable[[], T]) -> T:
    begun = time.thread_time()
    try:
        return work()
    finally:
        effort.last_s = time.thread_time() - begun
        effort.calls += 1
        effort.cpu_s += effort.last_s
        effort.worst_s = max(effort.worst_s, effort.last_s)
