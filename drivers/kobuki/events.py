"""What a conversation with a Kobuki tells: samples, and one event for each thing that happened between two of
them.

Contacts, buttons and power changes are events, never only the latest value, so that nothing is lost between
two steps.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from lemtomap.drivers import identify
from lemtomap.drivers.kobuki.battery import Battery, PowerChange
from lemtomap.drivers.kobuki.packets import (
    Bumper,
    Button,
    Cliff,
    DockingIr,
    Gains,
    Inputs,
    OverCurrent,
    Udid,
    Version,
    WheelDrop,
)


@dataclass(frozen=True, slots=True)
class KobukiSample:
    """One feedback packet (50 Hz) in SI units."""

    stamp_s: float
    """Device time mapped to the host's monotonic clock."""
    arrival_s: float
    """Host time at which the packet was complete: its age is what silence rules look at."""
    device_ms: int
    """The device's own stamp, 0..65535."""
    left_ticks: int
    """Accumulated, 0..65535, wraps; forward counts up."""
    right_ticks: int
    left_pwm: int
    right_pwm: int
    gyro_yaw_rad: float
    """Heading of the factory-calibrated gyro, modulo one turn, from an arbitrary zero; NaN when not
    streamed.
    """
    gyro_rate_radps: float
    bumper: Bumper
    wheel_drop: WheelDrop
    cliff: Cliff
    buttons: Button
    over_current: OverCurrent
    cliff_adc: tuple[int, int, int]
    """Right, centre, left; 12 bits, larger = closer."""
    battery: Battery
    left_current_a: float
    right_current_a: float
    docking_ir: DockingIr
    raw_gyro_radps: NDArray[np.float64]
    """float64 (N, 3), rad/s in the base's axes, N usually 2, every 10 ms; the last at `stamp_s`."""
    raw_gyro_id: int
    """Running number (mod 256) of the first raw gyro sample."""
    inputs: Inputs | None

    on_dock: bool = False
    """What the charger's byte says of this very packet; `battery.source` is debounced."""

    @property
    def contact(self) -> bool:
        """Return True if anything asks the robot to stop at once."""
        return bool(self.bumper or self.wheel_drop or self.cliff)


@dataclass(frozen=True, slots=True)
class BumperEvent:
    """One bumper segment was pressed or released."""

    stamp_s: float
    side: Bumper
    pressed: bool


@dataclass(frozen=True, slots=True)
class CliffEvent:
    """One cliff sensor lost or found the floor."""

    stamp_s: float
    side: Cliff
    seen: bool
    adc: int


@dataclass(frozen=True, slots=True)
class WheelDropEvent:
    """One wheel dropped or was lifted back."""

    stamp_s: float
    side: WheelDrop
    dropped: bool


@dataclass(frozen=True, slots=True)
class ButtonEvent:
    """One button was pressed or released."""

    stamp_s: float
    button: Button
    pressed: bool


@dataclass(frozen=True, slots=True)
class OverCurrentEvent:
    """One wheel motor went above its current limit, or back."""

    stamp_s: float
    side: OverCurrent
    above: bool


@dataclass(frozen=True, slots=True)
class InputEvent:
    """The digital inputs changed."""

    stamp_s: float
    digital: int
    changed: int


@dataclass(frozen=True, slots=True)
class PowerEvent:
    """Something happened to the power supply."""

    stamp_s: float
    change: PowerChange
    battery: Battery


class Compatibility(StrEnum):
    """What the firmware's version means for us (kobuki_core's policy)."""

    GOOD = "good"
    UNTESTED = "untested"
    INCOMPATIBLE = "incompatible"


@dataclass(frozen=True, slots=True)
class BaseInfo:
    """Who the robot is; comes once all three are known, or when the firmware did not tell the others."""

    hardware: Version | None
    firmware: Version
    udid: Udid | None
    compatibility: Compatibility
    advice: str
    """One line for the user; empty when all is well."""


@dataclass(frozen=True, slots=True)
class GainsReport:
    """Answer to a request for the wheel controller's gains."""

    gains: Gains


@dataclass(frozen=True, slots=True)
class LinkUp:
    """Valid packets arrive (again)."""

    stamp_s: float


@dataclass(frozen=True, slots=True)
class LinkDown:
    """No valid packet for longer than a live base takes."""

    stamp_s: float
    reason: str


@dataclass(frozen=True, slots=True)
class WrongDeviceSeen(identify.WrongDeviceSeen):
    """Not a Kobuki answers on this port."""
