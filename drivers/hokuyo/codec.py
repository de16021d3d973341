"""SCIP replies: bytes in, events out. Knows no clock, port or task.

A reply is echo, status, data lines and an empty line. Everything that can be checked is: the echo's grammar,
every sum, the characters of numbers, the length of each line and the number of beams the echo promises.
Inside refused bytes the next echo with a status is looked for, so one damaged reply costs only itself. Of a
damaged scan the lines that are right in length, characters and sum are kept, and the beams on the others are
marked.
"""

import re
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from lemtomap.drivers.hokuyo.numbers import (
    BadDigitError,
    decode_number,
    digits_of,
    join_digits,
    line_sum,
)
from lemtomap.drivers.hokuyo.packets import (
    ACCEPTED,
    BLOCK,
    DATA,
    ECHO,
    REPLY_START,
    BadReply,
    ClockReading,
    Info,
    ScanFrame,
    Status,
)

Reply: TypeAlias = Status | Info | ClockReading | ScanFrame | BadReply

_LONGEST: Final = 8192  # a scan of 1081 beams has 3.4 kB
_END: Final = b"\n\n"
_SCAN_ECHO: Final = re.compile(r"([GM][DS])(\d{4})(\d{4})(\d{2})(?:(\d)(\d{2}))?")
_FIELD: Final = re.compile(rb"([A-Z]{4}):(.*);([0-o])", re.DOTALL)
_SCIP1_STATUS: Final = re.compile(
    rb"0|E[0-9A-Z]?"
)  # a sensor that switches to SCIP 2.0, or does not know a command
_STRIDE: Final = BLOCK + 2  # a full data line with its sum and line feed


class _RefusedError(ValueError):
    """The bytes are no reply."""


class Decoder:
    """Turns any split of the byte stream into the same events."""

    def __init__(self) -> None:
        self._buffer = bytearray()

    def feed(self, data: bytes) -> list[Reply]:
        """Take bytes as they come and return what they complete, in order. Never raises."""
        events: list[Reply] = []
        buffer = self._buffer
        buffer += data
        while True:
            while buffer.startswith(b"\n"):
                del buffer[0]
            end = buffer.find(_END, 0, _LONGEST)
            if end >= 0:
                events += _read(bytes(buffer[: end + len(_END)]))
                del buffer[: end + len(_END)]
            elif len(buffer) >= _LONGEST:
                events.append(self._cut())
            else:
                return events

    def _cut(self) -> BadReply:
        """Drop bytes without an end, up to the next thing that looks like a reply."""
        start = REPLY_START.search(self._buffer, 1, _LONGEST)
        size = start.start() if start else _LONGEST
        dropped = bytes(self._buffer[:size])
        del self._buffer[:size]
        return BadReply(dropped, "no end of reply")


def _read(data: bytes) -> list[Reply]:
    """Return the reply that `data` is, or those inside it with the rest marked bad."""
    try:
        return [_strict(data)]
    except _RefusedError as error:
        reason = str(error)
    inner = REPLY_START.search(data, 1)
    damaged = data[: inner.start()] if inner else data
    first = _salvage(damaged) or BadReply(damaged, reason)
    return [first, *(_read(data[inner.start() :]) if inner else [])]


def _strict(data: bytes) -> Reply:
    echo_line, _, rest = data.partition(b"\n")
    status_line, _, body = rest.partition(b"\n")
    echo = ECHO.fullmatch(echo_line)
    if echo is None:
        raise _RefusedError("no echo of a command")
    command, tag = echo["command"].decode(), (echo["tag"] or b"").decode()
    body = body.removesuffix(b"\n")
    if not body and _SCIP1_STATUS.fullmatch(status_line):
        return Status(command, status_line.decode(), tag)
    if len(status_line) != 3 or status_line[2] != line_sum(status_line[:2]):
        raise _RefusedError("no status with a right sum")
    status = status_line[:2].decode("ascii", "replace")
    if not body:
        return Status(command, status, tag)
    return _with_data(command, status, body, tag)


def _with_data(command: str, status: str, body: bytes, tag: str) -> Reply:
    if status == ACCEPTED and command in {"VV", "PP", "II"}:
        return _info(command, body, tag)
    if status == ACCEPTED and command == "TM1":
        return ClockReading(_stamp(body.removesuffix(b"\n")), tag)
    scan = _SCAN_ECHO.fullmatch(command)
    if scan is not None and status == (DATA if command[0] == "M" else ACCEPTED):
        stamp_line, _, lines = body.partition(b"\n")
        frame = _Expected(scan)
        return frame.build(_stamp(stamp_line), frame.decode(lines), None, tag)
    raise _RefusedError("data where none belong")


def _stamp(line: bytes) -> int:
    if len(line) != 5 or line[4] != line_sum(line[:4]):
        raise _RefusedError("no time stamp with a right sum")
    try:
        return decode_number(line[:4])
    except BadDigitError as error:
        raise _RefusedError(str(error)) from error


class _Expected:
    """What an echo promises of the data behind it."""

    def __init__(self, echo: re.Match[str]) -> None:
        kind, start, end, cluster, interval, remaining = echo.groups()
        self.command = echo[0][:12]
        self.start, self.end, self.cluster = int(start), int(end), int(cluster)
        self.interval = None if interval is None else int(interval)
        self.remaining = None if remaining is None else int(remaining)
        if self.end < self.start or (kind[0] == "M") != (interval is not None):
            raise _RefusedError("echo of an impossible scan")
        self.chars = 3 if kind[1] == "D" else 2
        beams = (self.end - self.start) // max(1, self.cluster) + 1
        self.full_lines, self.rest = divmod(beams * self.chars, BLOCK)

    def build(
        self, stamp_ms: int, digits: NDArray[np.uint8], intact: NDArray[np.bool_] | None, tag: str
    ) -> ScanFrame:
        raw_mm = join_digits(digits, self.chars)
        valid = None if intact is None else np.all(intact.reshape(-1, self.chars), axis=1)
        raw_mm.setflags(write=False)
        return ScanFrame(
            self.command,
            self.start,
            self.end,
            self.cluster,
            self.interval,
            self.remaining,
            stamp_ms,
            raw_mm,
            valid,
            tag,
        )

    def decode(self, lines: bytes) -> NDArray[np.uint8]:
        """Return all digits of intact data lines."""
        size = self.full_lines * _STRIDE
        if len(lines) != size + (self.rest + 2 if self.rest else 0):
            raise _RefusedError("not as many beams as the echo promises")
        table = digits_of(lines[:size]).reshape(-1, _STRIDE)
        last = digits_of(lines[size:])[None, :]
        blocks = [part for part in (table, last) if part.size]
        if not all(_lines_right(part).all() for part in blocks):
            raise _RefusedError("a data line failed its sum")
        return np.concatenate([part[:, :-2].ravel() for part in blocks])

    def salvage(self, lines: bytes) -> tuple[NDArray[np.uint8], NDArray[np.bool_]] | None:
        """Return all digits and which of them are right, or None when lines cannot be told apart."""
        sizes = [BLOCK] * self.full_lines + ([self.rest] if self.rest else [])
        rows = lines.rstrip(b"\n").split(b"\n")
        slots = [max(1, round((len(row) + 1) / _STRIDE)) for row in rows]
        if sum(slots) != len(sizes):
            return None
        digits = np.zeros(sum(sizes), dtype=np.uint8)
        intact = np.zeros(sum(sizes), dtype=np.bool_)
        line = 0
        for row, slot in zip(rows, slots, strict=True):
            size = sizes[line]
            if slot == 1 and len(row) == size + 1 and _line_right(row):
                digits[line * BLOCK : line * BLOCK + size] = digits_of(row[:-1])
                intact[line * BLOCK : line * BLOCK + size] = True
            line += slot
        return (digits, intact) if intact.any() else None


def _line_right(row: bytes) -> bool:
    data = row[:-1]
    return row[-1] == line_sum(data) and min(data) >= 0x30 and max(data) <= 0x6F


def _lines_right(table: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Tell for each row of uint8 (lines, digits + sum + line feed) whether it is right; the sum is over
    characters, each 0x30 more than its digit.
    """
    data, sums, ends = table[:, :-2], table[:, -2], table[:, -1]
    total = data.sum(axis=1, dtype=np.int64) + 0x30 * data.shape[1]
    feed = np.uint8((0x0A - 0x30) & 0xFF)
    return np.asarray(((total & 0x3F) == sums) & (ends == feed) & (data <= 0x3F).all(axis=1))


def _info(command: str, body: bytes, tag: str) -> Info:
    fields: dict[str, str] = {}
    doubtful = set()
    stray = 0
    for line in body.splitlines():
        match = _FIELD.fullmatch(line)
        if match is None:
            stray += 1
            continue
        key = match[1].decode()
        if key in fields or not _info_sum_right(match):
            doubtful.add(key)
        fields.setdefault(key, match[2].decode("ascii", "replace"))
    if not fields:
        raise _RefusedError("no field in an information reply")
    return Info(command, fields, frozenset(doubtful), stray, tag)


def _info_sum_right(match: re.Match[bytes]) -> bool:
    """Return True if the sum is right in any of the readings found in the field: without `;` (all recorded
    sensors), with it, or without the `<-` remark of II (some UTM-30LX firmware).
    """
    text = match[1] + b":" + match[2]
    return match[3][0] in {line_sum(text), line_sum(text + b";"), line_sum(text.partition(b"<-")[0])}


def _salvage(data: bytes) -> ScanFrame | None:
    """Return a damaged scan whose echo, status and stamp are right, its bad lines marked."""
    echo_line, _, rest = data.partition(b"\n")
    status_line, _, rest = rest.partition(b"\n")
    stamp_line, _, lines = rest.partition(b"\n")
    echo = ECHO.fullmatch(echo_line)
    scan = _SCAN_ECHO.fullmatch(echo["command"].decode()) if echo else None
    if echo is None or scan is None or status_line != (b"99b" if scan[1][0] == "M" else b"00P"):
        return None
    try:
        expected, stamp_ms = _Expected(scan), _stamp(stamp_line)
    except _RefusedError:
        return None
    kept = expected.salvage(lines)
    return None if kept is None else expected.build(stamp_ms, *kept, (echo["tag"] or b"").decode())
