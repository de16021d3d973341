"""A recorded run once more: the same bytes through the same sessions give the same samples, bit for bit.

With the settings of the run the same scans are mapped, after the same events of navigation: then the map is
the same, too, up to the first missing byte. With others every scan is mapped and navigation is silent.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace

from lemtomap.drivers.hokuyo.session import HokuyoSession
from lemtomap.drivers.kobuki.session import KobukiSession
from lemtomap.robot.config import DevicesConfig
from lemtomap.robot.core import RobotCore, Samples
from lemtomap.robot.devices.recorded import Gap, Recording
from lemtomap.robot.devices.recording import (
    KOBUKI,
    LOST,
    OPENED,
    Call,
    RecordedCall,
)
from lemtomap.robot.devices.wire import E, RecordedSession
from lemtomap.robot.exchange import TimedScan

BRIDGED_S = 4.0  # the encoders count 65,536 ticks, 5.6 m: after longer they may have gone round unseen


def replay_events(
    recording: Recording, devices: DevicesConfig | None = None
) -> Iterator[tuple[float, Samples | Gap]]:
    """Yield (clock value, events) of each recorded call that told something, and the gaps between them."""
    devices = devices or DevicesConfig()
    base, laser = KobukiSession(devices.kobuki), HokuyoSession(devices.hokuyo)
    for entry in recording.entries():
        if isinstance(entry, Gap):
            yield entry.from_s, entry
            continue
        lost = (entry.device,) if entry.call is Call.PORT and entry.data == LOST else ()
        if entry.device == KOBUKI:
            told = Samples(base=_repeat(entry, base), lost=lost)
        else:
            told = Samples(laser=_repeat(entry, laser), lost=lost)
        if told.base or told.laser or told.lost:
            yield entry.now_s, told


def replay_map(
    recording: Recording, core: RobotCore, watch: Callable[[float], None] | None = None, *, as_then: bool
) -> float:
    """Map a recorded run anew, with whatever settings `core` has; return the clock value of its end.

    Nothing is driven: the recorded robot went where it went. `as_then`: the settings are those of the run.
    """
    now_s = 0.0
    mapped = _MappedThen(recording) if as_then else None
    for now_s, told in replay_events(recording, core.devices):
        if isinstance(told, Gap):
            mapped = None
            if told.until_s is not None and told.until_s - told.from_s > BRIDGED_S:
                gap_s = told.until_s - told.from_s
                core.mapping.interrupt(told.from_s, f"nothing is recorded of the next {gap_s:.0f} s")
            continue
        core.take(told, now_s)
        while (timed := core.exchange.scans.get()) is not None:
            timed = timed if mapped is None else mapped.prepare(timed, core)
            if timed is not None:
                core.map(timed)
        if watch is not None:
            watch(now_s)
    return now_s


class _MappedThen:
    """Which scans were mapped, and what navigation told in between."""

    def __init__(self, recording: Recording) -> None:
        self._scans = recording.scans()
        self._next = next(self._scans, None)
        self._known = self._next is not None  # recordings made before 1.0 tell nothing of it
        self._ends = recording.whole

    def prepare(self, timed: TimedScan, core: RobotCore) -> TimedScan | None:
        """Return the scan as it was mapped, its events laid out before the mapper; None: it was left out."""
        while self._next is not None and self._next.stamp_s < timed.scan.stamp_s:
            self._next = next(self._scans, None)
        then = self._next
        if then is None:
            return None if self._known and self._ends else timed
        if then.stamp_s != timed.scan.stamp_s:
            return None
        for event in then.events:
            core.exchange.nav_events.put(event)
        return replace(timed, lifted=then.lifted)


def _repeat(entry: RecordedCall, session: RecordedSession[E]) -> list[E]:
    """Make the recorded call again."""
    if entry.call is Call.RECEIVE:
        return session.receive(entry.data, entry.now_s)
    if entry.call is Call.TICK:
        session.tick(entry.now_s)
    elif entry.call is Call.PORT and entry.data == OPENED:
        session.reopened()
    return []
