"""A recording as it is found: all its parts in order, whatever became of them, and what is missing.

Whole, it gives every call of both sessions in the order in which they were made. Where bytes are missing a
Gap stands in their place.
"""

import json
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lemtomap.errors import BadLog
from lemtomap.robot.devices.mapped_scan import MappedScan, from_values
from lemtomap.robot.devices.mcap_file import Hole, McapFile, Message
from lemtomap.robot.devices.parts import part_number, parts_of
from lemtomap.robot.devices.recording import (
    AGAIN_TOPICS,
    CHANNELS,
    HOKUYO,
    OPENED,
    RAW_TOPICS,
    RUN_TOPIC,
    SCAN_TOPIC,
    UP,
    Call,
    RecordedCall,
)

PLACES_AT_ONCE = 5  # of damage named to the user


@dataclass(frozen=True, slots=True)
class Gap:
    """Bytes are missing here."""

    from_s: float
    until_s: float | None
    """None: nothing comes after it."""
    reason: str

    def __str__(self) -> str:
        if self.until_s is None:
            return f"it ends at {self.from_s:.1f} s: {self.reason}"
        return f"bytes are missing from {self.from_s:.1f} to {self.until_s:.1f} s: {self.reason}"


class Recording:
    """All parts of one recording, looked through."""

    def __init__(self, files: list[McapFile], path: Path) -> None:
        self.path = path
        self._files = files
        self.about: dict[str, Any] = {}
        """What the run said of itself: `slam`, `seed`, `config`, `new_map`, `title`."""
        self.begins_s, self.ends_s = 0.0, 0.0
        self.gaps: list[Gap] = []
        self._look_through()

    @classmethod
    def open(cls, path: Path) -> "Recording":
        """Open a run's folder or its run.mcap. Raises BadLog when there is no recording in it."""
        if path.is_file():
            first = path
            paths = parts_of(path) if path.name == "run.mcap" else [path]
        else:
            first = path / "run.mcap"
            paths = parts_of(first)
        if not paths:
            raise BadLog(f"{first}: no such recording")
        files, refused = list[McapFile](), list[BadLog]()
        for part in paths:
            try:
                files.append(McapFile(part))
            except BadLog as error:
                refused.append(error)
        if not files:
            raise refused[0]
        return cls(files, first)

    @property
    def whole(self) -> bool:
        """Whether nothing is missing, from the run's first byte to its last."""
        return not self.gaps and self.begins_at_start

    @property
    def begins_at_start(self) -> bool:
        """Whether the oldest part is the run's first; a recording that passed its limit lost that."""
        return part_number(self._files[0].path) == 1

    def entries(self) -> Iterator[RecordedCall | Gap]:
        """Yield every session's call in order, and a gap wherever bytes are missing."""
        gaps, streams = iter(self.gaps), False
        if not self.begins_at_start:
            yield from self._opening()
        for found in self._sound():
            if isinstance(found, Hole):
                gap = next(gaps)
                yield gap
                if not streams and gap.until_s is not None:
                    yield from self._opening()
            elif found.topic in RAW_TOPICS:
                entry = RecordedCall(*RAW_TOPICS[found.topic], found.stamp_ns, found.data)
                streams = streams or (entry.call is Call.PORT and entry.data == UP)
                yield entry

    def scans(self) -> Iterator[MappedScan]:
        """Yield what was mapped, in order; records that make no sense are left out."""
        for _, values in self.derived(SCAN_TOPIC):
            with suppress(ValueError):
                yield from_values(values)

    def derived(self, topic: str) -> Iterator[tuple[float, dict[str, Any]]]:
        """Yield (stamp_s, values) of one derived topic in order."""
        for found in self._sound():
            if isinstance(found, Message) and found.topic == topic:
                values = _values(found)
                if values is not None:
                    yield found.stamp_ns * 1e-9, values

    def told_gaps(self) -> str:
        """Return what is missing, in words; "" when nothing is."""
        told = [str(gap) for gap in self.gaps[:PLACES_AT_ONCE]]
        if len(self.gaps) > PLACES_AT_ONCE:
            told.append(f"and {len(self.gaps) - PLACES_AT_ONCE} more gaps")
        if not self.begins_at_start:
            told.insert(0, f"it begins at {self.begins_s:.1f} s: older parts are gone")
        return "; ".join(told)

    def _sound(self) -> Iterator[Message | Hole]:
        """Yield the messages of all parts, and a hole before the next session call when some are lost."""
        hole: Hole | None = None
        for found in self._pieces():
            if isinstance(found, Hole):
                hole = hole or found
                continue
            if hole is not None and found.topic in RAW_TOPICS:
                yield hole
                hole = None
            yield found
        if hole is not None:
            yield hole

    def _pieces(self) -> Iterator[Message | Hole]:
        """Yield messages and holes of all parts as they stand in the files."""
        before: int | None = None
        for file in self._files:
            number = part_number(file.path)
            if before is not None and number != before + 1:
                yield Hole(0, "a part is gone, or damaged all over")
            before = number
            yield from file.messages(fallback=CHANNELS)
            if not file.finished:
                yield Hole(0, "it was not closed")

    def _look_through(self) -> None:
        """Find out when it begins and ends, what it says of itself, and where bytes are missing."""
        first_ns, last_ns = None, 0
        hole: Hole | None = None
        for found in self._sound():
            if isinstance(found, Hole):
                hole = found
            elif found.topic in RAW_TOPICS:
                if hole is not None:
                    from_s = 0.0 if first_ns is None else last_ns * 1e-9
                    self.gaps.append(Gap(from_s, found.stamp_ns * 1e-9, hole.reason))
                    hole = None
                first_ns = found.stamp_ns if first_ns is None else first_ns
                last_ns = max(last_ns, found.stamp_ns)
            elif found.topic == RUN_TOPIC and not self.about:
                self.about = _values(found) or {}
        if first_ns is None:
            raise BadLog(f"{self.path}: holds no bytes of a robot's ports")
        if hole is not None:
            self.gaps.append(Gap(last_ns * 1e-9, None, hole.reason))
        self.begins_s, self.ends_s = first_ns * 1e-9, last_ns * 1e-9

    def _opening(self) -> list[RecordedCall]:
        """Return the laser's conversation as it was first written again."""
        calls: list[RecordedCall] = []
        for found in self._sound():
            if isinstance(found, Message) and found.topic in AGAIN_TOPICS:
                opened = RecordedCall(HOKUYO, Call.PORT, found.made_ns, OPENED)
                calls += [] if calls else [opened]
                calls.append(RecordedCall(*AGAIN_TOPICS[found.topic], found.made_ns, found.data))
                if calls[-1].call is Call.PORT and found.data == UP:
                    break
        return calls


def _values(message: Message) -> dict[str, Any] | None:
    """Return what a derived message tells; None when that makes no sense."""
    try:
        values = json.loads(message.data)
    except (ValueError, RecursionError):
        return None
    return values if isinstance(values, dict) else None
