"""Device events as lines that a person understands."""

from collections.abc import Callable
from typing import Any

from lemtomap.drivers.hokuyo import events as hokuyo
from lemtomap.drivers.kobuki import events as kobuki
from lemtomap.drivers.kobuki.battery import PowerChange
from lemtomap.robot.exchange import Note, NoteLevel

BASE, LASER = "base", "laser"
Described = tuple[str, str, NoteLevel]

_GRAVE = {PowerChange.BATTERY_LOW, PowerChange.BATTERY_CRITICAL}


def describe_event(event: object, now_s: float) -> Note | None:
    """Return the line for an event, None for those that are nobody's business."""
    describe = _DESCRIPTIONS.get(type(event))
    if describe is None:
        return None
    source, text, level = describe(event)
    return Note(now_s, source, text, level)


def _bumper(event: kobuki.BumperEvent) -> Described:
    name = (event.side.name or "?").lower()
    return BASE, f"{name} bumper {'pressed' if event.pressed else 'released'}", NoteLevel.INFO


def _cliff(event: kobuki.CliffEvent) -> Described:
    name = (event.side.name or "?").lower()
    return (
        BASE,
        f"{name} cliff sensor {'sees no floor' if event.seen else 'sees the floor again'}",
        NoteLevel.INFO,
    )


def _wheel(event: kobuki.WheelDropEvent) -> Described:
    name = (event.side.name or "?").lower()
    return BASE, f"{name} wheel {'hangs in the air' if event.dropped else 'stands again'}", NoteLevel.WARN


def _current(event: kobuki.OverCurrentEvent) -> Described:
    name = (event.side.name or "?").lower()
    return (
        BASE,
        f"{name} motor {'draws too much current' if event.above else 'is well again'}",
        NoteLevel.WARN,
    )


def _power(event: kobuki.PowerEvent) -> Described:
    level = NoteLevel.WARN if event.change in _GRAVE else NoteLevel.INFO
    return BASE, f"{event.change} ({event.battery.voltage_v:.1f} V, {event.battery.percent:.0f} %)", level


def _base_info(event: kobuki.BaseInfo) -> Described:
    text = f"Kobuki, hardware {event.hardware or 'unknown'}, firmware {event.firmware}"
    grave = event.compatibility is not kobuki.Compatibility.GOOD
    return (
        BASE,
        f"{text}; {event.advice}" if event.advice else text,
        NoteLevel.WARN if grave else NoteLevel.INFO,
    )


def _laser_info(event: hokuyo.SensorInfo) -> Described:
    health = event.state.get("STAT", "")
    text = f"{event.product}, firmware {event.firmware}, serial {event.serial}; {health}".rstrip("; ")
    return LASER, text, NoteLevel.INFO if event.healthy else NoteLevel.WARN


_DESCRIPTIONS: dict[type, Callable[[Any], Described]] = {
    kobuki.BumperEvent: _bumper,
    kobuki.CliffEvent: _cliff,
    kobuki.WheelDropEvent: _wheel,
    kobuki.OverCurrentEvent: _current,
    kobuki.PowerEvent: _power,
    kobuki.BaseInfo: _base_info,
    kobuki.LinkUp: lambda _: (BASE, "packets arrive", NoteLevel.INFO),
    kobuki.LinkDown: lambda event: (BASE, event.reason, NoteLevel.WARN),
    kobuki.WrongDeviceSeen: lambda event: (BASE, event.reason, NoteLevel.ERROR),
    hokuyo.SensorInfo: _laser_info,
    hokuyo.LaserUp: lambda _: (LASER, "scans arrive", NoteLevel.INFO),
    hokuyo.LaserDown: lambda event: (LASER, event.reason, NoteLevel.WARN),
    hokuyo.LaserFault: lambda event: (
        LASER,
        event.reason,
        NoteLevel.WARN if event.recovering else NoteLevel.ERROR,
    ),
    hokuyo.LaserWell: lambda _: (LASER, "works again", NoteLevel.INFO),
    hokuyo.WrongDeviceSeen: lambda event: (LASER, event.reason, NoteLevel.ERROR),
}
