"""In-memory cables: bytes with arrival times, and the damage real cables do to them."""

from collections import deque
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from lemtomap.sim.errors import Unplugged
from lemtomap.sim.faults import LinkFaults

MAX_WAITING = 1 << 16  # bytes a host that never reads may let pile up, as a tty buffer would


class Frame(NamedTuple):
    """One piece as the device sent it."""

    data: bytes
    answer: bool
    """To a command of the host's, who waits for it; else it comes by itself, and the next one soon."""


class Link:
    """One cable. The device side calls `deliver` and `collect`, the host side has `host`."""

    def __init__(
        self, name: str, faults: LinkFaults, rng: np.random.Generator, clock: Callable[[], float]
    ) -> None:
        self.name = name
        self._faults = faults
        self._rng = rng
        self._clock = clock
        self._to_host: deque[tuple[float, Frame]] = deque()
        self._to_device: list[bytes | None] = []
        self._waiting = 0
        self._last_arrival_s = 0.0
        self._pulled = False
        self.dropped_bytes = 0
        """Bytes no host ever read."""
        self.host = HostPort(self)

    @property
    def plugged(self) -> bool:
        """Whether bytes can flow now."""
        now = self._clock()
        return not self._pulled and not any(begin <= now < end for begin, end in self._faults.unplugged)

    @property
    def will_unplug(self) -> bool:
        """Whether the faults pull this cable at some time."""
        return bool(self._faults.unplugged)

    def deliver(self, data: bytes, sent_s: float, *, answer: bool = False) -> None:
        """Send from the device at a time; a whole piece is dropped when the host does not read."""
        if not data:
            return
        if not self.plugged or self._waiting + len(data) > MAX_WAITING:
            self.dropped_bytes += len(data)
            return
        damaged = self._damage(data)
        arrival = sent_s + self._faults.delay_s
        if self._faults.jitter_s:
            arrival += self._faults.jitter_s * float(self._rng.random())
        if self._faults.burst_s:
            arrival = float(np.ceil(arrival / self._faults.burst_s)) * self._faults.burst_s
        self._last_arrival_s = max(arrival, self._last_arrival_s)  # bytes never overtake one another
        self._to_host.append((self._last_arrival_s, Frame(damaged, answer)))
        self._waiting += len(damaged)

    def _damage(self, data: bytes) -> bytes:
        faults = self._faults
        if not faults.lose_byte and not faults.flip_bit:
            return data
        array = np.frombuffer(data, dtype=np.uint8).copy()
        flipped = self._rng.random(len(array)) < faults.flip_bit
        array[flipped] ^= (1 << self._rng.integers(0, 8, int(flipped.sum()))).astype(np.uint8)
        return array[self._rng.random(len(array)) >= faults.lose_byte].tobytes()

    def collect(self) -> list[bytes | None]:
        """Return what the host has sent since the last call, in order; None where a host closed the port."""
        sent, self._to_device = self._to_device, []
        return sent

    def read_frames(self) -> list[Frame]:
        """Host side: everything that has arrived, in the pieces the device sent."""
        self._check()
        now = self._clock() + 1e-9
        frames: list[Frame] = []
        while self._to_host and self._to_host[0][0] <= now:
            frames.append(self._to_host.popleft()[1])
            self._waiting -= len(frames[-1].data)
        return frames

    def hang_up(self) -> None:
        """Host side: close the port; what is under way to it is lost, as in a tty at its last close."""
        self._to_host.clear()
        self._waiting = 0
        self._to_device.append(None)

    def write(self, data: bytes) -> None:
        """Host side: send to the device."""
        self._check()
        if data:
            self._to_device.append(bytes(data))

    def _check(self) -> None:
        if not self.plugged:
            self._flush()
            raise Unplugged(self.name)

    def _flush(self) -> None:
        self._to_host.clear()
        self._to_device.clear()
        self._waiting = 0

    def pull(self, *, out: bool) -> None:
        """Pull the plug, or put it back."""
        self._pulled = out
        if out:
            self._flush()


class HostPort:
    """The host's end of a cable: read what is there, write without waiting."""

    def __init__(self, link: Link) -> None:
        self._link = link

    @property
    def name(self) -> str:
        """Which device is at the other end."""
        return self._link.name

    @property
    def plugged(self) -> bool:
        """Whether the cable is in."""
        return self._link.plugged

    @property
    def will_unplug(self) -> bool:
        """Whether the run's faults pull this cable at some time."""
        return self._link.will_unplug

    def read(self) -> bytes:
        """Return everything that has arrived by now, perhaps nothing. Raises Unplugged."""
        return b"".join(frame.data for frame in self._link.read_frames())

    def read_frames(self) -> list[Frame]:
        """Return the same in the pieces the device sent (a replier that must not cut frames needs them)."""
        return self._link.read_frames()

    def hang_up(self) -> None:
        """Close the port, as its last client does: replies under way or owed reach nobody."""
        self._link.hang_up()

    def write(self, data: bytes) -> None:
        """Send to the device. Raises Unplugged."""
        self._link.write(data)

    def unplug(self) -> None:
        """Pull the cable: what is under way is lost."""
        self._link.pull(out=True)

    def replug(self) -> None:
        """Put the cable back; the device has been powered all the time."""
        self._link.pull(out=False)
