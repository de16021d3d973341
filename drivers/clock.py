"""Device clocks mapped to the host's monotonic clock, so that USB jitter does not reach the samples.

A packet that carries device time d and arrives at host time a was delayed by a - d = offset + drift * d +
(what the wire, the USB latency timer and the scheduler added). The last part is never negative, so the lower
edge of the points (d, a - d) is the clock relation: minimum delays of short bins, and the edge of their lower
convex hull that spans the middle of the window (the line below all points that lies closest to them in the
mean).
"""

import itertools
from collections import deque
from dataclasses import dataclass

TICK_S = 1e-3  # both devices count milliseconds


@dataclass(frozen=True, slots=True)
class ClockConfig:
    """How one device's clock is mapped."""

    bits: int
    """Width of the device's stamp; it wraps at 2**bits."""
    latency_s: float = 0.0
    """Least time from stamp to arrival, when no two-way exchange measured it."""
    bin_s: float = 1.0  # holds a packet with almost no extra delay even through 16 ms bursts
    window_bins: int = 240  # 4 min: 0.5 ms of noise in a minimum is 2 ppm of drift
    min_drift_span_s: float = 30.0  # 16 ms of jitter over less would look like > 500 ppm
    max_drift: float = 500e-6  # a crystal is within 100 ppm, a resonator within 500
    early_s: float = 0.1
    """A packet this much before its time (it would arrive before it was sent) shows another epoch."""
    late_s: float = 30.0
    """A packet later than this shows another epoch; anything less can be a host that slept."""
    strikes: int = 3
    """So many packets of another epoch in a row, consistent with one another, start it."""
    step_s: float = 0.05
    """Two bins in a row later than this: the device's clock stood still for a while; what came before is
    void.
    """
    learn_s: float = 3.0
    """After `anchor`, the constant latency of the stream is learnt for this long."""


class DeviceClock:
    """Maps the wrapped stamps of one device to host time. A pure function of what it was given."""

    def __init__(self, config: ClockConfig) -> None:
        self._config = config
        self._period = 1 << config.bits
        self._drift = 0.0
        self.resets = 0
        """How often the device began a new epoch by itself (it was switched off and on)."""
        self.restart()

    def restart(self) -> None:
        """Forget the offset (the next stamp begins a new epoch) but keep the drift, a property of the
        crystal.
        """
        self._raw = -1  # of the last stamp; negative: none yet
        self._ticks = 0  # the same, unwrapped
        self._arrival_s = 0.0
        self._offset_s = 0.0
        self._latency_s = self._config.latency_s
        self._learn_until_s: float | None = None
        self._bins: deque[tuple[float, float]] = deque(maxlen=self._config.window_bins)
        self._bin: list[tuple[float, float]] = []
        self._bin_end_s = float("-inf")
        self._late_bins = 0
        self._stamp: tuple[float, float] | None = None
        self._strike_count = 0
        self._strike: tuple[int, float] = (0, 0.0)

    @property
    def drift(self) -> float:
        """How much more the host's clock gains than the device's, per device second."""
        return self._drift

    @property
    def offset_s(self) -> float:
        """Host time minus unwrapped device time at the last stamp."""
        return self._line(self._ticks * TICK_S) - self._latency_s

    def anchor(self, raw: int, offset_s: float, now_s: float) -> None:
        """Begin an epoch with the true offset (host minus device time, stamp `raw` unwrapped as it is).

        The stream that follows arrives later than this; by how much is learnt from it.
        """
        self.restart()
        self._raw, self._ticks, self._arrival_s = raw % self._period, raw, now_s
        self._offset_s = offset_s - self._drift * raw * TICK_S
        self._latency_s = 0.0
        self._bin_end_s = now_s + self._config.bin_s
        self._learn_until_s = now_s + self._config.learn_s

    @property
    def fresh(self) -> bool:
        """Return True if the next stamp begins an epoch."""
        return self._raw < 0

    def begin(self, first_raw: int, latest_raw: int, arrival_s: float) -> None:
        """Begin an epoch with a row of stamps that arrived together: only the latest is fresh."""
        latest = first_raw + (latest_raw - first_raw) % self._period
        self._raw, self._ticks, self._arrival_s = (first_raw - 1) % self._period, first_raw - 1, arrival_s
        self._offset_s = arrival_s - latest * TICK_S * (1.0 + self._drift)
        self._bin_end_s = arrival_s + self._config.bin_s

    def map(self, raw: int, arrival_s: float) -> float | None:
        """Return the host time of a stamp that arrived now, or None when the stamp cannot be right.

        Holds: returned times grow; none is later than its arrival minus the constant latency, but for what
        growing demands.
        """
        if self._raw < 0:
            self.begin(raw, raw, arrival_s)
        ticks = self._unwrap(raw, arrival_s)
        if not self._plausible(ticks, arrival_s):
            if not self._new_epoch(raw, arrival_s):
                return None
            self.resets += 1
            self.restart()
            self.begin(raw, raw, arrival_s)
            ticks = raw
        self._strike_count = 0
        self._raw, self._ticks, self._arrival_s = raw, ticks, arrival_s
        device_s = ticks * TICK_S
        self._observe(device_s, arrival_s)
        return self._growing(device_s)

    def _unwrap(self, raw: int, arrival_s: float) -> int:
        step = (raw - self._raw) % self._period
        expected = (arrival_s - self._arrival_s) / TICK_S
        return self._ticks + step + self._period * round((expected - step) / self._period)

    def _line(self, device_s: float) -> float:
        return self._offset_s + self._drift * device_s

    def _plausible(self, ticks: int, arrival_s: float) -> bool:
        device_s = ticks * TICK_S
        late_s = arrival_s - device_s - self._line(device_s)
        return ticks > self._ticks and -self._config.early_s <= late_s <= self._config.late_s

    def _new_epoch(self, raw: int, arrival_s: float) -> bool:
        """Count stamps that fit one another but not the line; tell whether they are enough."""
        last_raw, last_arrival_s = self._strike
        step_s = ((raw - last_raw) % self._period) * TICK_S
        fits = step_s > 0.0 and abs(step_s - (arrival_s - last_arrival_s)) < 2.0 * self._config.early_s
        self._strike_count = self._strike_count + 1 if fits else 1
        self._strike = (raw, arrival_s)
        return self._strike_count >= self._config.strikes

    def _observe(self, device_s: float, arrival_s: float) -> None:
        delay_s = arrival_s - device_s
        self._offset_s = min(self._offset_s, delay_s - self._drift * device_s)
        self._bin.append((delay_s, device_s))
        if arrival_s >= self._bin_end_s:
            delay_s, device_s = min(self._bin)
            self._late_bins = self._late_bins + 1 if self._stepped(delay_s - self._line(device_s)) else 0
            if self._late_bins > 1:
                self._bins = deque([self._bins[-1]], maxlen=self._bins.maxlen)
                self._late_bins = 0
            self._bins.append((device_s, delay_s))
            self._bin = []
            self._bin_end_s = arrival_s + self._config.bin_s
            self._close_bin(arrival_s)

    def _stepped(self, late_s: float) -> bool:
        return self._learn_until_s is None and late_s > self._config.step_s

    def _close_bin(self, arrival_s: float) -> None:
        if self._learn_until_s is None:
            self._fit()
        elif arrival_s >= self._learn_until_s:
            device_s = self._ticks * TICK_S
            true_s = self._line(device_s)
            self._fit()
            self._latency_s = self._line(device_s) - true_s
            self._learn_until_s = None

    def _fit(self) -> None:
        if self._bins[-1][0] - self._bins[0][0] >= self._config.min_drift_span_s:
            slope = _middle_slope(_lower_hull(list(self._bins)))
            self._drift = max(-self._config.max_drift, min(self._config.max_drift, slope))
        self._offset_s = min(delay_s - self._drift * device_s for device_s, delay_s in self._bins)

    def _growing(self, device_s: float) -> float:
        stamp_s = device_s + self._line(device_s) - self._latency_s
        if self._stamp is not None:
            last_stamp_s, last_device_s = self._stamp
            stamp_s = max(stamp_s, last_stamp_s + 0.25 * (device_s - last_device_s))
        self._stamp = (stamp_s, device_s)
        return stamp_s


def _lower_hull(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the lower convex hull of points sorted by their first coordinate."""
    hull: list[tuple[float, float]] = []
    for x, y in points:
        while len(hull) > 1:
            (x0, y0), (x1, y1) = hull[-2], hull[-1]
            if (y1 - y0) * (x - x0) < (y - y0) * (x1 - x0):
                break
            hull.pop()
        hull.append((x, y))
    return hull


def _middle_slope(hull: list[tuple[float, float]]) -> float:
    """Return the slope of the edge over the middle of the hull's span."""
    middle = 0.5 * (hull[0][0] + hull[-1][0])
    for (x0, y0), (x1, y1) in itertools.pairwise(hull):
        if x1 >= middle:
            return (y1 - y0) / (x1 - x0)
    raise AssertionError("a hull of two points or more has an edge over its middle")
