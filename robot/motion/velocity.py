"""From several wishes to one smooth velocity: priorities with time-outs, then limited acceleration.

The chain is mux, smoother, safety gate, wheels. A source that falls silent drops out after its time-out and
the next one takes over; the smoother makes the change gentle. The gate alone may stop abruptly, and tells the
smoother what was really sent, so that the next start ramps up from there.
"""

import math
from dataclasses import dataclass

from lemtomap.settings import check_ranges, within
from lemtomap.types import Twist


@dataclass(frozen=True, slots=True)
class CommandSource:
    """One that may command the robot."""

    name: str
    priority: int
    """The greater wins."""
    timeout_s: float


SAFETY = CommandSource("safety", 100, 0.3)
TELEOP = CommandSource("teleop", 50, 0.5)
DOCKING = CommandSource("docking", 30, 0.3)
NAVIGATION = CommandSource("navigation", 10, 0.3)
SOURCES = (SAFETY, TELEOP, DOCKING, NAVIGATION)


@dataclass(frozen=True, slots=True)
class Wish:
    """A velocity wanted by a source."""

    source: str
    twist: Twist
    stamp_s: float


class VelocityMux:
    """Choose the freshest wish of the most important source that is not silent."""

    def __init__(self, sources: tuple[CommandSource, ...] = SOURCES) -> None:
        self._sources = sorted(sources, key=lambda source: -source.priority)
        self._wishes: dict[str, Wish] = {}

    def offer(self, source: CommandSource, twist: Twist, now_s: float) -> None:
        """Take a wish; a newer one of the same source replaces it."""
        self._wishes[source.name] = Wish(source.name, twist, now_s)

    def withdraw(self, source: CommandSource) -> None:
        """Forget what a source wished."""
        self._wishes.pop(source.name, None)

    def select(self, now_s: float) -> Wish | None:
        """Return the wish to follow, None when every source is silent."""
        for source in self._sources:
            wish = self._wishes.get(source.name)
            if wish is not None and now_s - wish.stamp_s <= source.timeout_s:
                return wish
        return None


@dataclass(frozen=True, slots=True)
class SmootherConfig:
    """Acceleration limits; the official limiter has 0.5 / 0.6 m/s2 and 3.5 / 4.2 rad/s2 (reference, 8).

    Raises BadSetting.
    """

    accel_mps2: float = within(0.5, 0.05, 1.5, "a laptop stands on top")
    brake_mps2: float = within(0.8, 0.2, 3.0, "a slow stop is left to the gate, which stops at once")
    turn_radps2: float = within(3.5, 0.2, 15.0, "a laptop stands on top")
    turn_brake_radps2: float = within(4.2, 0.5, 15.0, "a robot that turns on misses its way")

    def __post_init__(self) -> None:
        check_ranges(self)


class VelocitySmoother:
    """Follow a wanted velocity within acceleration limits, whatever its sign."""

    def __init__(self, config: SmootherConfig | None = None) -> None:
        self.config = config or SmootherConfig()
        self.sent = Twist()

    def step(self, wanted: Twist, dt_s: float) -> Twist:
        """Return the velocity to ask for after `dt_s` seconds. Holds: never beyond what is wanted."""
        if not (math.isfinite(wanted.v_mps) and math.isfinite(wanted.w_radps)):
            return wanted  # the gate's matter: it stops, and names the reason
        c = self.config
        v = _ramp(self.sent.v_mps, wanted.v_mps, c.accel_mps2 * dt_s, c.brake_mps2 * dt_s)
        w = _ramp(self.sent.w_radps, wanted.w_radps, c.turn_radps2 * dt_s, c.turn_brake_radps2 * dt_s)
        return Twist(v, w)

    def note_sent(self, v_mps: float, w_radps: float) -> None:
        """Tell what the gate let through: the next step starts there."""
        self.sent = Twist(v_mps, w_radps)


def _ramp(now: float, wanted: float, rise: float, fall: float) -> float:
    """Move towards `wanted`: by `fall` while the speed shrinks (at most to zero), else by `rise`."""
    if now * wanted < 0.0:
        return math.copysign(max(0.0, abs(now) - fall), now)
    step = rise if abs(wanted) > abs(now) else fall
    return now + min(max(wanted - now, -step), step)
