"""What a `.lemto` file is: one SQLite file with our application id, and the checks before it is trusted.

At rest a small map is only its rows: empty tables, indexes and all else that follows from the rows are left
out of the file, where each would take a page, and made again when the map is opened for writing. The checks
read only the file's header, so a file that is not ours is never touched.
"""

import contextlib
import os
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import quote

from lemtomap.errors import BadMap

APPLICATION_ID = 0x4C454D54  # "LEMT"
SCHEMA_VERSION = 2
PAGE_SIZE = 1024  # a small map stays small: every table and index takes at least one page
QUICK_CHECK_LIMIT_BYTES = 32 << 20  # below this the whole tree is checked on opening (some 1 ms a megabyte)
LEAST_BYTES = 512  # of an SQLite file: its smallest page
_MAGIC = b"SQLite format 3\0"

TABLES = {
    "node": "(id INTEGER PRIMARY KEY, area INT, level INT, created REAL, visits INT, doubts INT)",
    "place": "(node INTEGER PRIMARY KEY, taken REAL, boundary BLOB, descriptor BLOB)",
    "edge": "(id INTEGER PRIMARY KEY, source INT, target INT, type INT, share INT, "
    "time REAL, blocked REAL, measure BLOB)",
    "meta": "(key TEXT PRIMARY KEY, value) WITHOUT ROWID",
    "name": "(name TEXT PRIMARY KEY, node INT) WITHOUT ROWID",
    "area": "(id INTEGER PRIMARY KEY, name TEXT, kind TEXT, tags TEXT)",
    "placeholder": "(id INTEGER PRIMARY KEY, node INT, x REAL, y REAL, yaw REAL, width REAL, state TEXT)",
    "ground": "(node INTEGER PRIMARY KEY, picture BLOB)",
    "mark": "(id INTEGER PRIMARY KEY, node INT, kind TEXT, x REAL, y REAL, stamp REAL)",
    "change": "(version INTEGER PRIMARY KEY, node INT)",
    "journal": "(id INTEGER PRIMARY KEY, stamp REAL, what TEXT, before TEXT)",
}
ALWAYS = ("node", "place", "edge")
INDEXES = {
    "edge_source": "edge(source)",
    "edge_target": "edge(target)",
    "edge_blocked": "edge(id) WHERE blocked IS NOT NULL",
}


def complete(connection: sqlite3.Connection) -> None:
    """Make what the file at rest leaves out; inside a transaction of the caller's."""
    for name, columns in TABLES.items():
        connection.execute(f"CREATE TABLE IF NOT EXISTS {name}{columns}")
    for name, what in INDEXES.items():
        connection.execute(f"CREATE INDEX IF NOT EXISTS {name} ON {what}")


def strip(connection: sqlite3.Connection) -> None:
    """Leave out indexes, triggers, empty tables and those of others (look-ups, which they make again)."""
    connection.execute("BEGIN")
    connection.execute("DELETE FROM change")
    rows = connection.execute("SELECT type, name FROM sqlite_schema WHERE type != 'table'").fetchall()
    for kind, name in rows:
        connection.execute(f"DROP {kind} {name}")
    for name in _tables(connection) - set(ALWAYS):
        if name not in TABLES or not connection.execute(f"SELECT 1 FROM {name} LIMIT 1").fetchall():  # noqa: S608
            connection.execute(f"DROP TABLE {name}")
    connection.execute("COMMIT")


@contextmanager
def guarded(path: Path) -> Iterator[None]:
    """Turn what SQLite says into one line about this map file."""
    try:
        yield
    except sqlite3.Error as error:
        raise BadMap(f"{path}: {_reason(error)}") from error


def _reason(error: sqlite3.Error) -> str:
    text = str(error)
    if "full" in text:
        return "the disk is full; the map is safe up to the last second"
    if "disk I/O" in text:
        return "the disk refuses to be written or read (is it full?); what was saved before is safe"
    if "readonly" in text or "unable to open" in text:
        return "cannot be written here (read-only file or folder)"
    if "malformed" in text or "not a database" in text:
        return "damaged or truncated map file"
    if "locked" in text:
        return "another program is writing to this map"
    return text


def check_file(path: Path) -> None:
    """Raise BadMap unless the file's header says it is a map of a schema we read. Never writes.

    SQLite reads the header: closing a file by other means would drop the locks that this process holds on it.
    """
    if path.is_dir():
        raise BadMap(f"{path}: is a folder, not a map file")
    if not path.exists():
        raise BadMap(f"{path}: no such map file")
    if not os.access(path, os.R_OK):
        raise BadMap(f"{path}: may not be read by you")
    if path.stat().st_size < LEAST_BYTES:
        _refuse_stump(path)
    with guarded(path), contextlib.closing(_connect(path, "mode=ro&immutable=1")) as connection:
        try:
            ((application_id,),) = connection.execute("PRAGMA application_id")
            ((version,),) = connection.execute("PRAGMA user_version")
        except sqlite3.DatabaseError:
            raise BadMap(f"{path}: not a .lemto map file") from None
    if application_id != APPLICATION_ID:
        raise BadMap(f"{path}: an SQLite file, but not a .lemto map")
    if version > SCHEMA_VERSION:
        raise BadMap(
            f"{path}: schema {version} is newer than this program's {SCHEMA_VERSION}; update LEMTOMap"
        )
    if version < SCHEMA_VERSION:
        raise BadMap(f"{path}: schema {version} is older than {SCHEMA_VERSION}, which this program reads")


def _refuse_stump(path: Path) -> None:
    """Say what is wrong with a file too short for a map; no one can have it open as one."""
    data = path.read_bytes()
    if not data:
        raise BadMap(f"{path}: empty file, not a .lemto map")
    if data[:16] != _MAGIC[: len(data)]:
        raise BadMap(f"{path}: not a .lemto map file")
    raise BadMap(f"{path}: truncated after {len(data)} bytes")


def check_content(path: Path, connection: sqlite3.Connection) -> None:
    """Raise BadMap when the file is shorter than its own page count, or (small files) its tree is broken."""
    with guarded(path):
        (pages,) = connection.execute("PRAGMA page_count").fetchone()
        (page_size,) = connection.execute("PRAGMA page_size").fetchone()
        wal = path.with_name(path.name + "-wal")
        settled = not wal.exists() or wal.stat().st_size == 0
        size = path.stat().st_size
        if settled and size < pages * page_size:
            raise BadMap(f"{path}: truncated, {size} of {pages * page_size} bytes are there")
        if size <= QUICK_CHECK_LIMIT_BYTES:
            (verdict,) = connection.execute("PRAGMA quick_check(1)").fetchone()
            if verdict != "ok":
                raise BadMap(f"{path}: damaged map file ({str(verdict).splitlines()[-1]})")
        connection.execute("SELECT count(*) FROM node").fetchone()


def connect(path: Path) -> sqlite3.Connection:
    """Open a connection whose transactions are begun and ended by hand."""
    with guarded(path):
        return _connect(path, "mode=rw")


def claim(path: Path, connection: sqlite3.Connection) -> None:
    """Make sure that no other program has this map open. Raises BadMap.

    The file leaves WAL mode, which SQLite allows only to the last connection; from there it is changed whole.
    """
    try:
        ((mode,),) = connection.execute("PRAGMA journal_mode = DELETE")
    except sqlite3.OperationalError as error:
        if "locked" not in str(error):
            raise
        mode = "wal"
    if mode != "delete":
        raise BadMap(f"{path}: in use by another program (a robot that maps into it?); end that first")


def connect_readonly(path: Path) -> sqlite3.Connection:
    """Open for reading, from read-only media too (where SQLite cannot make its side files).

    What a file at rest leaves out reads as empty.
    """
    with guarded(path):
        try:
            connection = _connect(path, "mode=ro")
        except sqlite3.Error:
            connection = _connect(path, "mode=ro&immutable=1")
        connection.execute("PRAGMA temp_store = MEMORY")
        for name in TABLES.keys() - _tables(connection):
            connection.execute(f"CREATE TEMP TABLE {name}{TABLES[name]}")
    return connection


def _tables(connection: sqlite3.Connection) -> set[str]:
    return {name for (name,) in connection.execute("SELECT name FROM sqlite_schema WHERE type = 'table'")}


def _connect(path: Path, how: str) -> sqlite3.Connection:
    uri = f"file:{quote(str(path.absolute()))}?{how}"
    connection = sqlite3.connect(
        uri, uri=True, isolation_level=None, check_same_thread=False, timeout=5.0, cached_statements=64
    )
    try:
        connection.execute("PRAGMA cache_size = -2048")  # looks at the file for the first time
    except sqlite3.Error:
        connection.close()
        raise
    return connection
