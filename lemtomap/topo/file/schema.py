"""What a `.lemto` file is: one SQLite file with our application id, and the checks before it is trusted.

At rest a small map is only its rows: empty tables, indexes and all else that follows from the rows are left
out of the file, where each would take a page, and made again when the map is opened for writing. The checks
read only the file's header, so a file that is not ours is never touched.
"""

import contextlib
import os
import sqlite3
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import quote

from lemtomap.errors import BadMap
from lemtomap.topo.naming import shown

APPLICATION_ID = 0x4C454D54  # "LEMT"
SCHEMA_VERSION = 3
OLDEST_SCHEMA = 2
"""Schema 2 is schema 3 without doors: such a map opens, and is of schema 3 from its first change on."""
PAGE_SIZE = 1024  # a small map stays small: every table and index takes at least one page
MOST_VALUE_BYTES = 16 << 20  # of one text or blob: the journal's largest are a hundredth of it
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
    "door": "(id INTEGER PRIMARY KEY, node INT, x REAL, y REAL, yaw REAL, width REAL, seen_open INT, "
    "seen_shut INT, last_open REAL, last_shut REAL, passed INT, is_door INT)",
    "door_edge": "(edge INTEGER PRIMARY KEY, door INT)",
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
    "node_area": "node(area)",
    "door_node": "door(node)",
    "door_edge_door": "door_edge(door)",
}
DESCRIPTOR_BYTES = 20
LOOK_UP_TABLES = {
    "place_leaf": "(id INTEGER PRIMARY KEY, entries BLOB)",
    "place_split": "(id INTEGER PRIMARY KEY, axis INT, cut INT, low INT, high INT)",
    "place_fresh": "(id INTEGER PRIMARY KEY, node INT, was BLOB, now BLOB)",
}
"""Of `lemtomap.topo.loops.index`, which makes and fills them."""
TRIGGERS = {
    # before, because a REPLACE deletes the old row without telling
    "place_written": "BEFORE INSERT ON place BEGIN INSERT INTO place_fresh(node, was, now) "
    "VALUES(NEW.node, (SELECT descriptor FROM place WHERE node = NEW.node), NEW.descriptor); END",
    "place_changed": "AFTER UPDATE OF descriptor ON place BEGIN "
    "INSERT INTO place_fresh(node, was, now) VALUES(NEW.node, OLD.descriptor, NEW.descriptor); END",
    "place_gone": "AFTER DELETE ON place BEGIN "
    "INSERT INTO place_fresh(node, was, now) VALUES(OLD.node, OLD.descriptor, NULL); END",
}
"""They queue every change of localisation data for the look-up."""


def complete(connection: sqlite3.Connection) -> None:
    """Make what the file at rest leaves out; inside a transaction of the caller's."""
    for name, columns in TABLES.items():
        connection.execute(f"CREATE TABLE IF NOT EXISTS {name}{columns}")
    for name, what in INDEXES.items():
        connection.execute(f"CREATE INDEX IF NOT EXISTS {name} ON {what}")
    connection.execute(f"PRAGMA user_version = {SCHEMA_VERSION}")


def strip(connection: sqlite3.Connection) -> None:
    """Leave out what follows from the rows (indexes, triggers, look-ups) and empty tables."""
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
    except (sqlite3.Error, UnicodeDecodeError) as error:  # of a damaged schema that SQLite quotes
        raise BadMap(f"{path}: {_reason(error)}") from error


def _reason(error: Exception) -> str:
    text = str(error)
    if "full" in text:
        return "the disk is full; the map is safe up to the last second"
    if "disk I/O" in text:
        return "the disk refuses to be written or read (is it full?); what was saved before is safe"
    if "readonly" in text or "unable to open" in text:
        return "cannot be written here (read-only file or folder)"
    if any(word in text for word in ("malformed", "not a database", "decode", "too big")):
        return "damaged or truncated map file"
    if "locked" in text:
        return "another program is writing to this map"
    return shown(text)


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
        except (sqlite3.DatabaseError, UnicodeDecodeError):
            raise BadMap(f"{path}: not a .lemto map file") from None
    if application_id != APPLICATION_ID:
        raise BadMap(f"{path}: an SQLite file, but not a .lemto map")
    if version > SCHEMA_VERSION:
        raise BadMap(
            f"{path}: schema {version} is newer than this program's {SCHEMA_VERSION}; update LEMTOMap"
        )
    if version < OLDEST_SCHEMA:
        raise BadMap(f"{path}: schema {version} is older than {OLDEST_SCHEMA}, the oldest this program reads")


def _refuse_stump(path: Path) -> None:
    """Say what is wrong with a file too short for a map; no one can have it open as one."""
    data = path.read_bytes()
    if not data:
        raise BadMap(f"{path}: empty file, not a .lemto map")
    if data[:16] != _MAGIC[: len(data)]:
        raise BadMap(f"{path}: not a .lemto map file")
    raise BadMap(f"{path}: truncated after {len(data)} bytes")


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
        _distrust(connection)
        connection.execute("PRAGMA cache_size = -2048")  # looks at the file for the first time
    except (sqlite3.Error, UnicodeDecodeError):
        connection.close()
        raise
    return connection


def _distrust(connection: sqlite3.Connection) -> None:
    """Let nothing that a file holds be run or grow without bounds: it may come from anywhere."""
    connection.execute("PRAGMA trusted_schema = OFF")
    connection.execute("PRAGMA cell_size_check = ON")
    connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MOST_VALUE_BYTES)
    if sys.version_info >= (3, 12):
        connection.setconfig(sqlite3.SQLITE_DBCONFIG_DEFENSIVE, True)
