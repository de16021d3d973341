"""Damage to maps that SQLite itself does not notice: strange values, other tables, triggers."""

import random
import sqlite3
import struct
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from tools.checks.mutations import BYTES, Mutation

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
