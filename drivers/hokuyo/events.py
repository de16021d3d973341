"""What a conversation with a SCIP laser tells."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lemtomap.drivers import identify
from lemtomap.drivers.hokuyo.packets import SensorParameters


@dataclass(frozen=True, slots=True)
class LaserScan:
    """One turn. Beam i points to angle_min + i * angle_step at stamp + i * time_step, counter-clockwise."""

    stamp_s: float
    """Time of the first beam: device time mapped to the host's monotonic clock."""
    arrival_s: float
    """Host time at which the scan was complete."""
    device_ms: int
    """The device's own stamp, 24 bits: when the motor passed step 0."""
    ranges_m: NDArray[np.float32]
    """float32 (N,), read-only; +inf nothing seen, NaN an error code, or a beam whose bytes were damaged."""
    raw_mm: NDArray[np.int32]
    """int32 (N,), as sent: below range_min an error code."""
    angle_min_rad: float
    angle_step_rad: float
    time_step_s: float
    range_min_m: float
    range_max_m: float
    complete: bool
    """False: some lines failed their checks and their beams are NaN. Good enough to see obstacles by, not for
    a map."""
    missed: int = 0
    """Scans lost since the one before."""


@dataclass(frozen=True, slots=True)
class SensorInfo:
    """Who the laser is; comes once per connection."""

    vendor: str
    product: str
    firmware: str
    protocol: str
    serial: str
    parameters: SensorParameters
    state: Mapping[str, str]
    """Fields of II: laser on or off, speed, mode, timer, state of health."""

    @property
    def healthy(self) -> bool:
        """Return True if the sensor says of itself that it works."""
        return is_healthy(self.state.get("STAT", ""))


_HEALTHY = ("sensor works well", "sensor is working normally", "stable 000")


def is_healthy(text: str) -> bool:
    """Return True if a STAT text is one of those a working sensor gives; an empty one says nothing bad."""
    return not text or text.lower().startswith(_HEALTHY)


@dataclass(frozen=True, slots=True)
class LaserFault:
    """The laser says, or shows, that something is wrong."""

    stamp_s: float
    reason: str
    """One line for the user: what, and the cure where there is one."""
    code: str = ""
    """The sensor's status, when it gave one."""
    recovering: bool = True
    """True: the session goes on trying by itself."""


@dataclass(frozen=True, slots=True)
class LaserWell:
    """A fault is over."""

    stamp_s: float


@dataclass(frozen=True, slots=True)
class LaserUp:
    """Scans arrive (again)."""

    stamp_s: float
    clock_synchronised: bool
    """False: the sensor refused time adjustment; stamps rest on the usual latency."""


@dataclass(frozen=True, slots=True)
class LaserDown:
    """Scans stopped arriving; the session is reconnecting."""

    stamp_s: float
    reason: str


@dataclass(frozen=True, slots=True)
class WrongDeviceSeen(identify.WrongDeviceSeen):
    """Not a laser answers on this port."""
