"""What the robot tells the people around it with its two LEDs and its sounds.

LED 1 (motion)   green: drives   orange: waits or is held up   red: the safety gate stops it   off: idle
LED 2 (mind)     green: knows where it is   red: lost   orange: battery low (before all else)
sounds           goal reached, goal given up, lost, stopped by contact, a part that hangs, battery low: once
                 each time it begins
"""

from dataclasses import dataclass

from lemtomap.drivers.kobuki.commands import Led, Tune
from lemtomap.drivers.kobuki.session import KobukiSession
from lemtomap.nav.types import NavState
from lemtomap.robot.motion.safety import Reason

ALARMING = frozenset(
    {
        Reason.BUMPER,
        Reason.CLIFF,
        Reason.WHEEL_DROP,
        Reason.OVER_CURRENT,
        Reason.MAPPING_HANGS,
        Reason.NAVIGATION_HANGS,
    }
)
QUIET = frozenset(
    {Reason.CLEAR, Reason.LIMIT, Reason.NEAR_OBSTACLE, Reason.COMMAND_TIMEOUT, Reason.NOT_PERMITTED}
)
REPEAT_S = 10.0  # the same sound is not played again sooner: a robot that nags is switched off


@dataclass(frozen=True, slots=True)
class Condition:
    """What the robot feels now."""

    reason: Reason
    nav_state: NavState = NavState.IDLE
    lost: bool = False
    battery_low: bool = False


@dataclass(frozen=True, slots=True)
class Light:
    """Set one LED."""

    number: int
    colour: Led


@dataclass(frozen=True, slots=True)
class Play:
    """Play one of the firmware's tunes."""

    tune: Tune


Signal = Light | Play


def signal_bytes(session: KobukiSession, signal: Signal) -> bytes:
    """Return the command that lights a LED or plays a tune."""
    if isinstance(signal, Light):
        return session.led(signal.number, signal.colour)
    return session.sound(signal.tune)


class Indicators:
    """Turns conditions into LED changes and sounds; says each thing once."""

    def __init__(self) -> None:
        self._lights: dict[int, Led] = {}
        self._before = Condition(Reason.NOT_PERMITTED)
        self._played_s: dict[Tune, float] = {}

    def refresh(self) -> None:
        """Send all lights again, because the base was switched off or plugged in anew."""
        self._lights.clear()

    def update(self, condition: Condition, now_s: float) -> list[Signal]:
        """Return what to change now; empty most of the time."""
        signals: list[Signal] = []
        for number, colour in ((1, _motion_light(condition)), (2, _mind_light(condition))):
            if self._lights.get(number) != colour:
                self._lights[number] = colour
                signals.append(Light(number, colour))
        for tune in _sounds(self._before, condition):
            if now_s - self._played_s.get(tune, -REPEAT_S) >= REPEAT_S:
                self._played_s[tune] = now_s
                signals.append(Play(tune))
        self._before = condition
        return signals


def _motion_light(condition: Condition) -> Led:
    if condition.reason not in QUIET:
        return Led.RED
    if condition.nav_state in {NavState.WAITING, NavState.RECOVERING, NavState.FAILED}:
        return Led.ORANGE
    return Led.GREEN if condition.nav_state in {NavState.DRIVING, NavState.TURNING} else Led.OFF


def _mind_light(condition: Condition) -> Led:
    if condition.battery_low:
        return Led.ORANGE
    return Led.RED if condition.lost else Led.GREEN


def _sounds(before: Condition, now: Condition) -> list[Tune]:
    tunes = []
    if now.nav_state is NavState.ARRIVED and before.nav_state is not NavState.ARRIVED:
        tunes.append(Tune.CLEANING_END)
    failed = now.nav_state is NavState.FAILED and before.nav_state is not NavState.FAILED
    if failed or (now.lost and not before.lost) or (now.reason in ALARMING and before.reason not in ALARMING):
        tunes.append(Tune.ERROR)
    if now.battery_low and not before.battery_low:
        tunes.append(Tune.RECHARGE)
    return tunes
