"""Kobuki frames: bytes in, events out; commands in, bytes out. Knows no clock, port or task.

A frame is `AA 55 LEN payload XOR`, the payload a row of `ID SIZE DATA`. An XOR of 8 bits is weak: a frame
that lost zeros keeps its sum while the reader runs into the next frame. So a frame also has to begin with ID
1 of SIZE 15, its sub-payloads must tile LEN exactly with the sizes of the table, none twice, and hold only
values the device can send. Bytes of a refused frame are searched again from its second byte on, so one
damaged frame costs only itself.
"""

import functools
import operator
from typing import Any, Final

from lemtomap.drivers.kobuki.commands import Command
from lemtomap.drivers.kobuki.packets import (
    HEADER,
    MAX_PAYLOAD,
    BadFrame,
    Feedback,
)
from lemtomap.drivers.kobuki.subpayloads import SUB_PAYLOADS, ImpossibleValueError

_OVERHEAD: Final = 4  # header, LEN, checksum
_MIN_PAYLOAD: Final = 17  # ID 1 alone
_FIRST: Final = b"\x01\x0f"
_JUNK_LIMIT: Final = 1024  # a longer run of rejected bytes is reported in pieces


def checksum(data: bytes) -> int:
    """Return the XOR of all bytes."""
    return functools.reduce(operator.xor, data, 0)


def encode(*commands: Command) -> bytes:
    """Return one frame that carries all commands. Raises ValueError when they do not fit into one."""
    parts = ((command.id, command.data()) for command in commands)
    payload = b"".join(bytes([number, len(data)]) + data for number, data in parts)
    if not 0 < len(payload) <= MAX_PAYLOAD:
        raise ValueError(f"{len(payload)} bytes of commands do not make a frame (1 to {MAX_PAYLOAD})")
    body = bytes([len(payload)]) + payload
    return HEADER + body + bytes([checksum(body)])


class Decoder:
    """Turns any split of the byte stream into the same events."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._junk = bytearray()
        self._junk_reason = ""

    def feed(self, data: bytes) -> list[Feedback | BadFrame]:
        """Take bytes as they come and return what they complete, in order. Never raises."""
        events: list[Feedback | BadFrame] = []
        buffer = self._buffer
        buffer += data
        position = 0
        while True:
            start = buffer.find(HEADER, position)
            if start < 0:
                end = len(buffer) - (1 if buffer.endswith(HEADER[:1]) else 0)
                self._reject(events, max(position, end), position)
                position = max(position, end)
                break
            self._reject(events, start, position)
            position = start
            verdict = self._examine(start)
            if verdict is None:
                break
            if isinstance(verdict, str):
                self._junk_reason = self._junk_reason or verdict
                self._reject(events, start + 1, start)
                position = start + 1
            else:
                self._flush_junk(events)
                events.append(verdict)
                position = start + _OVERHEAD + buffer[start + 2]
        del buffer[:position]
        return events

    def _examine(self, start: int) -> Feedback | str | None:
        """Return the frame at `start`, why it is none, or None while more bytes are needed.

        Every check looks only at bytes already there and at nothing that later bytes could change, so the
        verdict does not depend on how the stream was split.
        """
        buffer = self._buffer
        if len(buffer) < start + 5:
            return None
        if buffer[start + 2] < _MIN_PAYLOAD or buffer[start + 3 : start + 5] != _FIRST:
            return "does not begin with the basic sensor data"
        end = start + 3 + buffer[start + 2]
        spans = self._tile(start + 3, end)
        if not isinstance(spans, dict) or len(buffer) <= end:
            return spans if isinstance(spans, str) else None
        if checksum(bytes(buffer[start + 2 : end + 1])):
            return "wrong checksum"
        return self._parse(spans)

    def _tile(self, at: int, end: int) -> dict[int, tuple[int, int]] | str | None:
        """Return where the data of each sub-payload lies, why they do not tile, or None as above."""
        buffer = self._buffer
        spans: dict[int, tuple[int, int]] = {}
        while at < end:
            if len(buffer) < at + 2:
                return None
            number, size = buffer[at], buffer[at + 1]
            known = SUB_PAYLOADS.get(number)
            if at + 2 + size > end or number in spans or (known is not None and size not in known.sizes):
                return f"sub-payload {number} of {size} bytes does not fit"
            spans[number] = (at + 2, at + 2 + size)
            at += 2 + size
        return spans

    def _parse(self, spans: dict[int, tuple[int, int]]) -> Feedback | str:
        fields: dict[str, Any] = {}
        unknown = []
        for number, (begin, end) in spans.items():
            data = bytes(self._buffer[begin:end])
            known = SUB_PAYLOADS.get(number)
            if known is None:
                unknown.append((number, data))
                continue
            try:
                fields[known.field] = known.parse(data)
            except ImpossibleValueError as error:
                return str(error)
        return Feedback(**fields, unknown=tuple(unknown))

    def _reject(self, events: list[Feedback | BadFrame], end: int, begin: int) -> None:
        self._junk += self._buffer[begin:end]
        while len(self._junk) >= _JUNK_LIMIT:
            self._emit_junk(events, _JUNK_LIMIT)

    def _flush_junk(self, events: list[Feedback | BadFrame]) -> None:
        if self._junk:
            self._emit_junk(events, len(self._junk))

    def _emit_junk(self, events: list[Feedback | BadFrame], size: int) -> None:
        events.append(BadFrame(bytes(self._junk[:size]), self._junk_reason or "no frame header"))
        del self._junk[:size]
        self._junk_reason = ""
