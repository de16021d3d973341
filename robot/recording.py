"""Everything a run was told and did, in one MCAP file; and back again, call for call.

What is recorded of a device is each call of its session: bytes received, ticks, and the bytes that the
session wanted to send, with the clock value that the session was given. Feeding the same calls to a fresh
session gives the same samples bit for bit, because sessions know no other clock.

    /kobuki/rx /hokuyo/rx        bytes from the device
    /kobuki/tx /hokuyo/tx        bytes to the device
    /kobuki/tick /hokuyo/tick    empty: the session was asked what it wants
    /kobuki/port /hokuyo/port    text: "opened", "lost" (a new session state begins)
    /odom /pose /cmd_vel /navigation /log ...   JSON, derived

`log_time` is the run's clock in nanoseconds from its start. A file cut short (power, kill -9) stays readable
up to its last whole chunk.
"""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader
from mcap.writer import CompressionType, Writer

from lemtomap.errors import BadLog

CHUNK_BYTES = 64 * 1024  # some five seconds of both devices: what a crash may lose
RAW_ENCODING, JSON_ENCODING = "application/octet-stream", "json"
LIBRARY = "lemtomap"


class Call(StrEnum):
    """What was asked of a session."""

    RECEIVE = "rx"
    SEND = "tx"
    TICK = "tick"
    PORT = "port"


@dataclass(frozen=True, slots=True)
class Entry:
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


class Recorder:
    """Writes one run.mcap. Calls come from one thread."""

    def __init__(self, path: Path, metadata: Mapping[str, str] | None = None) -> None:
        self.path = path
        self._file = path.open("wb")
        self._writer = Writer(self._file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
        self._writer.start(profile="", library=LIBRARY)
        self._channels: dict[str, int] = {}
        self._schema_id = self._writer.register_schema("lemtomap", "jsonschema", b'{"type": "object"}')
        if metadata:
            self._writer.add_metadata("run", dict(metadata))

    def raw(self, entry: Entry) -> None:
        """Write one call of a session."""
        self._add(f"/{entry.device}/{entry.call}", RAW_ENCODING, entry.stamp_ns, entry.data)

    def derived(self, topic: str, stamp_s: float, values: Mapping[str, Any]) -> None:
        """Write something that follows from the raw bytes, for people and plots."""
        data = json.dumps(values, separators=(",", ":")).encode()
        self._add(topic, JSON_ENCODING, round(stamp_s * 1e9), data)

    def close(self) -> None:
        """Finish the file; closing twice is fine."""
        if not self._file.closed:
            self._writer.finish()  # type: ignore[no-untyped-call]
            self._file.close()

    def _add(self, topic: str, encoding: str, stamp_ns: int, data: bytes) -> None:
        channel_id = self._channels.get(topic)
        if channel_id is None:
            schema_id = self._schema_id if encoding == JSON_ENCODING else 0
            channel_id = self._writer.register_channel(topic, encoding, schema_id)
            self._channels[topic] = channel_id
        self._writer.add_message(channel_id, stamp_ns, data, stamp_ns)


def find_recording(path: Path) -> Path:
    """Return the run.mcap meant by a run's folder or a file."""
    file = path / "run.mcap" if path.is_dir() else path
    if not file.is_file():
        raise BadLog(f"{file}: no such recording")
    return file


def read_entries(path: Path) -> Iterator[Entry]:
    """Yield every recorded session call in order. Raises BadLog when the file is no recording."""
    calls = {str(call): call for call in Call}
    count = 0
    for topic, stamp_ns, data in _messages(path):
        _, _, rest = topic.partition("/")
        device, _, kind = rest.partition("/")
        if kind in calls:
            count += 1
            yield Entry(device, calls[kind], stamp_ns, data)
    if count == 0:
        raise BadLog(f"{path}: holds no bytes of a robot's ports")


def read_derived(path: Path, topic: str) -> Iterator[tuple[float, dict[str, Any]]]:
    """Yield (stamp_s, values) of one derived topic in order."""
    for name, stamp_ns, data in _messages(path):
        if name == topic:
            yield stamp_ns * 1e-9, json.loads(data)


def _messages(path: Path) -> Iterator[tuple[str, int, bytes]]:
    """Yield (topic, log time, data) in file order, as far as the file goes."""
    seen = 0
    with path.open("rb") as file:
        try:
            for _, channel, message in NonSeekingReader(file).iter_messages(log_time_order=False):
                seen += 1
                yield channel.topic, message.log_time, message.data
        except (McapError, EOFError, ValueError) as error:
            if seen == 0:
                raise BadLog(f"{path}: not a recording ({error})") from error
