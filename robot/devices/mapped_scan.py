"""What the map was made of beside the scans: which of them were mapped, and what navigation told in between.

Written into the recording, so that a replay, which drives nothing, makes the same map.
"""

import base64
import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, get_args, get_type_hints

from lemtomap.topo.events import NavEvent

LARGEST = 2**62  # what the map's file can hold, and more than any edge's "closed for ever"
EVENTS: dict[str, type] = {kind.__name__: kind for kind in get_args(NavEvent)}


@dataclass(frozen=True, slots=True)
class MappedScan:
    """One scan that the mapper took."""

    stamp_s: float
    lifted: bool
    """A wheel hung in the air; the scan went nowhere."""
    events: tuple[NavEvent, ...] = ()
    """What the mapper learnt just before it."""


def to_values(mapped: MappedScan) -> dict[str, Any]:
    """Return it as JSON knows it; floats come back as they were."""
    values: dict[str, Any] = {"scan_s": mapped.stamp_s, "lifted": mapped.lifted}
    if mapped.events:
        values["events"] = [_event_values(event) for event in mapped.events]
    return values


def from_values(values: Mapping[str, Any]) -> MappedScan:
    """Return what `to_values` was given. Raises ValueError for anything else."""
    stamp_s, lifted, events = values.get("scan_s"), values.get("lifted"), values.get("events", [])
    if not (isinstance(lifted, bool) and isinstance(events, list)):
        raise ValueError("no record of a mapped scan")  # noqa: TRY004 - all bad values are alike to who reads
    return MappedScan(_value(stamp_s, float), lifted, tuple(_event(event) for event in events))


def _event_values(event: NavEvent) -> dict[str, Any]:
    values: dict[str, Any] = {"event": type(event).__name__}
    for field in dataclasses.fields(event):
        value = getattr(event, field.name)
        # navigation computes with numpy, whose numbers JSON does not know
        plain = base64.b64encode(value).decode() if isinstance(value, bytes) else _plain(value)
        values[field.name] = plain
    return values


def _plain(value: Any) -> Any:
    return value.item() if hasattr(value, "item") else value


def _event(values: Any) -> NavEvent:
    kind = EVENTS.get(str(values.get("event"))) if isinstance(values, dict) else None
    if kind is None:
        raise ValueError("no event of navigation")
    hints = get_type_hints(kind)
    event: NavEvent = kind(**{name: _value(values.get(name), hint) for name, hint in hints.items()})
    return event


def _value(value: Any, kind: type) -> Any:
    """Return a value of that kind. Raises ValueError."""
    if kind is bytes and isinstance(value, str):
        return base64.b64decode(value, validate=True)
    number = isinstance(value, int | float) and not isinstance(value, bool) and -LARGEST < value < LARGEST
    if kind is float and number and math.isfinite(value):
        return float(value)
    if kind is int and number and isinstance(value, int):
        return value
    if kind in {bool, str} and isinstance(value, kind):
        return value
    raise ValueError(f"{value!r} is no {kind.__name__}")
