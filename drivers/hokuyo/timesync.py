"""The offset of the sensor's clock from a few two-way exchanges (TM1)."""

from lemtomap.drivers.hokuyo.packets import STAMP_BITS

_TICK_S = 1e-3  # SCIP 2.0: stamps count milliseconds


class TimeSync:
    """Each reading says: the timer showed `stamp` at some moment between sending and receiving.

    So host minus device time lies between (sent - stamp - 1 tick) and (received - stamp); all readings
    together narrow it down further than the quickest alone, because the timer's tick falls elsewhere in each.
    """

    def __init__(self) -> None:
        self.count = 0
        self.first_raw = 0
        self._low_s = float("-inf")
        self._high_s = float("inf")
        self._quickest: tuple[float, float] = (float("inf"), 0.0)

    def add(self, raw: int, sent_s: float, received_s: float) -> None:
        """Take one exchange."""
        if self.count == 0:
            self.first_raw = raw
        self.count += 1
        device_s = self._unwrapped(raw) * _TICK_S
        low, high = sent_s - device_s - _TICK_S, received_s - device_s
        self._low_s, self._high_s = max(self._low_s, low), min(self._high_s, high)
        self._quickest = min(self._quickest, (high - low, 0.5 * (low + high)))

    def _unwrapped(self, raw: int) -> int:
        return self.first_raw + (raw - self.first_raw) % (1 << STAMP_BITS)

    @property
    def offset_s(self) -> float:
        """Host time minus device time (on the scale of the first reading)."""
        if self._low_s <= self._high_s:
            return 0.5 * (self._low_s + self._high_s)
        return self._quickest[1]  # a host that was late in between: trust the quickest exchange

    @property
    def uncertainty_s(self) -> float:
        """Half of the interval the offset lies in."""
        return 0.5 * (self._high_s - self._low_s if self._low_s <= self._high_s else self._quickest[0])
