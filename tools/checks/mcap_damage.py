"""Damage to recordings that a random byte hardly does: to whole records, and inside chunks that unpack."""

import random
import struct
from collections.abc import Sequence

import zstandard

from tools.checks.mutations import BYTES, Mutation

CHUNK = 0x06
MAGIC_BYTES = 8

Record = tuple[int, bytes]


def mcap_records(data: bytes) -> list[Record]:
    """Return (opcode, content) of records that stand one after another, without the file's magic."""
    records, at = [], 0
    while at + 9 <= len(data):
        opcode, length = struct.unpack_from("<BQ", data, at)
        records.append((opcode, data[at + 9 : at + 9 + length]))
        at += 9 + length
    return records


def mcap_bytes(records: Sequence[Record]) -> bytes:
    """Return the records as they stand in a file."""
    return b"".join(struct.pack("<BQ", opcode, len(content)) + content for opcode, content in records)


def chunk_payload(content: bytes) -> bytes:
    """Return the records inside a zstd chunk's content."""
    (name,) = struct.unpack_from("<I", content, 28)
    (size,) = struct.unpack_from("<Q", content, 16)
    return zstandard.decompress(content[32 + name + 8 :], size)


def chunk_content(old: bytes, payload: bytes, *, compression: bytes = b"zstd", crc: int = 0) -> bytes:
    """Return a chunk's content with another payload; crc 0: not checked."""
    packed = zstandard.compress(payload)
    head = old[:16] + struct.pack("<QII", len(payload), crc, len(compression)) + compression
    return head + struct.pack("<Q", len(packed)) + packed


def _record_changed(records: list[Record], rng: random.Random) -> None:
    """Lose, repeat, exchange, rename or damage one record, or put a huge number into it."""
    at = rng.randrange(len(records))
    opcode, content = records[at]
    kind = rng.randrange(7)
    if kind == 0:
        del records[at]
    elif kind == 1:
        records[at:at] = [records[at]] * rng.choice((1, 50))
    elif kind == 2:
        other = rng.randrange(len(records))
        records[at], records[other] = records[other], records[at]
    elif kind == 3:
        records[at] = (rng.randrange(256), content)
    elif kind == 4 and len(content) >= 8:
        where = (
            rng.randrange(len(content) - 7) if rng.random() < 0.5 else rng.randrange(0, len(content) - 7, 2)
        )
        number = rng.choice((0, 1, 2**31, 2**32 - 1, 2**40, 2**63 - 1, 2**64 - 1))
        records[at] = (opcode, content[:where] + struct.pack("<Q", number) + content[where + 8 :])
    else:
        records[at] = (opcode, rng.choice(BYTES)(content, rng) if content else b"\x00" * 40)


def mcap_record(data: bytes, rng: random.Random) -> bytes:
    """Damage records of the file."""
    records = mcap_records(data[MAGIC_BYTES:])
    for _ in range(rng.choice((1, 1, 3))):
        _record_changed(records, rng)
    return data[:MAGIC_BYTES] + mcap_bytes(records) + data[:MAGIC_BYTES]


def mcap_message(data: bytes, rng: random.Random) -> bytes:
    """Damage records inside a chunk, and pack it so that nothing but what they say is wrong."""
    records = mcap_records(data[MAGIC_BYTES:])
    chunks = [index for index, (opcode, _) in enumerate(records) if opcode == CHUNK]
    at = rng.choice(chunks)
    inner = mcap_records(chunk_payload(records[at][1]))
    for _ in range(rng.choice((1, 5, 40))):
        if inner:
            _record_changed(inner, rng)
    records[at] = (CHUNK, chunk_content(records[at][1], mcap_bytes(inner)))
    return data[:MAGIC_BYTES] + mcap_bytes(records) + data[:MAGIC_BYTES]


def mcap_chunk_lies(data: bytes, rng: random.Random) -> bytes:
    """Let a chunk tell a wrong compression, checksum or size."""
    records = mcap_records(data[MAGIC_BYTES:])
    at = rng.choice([index for index, (opcode, _) in enumerate(records) if opcode == CHUNK])
    old = records[at][1]
    kind = rng.randrange(3)
    if kind == 0:
        new = chunk_content(
            old, chunk_payload(old), compression=rng.choice((b"lz4", b"", b"none", b"\xff", b"zip"))
        )
    elif kind == 1:
        new = chunk_content(old, chunk_payload(old), crc=rng.randrange(1, 2**32))
    else:
        new = old[:16] + struct.pack("<Q", rng.choice((0, 1, 2**31, 2**40, 2**63))) + old[24:]
    records[at] = (CHUNK, new)
    return data[:MAGIC_BYTES] + mcap_bytes(records) + data[:MAGIC_BYTES]


MCAP: tuple[Mutation, ...] = (*BYTES, *[mcap_record, mcap_message] * 2, mcap_chunk_lies)
