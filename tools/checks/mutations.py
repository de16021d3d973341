"""Damage to files: of bytes, of text, of packed files, of MCAP records and of SQLite maps.

Every mutation takes the sound file and a random generator and returns the damaged file.
"""

import functools
import gzip
import lzma
import random
import re
import sqlite3
import struct
import tempfile
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

import zstandard

Mutation = Callable[[bytes, random.Random], bytes]

HUGE = (
    "1e308", "-1e308", "1e999", "1e12", "-1e12", "99999999999999999999999999", "nan", "-nan", "inf", "-inf",
    "0", "-0", "-1", "1e-320", "0x10", "1_000", "0.1.2", "true", "''", "~", "4294967296",
)  # fmt: skip
JUNK = (
    b"\x00" * 17,
    b"\xff\xfe",
    b"\x1b[2J\x1b]0;x\x07",
    b"\r",
    b"\n\n\n",
    "é漢\u202e".encode(),
    b"%s%n{}$\\",
)
BOMB_MEMBER = 256 * 2**20
BOMB_MEMBERS = 16
CHUNK, MESSAGE = 0x06, 0x05
MAGIC_BYTES = 8


# ---- bytes ----


def _span(data: bytes, rng: random.Random) -> tuple[int, int]:
    """Return a random stretch of the file, rarely a long one."""
    start = rng.randrange(len(data) + 1)
    return start, min(len(data), start + rng.choice((1, 2, 8, 64, 1024, len(data) // 4)))


def flip_bits(data: bytes, rng: random.Random) -> bytes:
    """Flip some bits."""
    damaged = bytearray(data)
    for _ in range(rng.choice((1, 1, 3, 20))):
        damaged[rng.randrange(len(damaged))] ^= 1 << rng.randrange(8)
    return bytes(damaged)


def overwrite(data: bytes, rng: random.Random) -> bytes:
    """Write random bytes over a stretch."""
    start, end = _span(data, rng)
    return data[:start] + rng.randbytes(end - start) + data[end:]


def cut_tail(data: bytes, rng: random.Random) -> bytes:
    """Lose everything from somewhere on."""
    return data[: rng.randrange(len(data) + 1)]


def cut_stretch(data: bytes, rng: random.Random) -> bytes:
    """Lose a stretch in the middle."""
    start, end = _span(data, rng)
    return data[:start] + data[end:]


def insert_junk(data: bytes, rng: random.Random) -> bytes:
    """Put something foreign in between."""
    at = rng.randrange(len(data) + 1)
    junk = rng.choice((*JUNK, rng.randbytes(rng.choice((1, 5, 300)))))
    return data[:at] + junk + data[at:]


def repeat_stretch(data: bytes, rng: random.Random) -> bytes:
    """Have a stretch twice."""
    start, end = _span(data, rng)
    return data[:end] + data[start:end] + data[end:]


def swap_stretches(data: bytes, rng: random.Random) -> bytes:
    """Exchange two neighbouring stretches."""
    a, b, c = sorted(rng.randrange(len(data) + 1) for _ in range(3))
    return data[:a] + data[b:c] + data[a:b] + data[c:]


BYTES: tuple[Mutation, ...] = (
    flip_bits, overwrite, cut_tail, cut_stretch, insert_junk, repeat_stretch, swap_stretches,
)  # fmt: skip


# ---- text ----


def huge_number(data: bytes, rng: random.Random) -> bytes:
    """Put something that is hardly a number in the place of one."""
    found = list(re.finditer(rb"[-+]?[0-9][0-9.eE+-]*", data))
    if not found:
        return insert_junk(data, rng)
    for match in sorted(rng.sample(found, min(len(found), rng.choice((1, 1, 4)))), key=lambda m: -m.start()):
        data = data[: match.start()] + rng.choice(HUGE).encode() + data[match.end() :]
    return data


def repeat_digits(data: bytes, rng: random.Random) -> bytes:
    """Make a number thousands of digits long."""
    found = list(re.finditer(rb"[0-9]", data))
    at = rng.choice(found).end() if found else 0
    return data[:at] + b"9" * rng.choice((30, 400, 5000)) + data[at:]


def nest(data: bytes, rng: random.Random) -> bytes:
    """Open brackets without end, or close them again."""
    opened, closed = rng.choice(((b"[", b"]"), (b"{a: ", b"}"), (b"- ", b""), (b"{a={", b"}}"), (b"(", b")")))
    depth = rng.choice((40, 3000, 60_000))
    found = list(re.finditer(rb"[-+]?[0-9][0-9.]*", data))
    at = rng.choice(found).start() if found else rng.randrange(len(data) + 1)
    return data[:at] + opened * depth + b"1" + closed * (depth if rng.random() < 0.7 else 0) + data[at:]


def lines_changed(data: bytes, rng: random.Random) -> bytes:
    """Lose, repeat, exchange or lengthen a line."""
    lines = data.splitlines(keepends=True) or [b""]
    at, other = rng.randrange(len(lines)), rng.randrange(len(lines))
    kind = rng.randrange(4)
    if kind == 0:
        del lines[at]
    elif kind == 1:
        lines[at:at] = [lines[at]] * rng.choice((1, 3, 200))
    elif kind == 2:
        lines[at], lines[other] = lines[other], lines[at]
    else:
        lines[at] = lines[at].rstrip(b"\n") * rng.choice((3, 2000)) + b"\n"
    return b"".join(lines)


def words_exchanged(data: bytes, rng: random.Random) -> bytes:
    """Put one word of the file in the place of another."""
    found = list(re.finditer(rb"[^\s]+", data))
    if not found:
        return insert_junk(data, rng)
    at, other = rng.choice(found), rng.choice(found)
    return data[: at.start()] + other.group() + data[at.end() :]


def encoded_anew(data: bytes, rng: random.Random) -> bytes:
    """Store the text as another program would."""
    text = data.decode("latin-1")
    return rng.choice(
        (text.encode("utf-16"), b"\xef\xbb\xbf" + data, data.replace(b"\n", b"\r\n"), b" " + data)
    )


def yaml_aliases(data: bytes, rng: random.Random) -> bytes:
    """Let a few lines grow to billions."""
    levels = rng.choice((4, 9, 30))
    lines = ["a0: &a0 [x,x,x,x,x,x,x,x,x]"]
    lines += [f"a{i}: &a{i} [{','.join([f'*a{i - 1}'] * 9)}]" for i in range(1, levels)]
    return "\n".join(lines).encode() + b"\n" + data


TEXT: tuple[Mutation, ...] = (
    huge_number, huge_number, huge_number, repeat_digits, nest, lines_changed, words_exchanged, encoded_anew,
    *BYTES,
)  # fmt: skip
YAML: tuple[Mutation, ...] = (*TEXT, yaml_aliases)


# ---- packed ----


def repacked(pack: Callable[[bytes], bytes], unpack: Callable[[bytes], bytes]) -> Mutation:
    """Damage the text inside, packed soundly."""

    def mutation(data: bytes, rng: random.Random) -> bytes:
        return pack(rng.choice(TEXT)(unpack(data), rng))

    return mutation


def bomb(pack: Callable[[bytes], bytes]) -> Mutation:
    """Let a small file unpack to 4 GB."""

    @functools.cache
    def member() -> bytes:
        return pack(b"0" * BOMB_MEMBER)

    def mutation(data: bytes, rng: random.Random) -> bytes:
        # rarely, since each costs its reader as much as hundreds of others
        if rng.random() < 0.8:
            return flip_bits(data, rng)
        return data + member() * BOMB_MEMBERS

    return mutation


GZIP: tuple[Mutation, ...] = (
    *BYTES,
    *[repacked(lambda data: gzip.compress(data, 1, mtime=0), gzip.decompress)] * 8,
    bomb(lambda data: gzip.compress(data, 1, mtime=0)),
)
XZ: tuple[Mutation, ...] = (
    *BYTES,
    *[repacked(lambda data: lzma.compress(data, preset=0), lzma.decompress)] * 8,
    bomb(lambda data: lzma.compress(data, preset=0)),
)


# ---- MCAP ----

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


# ---- SQLite ----

CELLS = (
    None, 0, -1, 1, 2**62, -(2**62), 1e308, -1e308, float("inf"), 1e12, "", "nan", "x" * 5000, "\x1b[2J\x00",
    b"", b"\x00", b"\xff" * 24, b"\x00" * 4000,
)  # fmt: skip
SCHEMAS = (
    "DROP TABLE {table}",
    "DELETE FROM {table}",
    "DELETE FROM {table} WHERE rowid = {row}",
    "ALTER TABLE {table} RENAME TO other",
    "ALTER TABLE {table} RENAME COLUMN {column} TO other",
    "CREATE TRIGGER t AFTER UPDATE ON {table} BEGIN DELETE FROM {table}; END",
    "CREATE TRIGGER t AFTER INSERT ON {table} BEGIN DELETE FROM {table}; END",
    "CREATE TABLE stranger AS SELECT * FROM {table}",
    "PRAGMA user_version = {row}",
    "PRAGMA application_id = {row}",
    "UPDATE {table} SET {column} = rowid",
    "INSERT INTO {table}(rowid) VALUES (987654321)",
    "INSERT INTO {table} SELECT * FROM {table} LIMIT 1",
)


def _edited(data: bytes, edit: Callable[[sqlite3.Connection], None]) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map"
        path.write_bytes(data)
        connection = sqlite3.connect(path, isolation_level=None)
        connection.execute("PRAGMA ignore_check_constraints = ON")
        with suppress(sqlite3.Error):  # some of it even SQLite refuses
            edit(connection)
        connection.close()
        return path.read_bytes()


def _anywhere(connection: sqlite3.Connection, rng: random.Random) -> tuple[str, str, int]:
    """Return a table, a column of it and the id of a row."""
    tables = [name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
    table = rng.choice(tables)
    columns = [row[1] for row in connection.execute(f"PRAGMA table_info({table})")]
    rows = [row for (row,) in connection.execute(f"SELECT rowid FROM {table}")]  # noqa: S608 - our own table
    return table, rng.choice(columns), rng.choice(rows or [1])


def sqlite_cell(data: bytes, rng: random.Random) -> bytes:
    """Put strange values into cells."""

    def edit(connection: sqlite3.Connection) -> None:
        for _ in range(rng.choice((1, 1, 3))):
            table, column, row = _anywhere(connection, rng)
            statement = f"UPDATE {table} SET {column} = ? WHERE rowid = ?"  # noqa: S608 - our own table
            connection.execute(statement, (rng.choice(CELLS), row))

    return _edited(data, edit)


def sqlite_blob(data: bytes, rng: random.Random) -> bytes:
    """Damage the bytes of a measured thing."""

    def edit(connection: sqlite3.Connection) -> None:
        table, column = rng.choice((("edge", "measure"), ("place", "boundary"), ("place", "descriptor")))
        cells = connection.execute(f"SELECT rowid, {column} FROM {table}").fetchall()  # noqa: S608
        row, blob = rng.choice(cells)
        damaged = rng.choice(BYTES)(blob, rng)
        if rng.random() < 0.4 and len(blob) >= 8:
            at = rng.randrange(0, len(blob) - 3, 4)
            number = struct.pack("<f", rng.choice((float("nan"), float("inf"), 1e30, -1e12)))
            damaged = blob[:at] + number + blob[at + 4 :]
        connection.execute(f"UPDATE {table} SET {column} = ? WHERE rowid = ?", (damaged, row))  # noqa: S608

    return _edited(data, edit)


def sqlite_schema(data: bytes, rng: random.Random) -> bytes:
    """Change what the file is made of."""

    def edit(connection: sqlite3.Connection) -> None:
        table, column, row = _anywhere(connection, rng)
        connection.execute(rng.choice(SCHEMAS).format(table=table, column=column, row=row))

    return _edited(data, edit)


SQLITE: tuple[Mutation, ...] = (*BYTES, *[sqlite_cell] * 4, sqlite_blob, sqlite_blob, *[sqlite_schema] * 3)
