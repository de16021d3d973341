"""How far behind mapping and navigation are.

A thread that hangs says nothing, and what it said last goes on looking true: odometry carries the pose on,
the scan shows the next wall. So the base step keeps an account of what the two owe, and the safety gate
judges by it. Nothing is owed in lock-step, where each scan is mapped before the next command.
"""

from collections import deque

from lemtomap.robot.exchange import Exchange

OWED_KEPT = 16  # scans; the oldest is what counts, so the newest are let go


class Watchdog:
    """Knows since when mapping and navigation owe an answer. Called from the base step's thread."""

    def __init__(self, exchange: Exchange) -> None:
        self._exchange = exchange
        self._owed: deque[tuple[float, float]] = deque()
        self._began_s: float | None = None

    def saw(self, stamp_s: float, arrival_s: float) -> None:
        """Take note of a scan handed to mapping: a map is owed that has it, or a later one, in it."""
        if len(self._owed) < OWED_KEPT:
            self._owed.append((stamp_s, arrival_s))

    def map_stamp_s(self, now_s: float) -> float:
        """Return when the oldest scan arrived that mapping is not done with; now when there is none."""
        done_s = self._exchange.mapped.get()
        while self._owed and done_s is not None and self._owed[0][0] <= done_s:
            self._owed.popleft()
        return self._owed[0][1] if self._owed else now_s

    def cycle_stamp_s(self, now_s: float) -> float:
        """Return when navigation began its latest cycle; before the first, when it was asked for first."""
        if self._began_s is None:
            self._began_s = now_s
        begun_s = self._exchange.cycle.get()
        return self._began_s if begun_s is None else begun_s
