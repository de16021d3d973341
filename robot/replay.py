"""A recorded run once more: the same bytes through the same sessions give the same samples, bit for bit."""

from collections.abc import Callable, Iterator
from pathlib import Path

from drivers.hokuyo.session import HokuyoSession
from drivers.kobuki.session import KobukiSession
from robot.core import RobotCore, Samples
from robot.recording import Call, Entry, read_entries
from robot.wire import HOKUYO, KOBUKI, OPENED, E, Session


def replay_events(path: Path) -> Iterator[tuple[float, Samples]]:
    """Yield (clock value, events) of each recorded call that told something. Raises BadLog."""
    base, laser = KobukiSession(), HokuyoSession()
    for entry in read_entries(path):
        if entry.device == KOBUKI:
            told = Samples(base=_repeat(entry, base))
        elif entry.device == HOKUYO:
            told = Samples(laser=_repeat(entry, laser))
        else:
            continue
        if told.base or told.laser:
            yield entry.now_s, told


def replay_map(path: Path, core: RobotCore, watch: Callable[[float], None] | None = None) -> float:
    """Map a recorded run anew, with whatever settings `core` has; return the clock value of its end.

    Nothing is driven: the recorded robot went where it went. Raises BadLog.
    """
    now_s = 0.0
    for now_s, told in replay_events(path):
        core.take(told, now_s)
        while core.map_one(0.0):
            pass
        if watch is not None:
            watch(now_s)
    return now_s


def _repeat(entry: Entry, session: Session[E]) -> list[E]:
    """Make the recorded call again."""
    if entry.call is Call.RECEIVE:
        return session.receive(entry.data, entry.now_s)
    if entry.call is Call.TICK:
        session.tick(entry.now_s)
    elif entry.call is Call.PORT and entry.data == OPENED:
        session.reopened()
    return []
