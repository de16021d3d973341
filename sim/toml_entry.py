"""One table of a world file: reads its values, and says file, line and reason when one cannot be used."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lemtomap.sim.errors import BadWorld, shown

MAX_ITEMS = 4000  # in one list; a file of walls without end is no building
MAX_TABLES = 1000  # of one kind
MAX_NUMBER = 1e9  # metres, seconds or radians
MAX_TEXT = 200  # characters
LINK_KEYS = frozenset({"lose_byte", "flip_bit", "burst_s", "delay_s", "jitter_s", "unplugged"})
KEYS: dict[str, tuple[frozenset[str], frozenset[str]]] = {
    "": (frozenset({"name"}), frozenset({"map", "spawn", "dock", "description", "faults"})),
    "wall": (frozenset({"points"}), frozenset({"surface", "thickness", "height"})),
    "room": (frozenset({"name", "low", "high"}), frozenset({"kind"})),
    "door": (frozenset({"at", "rooms"}), frozenset({"name", "width", "leaf", "period", "open"})),
    "furniture": (frozenset({"kind", "at"}), frozenset({"moved"})),
    "person": (frozenset({"points"}), frozenset({"speed", "pause"})),
    "barrier": (frozenset({"from", "to", "during"}), frozenset()),
    "ramp": (frozenset({"from", "to", "rise", "width"}), frozenset()),
    "hole": (frozenset({"low", "high"}), frozenset()),
    "faults": (frozenset(), frozenset({"kobuki", "hokuyo", "stuck_left", "stuck_right", "blocked_laser"})),
    "faults.kobuki": (frozenset(), LINK_KEYS),
    "faults.hokuyo": (frozenset(), LINK_KEYS),
}
"""Table -> keys it must have, keys it may have."""


@dataclass(frozen=True, slots=True)
class TomlEntry:
    """One table of the file, with what is needed to say where an error is."""

    path: Path
    text: str
    table: str
    number: int
    values: dict[str, Any]

    def line(self, key: str | None = None) -> int:
        """Return the line of the table's header, or of a key in it."""
        lines = self.text.splitlines()
        start, seen = 0, -1
        for index, line in enumerate(lines):
            if self.table and re.match(rf"\s*\[{{1,2}}\s*{re.escape(self.table)}\s*\]", line):
                seen += 1
                start = index
                if seen == self.number:
                    break
        if key is None:
            return start + 1
        for index in range(start if self.table else 0, len(lines)):
            if re.match(rf"\s*[\"']?{re.escape(key)}[\"']?\s*=", lines[index]):
                return index + 1
        return start + 1

    def refuse(self, reason: str, key: str | None = None) -> BadWorld:
        """Return the error with file and line."""
        where = f"[{self.table}] " if self.table else ""
        return BadWorld(f"{self.path}:{self.line(key)}: {where}{reason}")

    def check_keys(self) -> None:
        """Raise BadWorld at the first key that is unknown, or when one is missing."""
        must, may = KEYS[self.table]
        for key in self.values:
            if key not in must | may and not (not self.table and key in KEYS):
                raise self.refuse(f"unknown key '{key}'; known are {', '.join(sorted(must | may))}", key)
        for key in sorted(must - self.values.keys()):
            raise self.refuse(f"key '{key}' is missing")

    def numbers(self, key: str, count: int) -> tuple[float, ...]:
        """Return a list of so many finite numbers."""
        return self.checked(self.values[key], key, count)

    def checked(self, value: object, key: str, count: int) -> tuple[float, ...]:
        """Return value as so many finite numbers."""
        good = isinstance(value, list) and len(value) == count
        if not good or not all(_is_number(item) for item in value):  # type: ignore[attr-defined]
            raise self.refuse(f"'{key}' must be {count} numbers, is {shown(value)}", key)
        return tuple(float(item) for item in value)  # type: ignore[attr-defined]

    def number_of(self, key: str, default: float, low: float, high: float) -> float:
        """Return one number within limits."""
        value = self.values.get(key, default)
        if not _is_number(value) or not low <= value <= high:
            raise self.refuse(f"'{key}' must be a number from {low:g} to {high:g}, is {shown(value)}", key)
        return float(value)

    def choice(self, key: str, default: str, allowed: list[str]) -> str:
        """Return one of the allowed words."""
        value = self.values.get(key, default)
        if value not in allowed:
            raise self.refuse(f"'{key}' must be one of {', '.join(allowed)}, is {shown(value)}", key)
        return str(value)

    def text_of(self, key: str, default: str | None = None) -> str:
        """Return a name or a description."""
        return self.checked_text(self.values.get(key, default), key)

    def checked_text(self, value: object, key: str) -> str:
        """Return value as one short line of plain characters."""
        if not isinstance(value, str) or not value.isprintable() or not 0 < len(value) <= MAX_TEXT:
            reason = f"'{key}' must be one line of at most {MAX_TEXT} characters, is {shown(value)}"
            raise self.refuse(reason, key)
        return value

    def items(self, key: str, what: str) -> list[object]:
        """Return a list, empty when there is none; `what` says in a refusal what belongs into it."""
        value = self.values.get(key, [])
        if not isinstance(value, list):
            raise self.refuse(f"'{key}' must be a list of {what}", key)
        if len(value) > MAX_ITEMS:
            raise self.refuse(f"'{key}' has {len(value)} items, at most {MAX_ITEMS}", key)
        return value

    def point(self, key: str) -> tuple[float, float]:
        """Return x, y."""
        x, y = self.numbers(key, 2)
        return x, y

    def points(self, key: str) -> list[tuple[float, float]]:
        """Return at least two points."""
        value = self.items(key, "at least two points")
        if len(value) < 2:
            raise self.refuse(f"'{key}' must be a list of at least two points", key)
        return [(x, y) for x, y in (self.checked(item, key, 2) for item in value)]


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) <= MAX_NUMBER
