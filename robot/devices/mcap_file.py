"""One MCAP file read as far as it is sound: a damaged chunk costs that chunk, a cut what comes after it.

The file is looked through once when it is opened. Every chunk must unpack to its size and checksum, and hold
nothing but whole records; where the records' own lengths are damaged, the next chunk is searched for. A file
of another program is read as well, as far as it packs its chunks as ours are packed (zstd, or not at all).
"""

import mmap
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import zstandard
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from lemtomap.errors import BadLog

RECORD = struct.Struct("<BQ")
CHUNK_HEAD = struct.Struct("<QQQII")  # first and last time, unpacked size, checksum, length of the next name
MESSAGE_HEAD = struct.Struct("<HIQQ")  # channel, sequence, log and publish time
LARGEST_CHUNK = 64 * 2**20  # unpacked; ours have 32 kB
REPEATED = 3  # chunks back, in which a repeated one is looked for
ZSTD_NAME = b"\x04\x00\x00\x00zstd"
NAME_AT = RECORD.size + CHUNK_HEAD.size - 4


class Damaged(ValueError):
    """A stretch of the file is not what it should be."""


@dataclass(frozen=True, slots=True)
class Message:
    """One recorded message."""

    topic: str
    stamp_ns: int
    made_ns: int
    """When it came to be; `stamp_ns` is when it was written, which differs for what is written again."""
    data: bytes


@dataclass(frozen=True, slots=True)
class Chunk:
    """Where a sound chunk's content lies in the file, and the first and last time in it."""

    start: int
    end: int
    from_ns: int
    until_ns: int
    checksum: int


@dataclass(frozen=True, slots=True)
class Hole:
    """A stretch of the file that cannot be read."""

    size: int
    reason: str


class McapFile:
    """The sound chunks of a file and the holes between them, in file order."""

    def __init__(self, path: Path) -> None:
        """Look through the file. Raises BadLog when no part of it is a recording."""
        self.path = path
        self.finished = False
        """Whether the writer closed it; if not, its last seconds may be missing."""
        self.content: list[Chunk | Hole] = []
        self._topics: dict[int, str] = {}
        with path.open("rb") as file:
            size = path.stat().st_size
            if size == 0:
                raise BadLog(f"{path}: the file is empty")
            with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
                self._survey(data)
        if not any(isinstance(part, Chunk) for part in self.content):
            holes = [part.reason for part in self.content if isinstance(part, Hole)]
            raise BadLog(f"{path}: not a recording ({holes[0] if holes else 'nothing is in it'})")

    def messages(self, *, fallback: dict[int, str] | None = None) -> Iterator[Message | Hole]:
        """Yield everything in file order. `fallback` names channels that the file itself lost."""
        topics = {**(fallback or {}), **self._topics}
        with self.path.open("rb") as file:
            for part in self.content:
                if isinstance(part, Hole):
                    yield part
                    continue
                file.seek(part.start)
                payload = unpacked(file.read(part.end - part.start))
                for opcode, start, end in inner_records(payload):
                    if opcode == Opcode.MESSAGE:
                        channel, _, stamp_ns, made_ns = MESSAGE_HEAD.unpack_from(payload, start)
                        if channel in topics:
                            data = payload[start + MESSAGE_HEAD.size : end]
                            yield Message(topics[channel], stamp_ns, made_ns, data)

    def _survey(self, data: mmap.mmap) -> None:
        at, size = len(MCAP0_MAGIC), len(data)
        if data[:at] != MCAP0_MAGIC:
            at = self._skip(data, 0, "it does not begin as one")
        while at < size:
            try:
                opcode, start, end = _record(data, at)
            except Damaged as error:
                if self.finished:  # behind the data there is only what was written before
                    return
                at = self._skip(data, at, str(error))
            else:
                self._take(data, opcode, start, end)
                at = end

    def _skip(self, data: mmap.mmap, at: int, reason: str) -> int:
        """Note a hole from here to the next chunk, or to the end; return where that is."""
        found = _next_chunk(data, at + 1)
        self.content.append(Hole(found - at, reason))
        return found

    def _take(self, data: mmap.mmap, opcode: int, start: int, end: int) -> None:
        """Take note of a record; of a chunk that is not sound, as a hole."""
        if opcode == Opcode.CHUNK and not self.finished:
            try:
                chunk = self._chunk(data[start:end], start, end)
                self.content += [chunk] if chunk is not None and self._is_new(chunk) else []
            except Damaged as error:
                self.content.append(Hole(end - start, str(error)))
        elif opcode == Opcode.CHANNEL:
            self._learn_topic(data[start:end])
        self.finished = self.finished or opcode == Opcode.DATA_END

    def _chunk(self, content: bytes, start: int, end: int) -> Chunk | None:
        """Look a chunk through; None: it has no messages. Raises Damaged."""
        payload = unpacked(content)
        stamps: list[int] = []
        for opcode, first, last in inner_records(payload):
            if opcode == Opcode.MESSAGE:
                stamps.append(MESSAGE_HEAD.unpack_from(payload, first)[2])
            elif opcode == Opcode.CHANNEL:
                self._learn_topic(payload[first:last])
        if not stamps:
            return None
        return Chunk(start, end, min(stamps), max(stamps), zlib.crc32(payload))

    def _is_new(self, chunk: Chunk) -> bool:
        """Return False for a chunk that stood here before. Raises Damaged when its time is over."""
        before = [part for part in self.content[-2 * REPEATED :] if isinstance(part, Chunk)]
        if any(
            (part.from_ns, part.checksum) == (chunk.from_ns, chunk.checksum) for part in before[-REPEATED:]
        ):
            return False
        if before and chunk.until_ns < before[-1].from_ns:
            raise Damaged("a chunk that belongs further up")
        return True

    def _learn_topic(self, content: bytes) -> None:
        """Keep a channel's name; the first that a number gets counts."""
        try:
            channel, _, length = struct.unpack_from("<HHI", content)
            topic = bytes(content[8 : 8 + length]).decode()
        except (struct.error, UnicodeDecodeError):
            return
        self._topics.setdefault(channel, topic)


def _record(data: mmap.mmap, at: int) -> tuple[int, int, int]:
    """Return (opcode, start, end) of the record here. Raises Damaged."""
    if at + RECORD.size > len(data):
        raise Damaged("the file ends in the middle of a record")
    opcode, length = RECORD.unpack_from(data, at)
    start = at + RECORD.size
    if not Opcode.HEADER <= opcode <= Opcode.DATA_END or length > LARGEST_CHUNK:
        raise Damaged("no record where one belongs")
    if start + length > len(data):
        raise Damaged("the file ends in the middle of a record")
    consistent = True
    if opcode == Opcode.MESSAGE_INDEX:
        consistent = length >= 6 and struct.unpack_from("<I", data, start + 2)[0] == length - 6
    elif opcode == Opcode.CHUNK:
        consistent = _chunk_fits(data, start, length)
    if not consistent:
        raise Damaged("a record with a wrong length")
    return opcode, start, start + length


def _chunk_fits(data: mmap.mmap, start: int, length: int) -> bool:
    """Return True if the lengths inside a chunk agree with its own."""
    if length < CHUNK_HEAD.size + 8:
        return False
    name = CHUNK_HEAD.unpack_from(data, start)[4]
    head = CHUNK_HEAD.size + name + 8
    return head <= length and bool(struct.unpack_from("<Q", data, start + head - 8)[0] == length - head)


def _next_chunk(data: mmap.mmap, at: int) -> int:
    """Return where the next chunk begins at or after `at`, or the file's end."""
    while (name_at := data.find(ZSTD_NAME, at + NAME_AT)) >= 0:
        begin = name_at - NAME_AT
        try:
            if _record(data, begin)[0] == Opcode.CHUNK:
                return begin
        except Damaged:
            pass
        at = begin + 1
    return len(data)


def unpacked(content: bytes) -> bytes:
    """Return what a chunk holds. Raises Damaged."""
    _, _, size, checksum, name_length = CHUNK_HEAD.unpack_from(content)
    packed_at = CHUNK_HEAD.size + name_length + 8
    name, packed = content[CHUNK_HEAD.size : packed_at - 8], content[packed_at:]
    if size > LARGEST_CHUNK:
        raise Damaged(f"a chunk of {size} bytes")
    if name == b"zstd":
        payload = _unzstd(packed, size)
    elif name == b"":
        payload = packed
    else:
        raise Damaged(f"a chunk packed with '{name[:20].decode(errors='replace')}'")
    if len(payload) != size or checksum not in {0, zlib.crc32(payload)}:
        raise Damaged("a chunk with a wrong checksum")
    return payload


def _unzstd(packed: bytes, size: int) -> bytes:
    """Unpack to `size` bytes; a frame may promise any amount, which must not be believed. Raises Damaged."""
    try:
        believable = zstandard.frame_content_size(packed) in {-1, size}
        return zstandard.ZstdDecompressor().decompress(packed if believable else b"", max_output_size=size)
    except (zstandard.ZstdError, ValueError):
        raise Damaged("a chunk that does not unpack") from None


def inner_records(payload: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield (opcode, start, end) of the records in a chunk. Raises Damaged when they do not fill it."""
    at, size = 0, len(payload)
    while at < size:
        if at + RECORD.size > size:
            raise Damaged("a chunk that ends in the middle of a record")
        opcode, length = RECORD.unpack_from(payload, at)
        start = at + RECORD.size
        at = start + length
        if at > size or (opcode == Opcode.MESSAGE and length < MESSAGE_HEAD.size):
            raise Damaged("a chunk that ends in the middle of a record")
        yield opcode, start, at
