"""Everything a run was told and did, in MCAP files that can be replayed call for call (`recorded`).

What is recorded of a device is each call of its session: bytes received, ticks, and the bytes that the
session wanted to send, with the clock value that the session was given. Feeding the same calls to a fresh
session gives the same samples bit for bit, because sessions know no other clock.

    /run                         JSON: settings of the run, once in each part
    /kobuki/rx /hokuyo/rx        bytes from the device
    /kobuki/tx /hokuyo/tx        bytes to the device
    /kobuki/tick /hokuyo/tick    empty: the session was asked what it wants
    /kobuki/port /hokuyo/port    text: "opened", "lost" (a new session begins), "up" (the laser streams)
    /hokuyo/again/rx ...         the laser's conversation until it streamed, once more; see below
    /map/scan                    JSON: a scan that was mapped, and navigation's events before it
    /pose /base /navigation /log   JSON, derived

`log_time` is the run's clock in nanoseconds from its start. A file cut short (power, kill -9) stays readable
up to its last whole chunk. A long run goes on in further parts, and beyond a limit the oldest part goes
(`parts`). The laser says only once what its ranges mean, when it connects; so every part but the first
begins with that conversation again, and the last one ends with it.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from itertools import product
from pathlib import Path
from typing import Any

from mcap.writer import CompressionType, Writer

from lemtomap.robot.devices.parts import DEFAULT_LIMIT, PartFiles

CHUNK_BYTES = 32 * 1024  # some 2.5 seconds of both devices: what a crash or a bad block may lose
MOST_OPENING_CALLS = 2000  # of a laser's conversation before it streams (40 s); a longer one is not kept
RAW_ENCODING, JSON_ENCODING = "application/octet-stream", "json"
LIBRARY = "lemtomap/2"
KOBUKI, HOKUYO = "kobuki", "hokuyo"
OPENED, LOST, UP = b"opened", b"lost", b"up"
RUN_TOPIC, SCAN_TOPIC = "/run", "/map/scan"


class Call(StrEnum):
    """What was asked of a session."""

    RECEIVE = "rx"
    SEND = "tx"
    TICK = "tick"
    PORT = "port"


@dataclass(frozen=True, slots=True)
class RecordedCall:
    """One call of a device's session."""

    device: str
    """"kobuki" or "hokuyo"."""
    call: Call
    stamp_ns: int
    data: bytes = b""

    @property
    def now_s(self) -> float:
        """The clock value that the session was given."""
        return self.stamp_ns * 1e-9


RAW_TOPICS: dict[str, tuple[str, Call]] = {
    f"/{device}/{call}": (device, call) for device, call in product((KOBUKI, HOKUYO), Call)
}
AGAIN_TOPICS: dict[str, tuple[str, Call]] = {
    f"/{HOKUYO}/again/{call}": (HOKUYO, call) for call in (Call.RECEIVE, Call.TICK, Call.PORT)
}
CHANNELS = dict(enumerate((*RAW_TOPICS, *AGAIN_TOPICS), start=1))
"""These get their numbers first, so that they are known even when the chunk that tells them is lost."""


class LaserConversation:
    """The laser's conversation from the opening of its port until it streams."""

    def __init__(self) -> None:
        self._calls: list[RecordedCall] = []
        self._streams = self._dropped = False

    @property
    def calls(self) -> list[RecordedCall]:
        """All of it, once the laser streams; else nothing."""
        return self._calls if self._streams else []

    def take(self, entry: RecordedCall) -> None:
        """Keep a call that belongs to it."""
        if entry.device != HOKUYO:
            return
        if entry.call is Call.PORT and entry.data == OPENED:
            self._calls, self._streams, self._dropped = [], False, False
        if self._streams or self._dropped or entry.call is Call.SEND:
            return
        self._calls.append(entry)
        self._streams = entry.call is Call.PORT and entry.data == UP
        if len(self._calls) > MOST_OPENING_CALLS and not self._streams:
            self._calls, self._dropped = [], True


class Recorder:
    """Writes run.mcap and its further parts. Calls come from one thread."""

    def __init__(
        self, path: Path, about: Mapping[str, Any] | None = None, limit_bytes: int = DEFAULT_LIMIT
    ) -> None:
        """`about` is told in each part: see lemtomap.robot.devices.recorded.Recording.about."""
        self.parts = PartFiles(path, limit_bytes)
        self._about = dict(about or {})
        self._opening = LaserConversation()
        self._closed = False
        self._stamp_ns = 0
        self._begin_part()

    def raw(self, entry: RecordedCall) -> None:
        """Write one call of a session."""
        self._roll_when_full()
        self._opening.take(entry)
        self._stamp_ns = entry.stamp_ns
        self._add(f"/{entry.device}/{entry.call}", RAW_ENCODING, entry.stamp_ns, entry.data)

    def derived(self, topic: str, stamp_s: float, values: Mapping[str, Any]) -> None:
        """Write something that follows from the raw bytes, for people and plots."""
        data = json.dumps(values, separators=(",", ":")).encode()
        self._add(topic, JSON_ENCODING, max(0, round(stamp_s * 1e9)), data)

    def close(self) -> None:
        """Finish the file; closing twice is fine."""
        if self._closed:
            return
        self._closed = True
        self._write_opening()
        self._end_part()

    def _begin_part(self) -> None:
        self._file = self.parts.path.open("wb")
        self._writer = Writer(self._file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
        self._writer.start(profile="", library=LIBRARY)
        self._channels = {
            topic: self._writer.register_channel(topic, RAW_ENCODING, 0) for topic in CHANNELS.values()
        }
        self._schema_id = self._writer.register_schema("lemtomap", "jsonschema", b'{"type": "object"}')
        self.derived(RUN_TOPIC, self._stamp_ns * 1e-9, {**self._about, "part": self.parts.number})

    def _end_part(self) -> None:
        try:
            self._writer.finish()  # type: ignore[no-untyped-call]
        finally:
            self._file.close()

    def _roll_when_full(self) -> None:
        if self._file.tell() < self.parts.part_bytes:
            return
        self._end_part()
        self.parts.advance()
        self._begin_part()
        self._write_opening()

    def _write_opening(self) -> None:
        for entry in self._opening.calls:
            topic = f"/{entry.device}/again/{entry.call}"
            self._add(topic, RAW_ENCODING, self._stamp_ns, entry.data, made_ns=entry.stamp_ns)

    def _add(
        self, topic: str, encoding: str, stamp_ns: int, data: bytes, *, made_ns: int | None = None
    ) -> None:
        channel_id = self._channels.get(topic)
        if channel_id is None:
            schema_id = self._schema_id if encoding == JSON_ENCODING else 0
            channel_id = self._writer.register_channel(topic, encoding, schema_id)
            self._channels[topic] = channel_id
        self._writer.add_message(channel_id, stamp_ns, data, stamp_ns if made_ns is None else made_ns)
