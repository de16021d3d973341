"""What a `.lemto` file is: one SQLite file with our application id, and the checks before it is trusted.

The checks read only the file's first 100 bytes, so a file that is not ours is never touched.
"""

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import quote

from lemtomap.errors import BadMap

APPLICATION_ID = 0x4C454D54  # "LEMT"
SCHEMA_VERSION = 1
PAGE_SIZE = 1024  # a small map stays small: every table and index takes at least one page
QUICK_CHECK_LIMIT_BYTES = 32 << 20  # below this the whole tree is checked on opening (some 1 ms a megabyte)
HEADER_BYTES = 100
_MAGIC = b"SQLite format 3\0"

SCHEMA = """
CREATE TABLE meta(key TEXT PRIMARY KEY, value) WITHOUT ROWID;
CREATE TABLE node(id INTEGER PRIMARY KEY, area INT, level INT, created REAL, visits INT, doubts INT);
CREATE TABLE place(node INTEGER PRIMARY KEY, taken REAL, boundary BLOB, descriptor BLOB);
CREATE TABLE edge(id INTEGER PRIMARY KEY, source INT, target INT, type INT, share INT,
                  time REAL, blocked REAL, measure BLOB);
CREATE INDEX edge_source ON edge(source);
CREATE INDEX edge_target ON edge(target);
CREATE TABLE name(name TEXT PRIMARY KEY, node INT) WITHOUT ROWID;
CREATE TABLE area(id INTEGER PRIMARY KEY, name TEXT, kind TEXT, tags TEXT);
CREATE TABLE placeholder(id INTEGER PRIMARY KEY, node INT, x REAL, y REAL, yaw REAL, width REAL, state TEXT);
CREATE TABLE mark(id INTEGER PRIMARY KEY, node INT, kind TEXT, x REAL, y REAL, stamp REAL);
CREATE TABLE change(version INTEGER PRIMARY KEY, node INT);
CREATE TABLE journal(id INTEGER PRIMARY KEY, stamp REAL, what TEXT, before TEXT);
"""


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
    if "readonly" in text or "unable to open" in text:
        return "cannot be written here (read-only file or folder)"
    if "malformed" in text or "not a database" in text:
        return "damaged or truncated map file"
    if "locked" in text:
        return "another program is writing to this map"
    return text


def check_file(path: Path) -> None:
    """Raise BadMap unless the file's header says it is a map of a schema we read. Never writes."""
    try:
        with path.open("rb") as file:
            head = file.read(HEADER_BYTES)
    except IsADirectoryError:
        raise BadMap(f"{path}: is a folder, not a map file") from None
    except FileNotFoundError:
        raise BadMap(f"{path}: no such map file") from None
    except OSError as error:
        raise BadMap(f"{path}: {error.strerror}") from None
    if not head:
        raise BadMap(f"{path}: empty file, not a .lemto map")
    if head[:16] != _MAGIC[: len(head)]:
        raise BadMap(f"{path}: not a .lemto map file")
    if len(head) < HEADER_BYTES:
        raise BadMap(f"{path}: truncated after {len(head)} bytes")
    if int.from_bytes(head[68:72], "big") != APPLICATION_ID:
        raise BadMap(f"{path}: an SQLite file, but not a .lemto map")
    version = int.from_bytes(head[60:64], "big")
    if version > SCHEMA_VERSION:
        raise BadMap(
            f"{path}: schema {version} is newer than this program's {SCHEMA_VERSION}; update LEMTOMap"
        )
    if version < 1:
        raise BadMap(f"{path}: unknown schema {version}")


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
        connection.execute("SELECT count(*) FROM meta").fetchone()


def connect(path: Path, *, readonly: bool = False) -> sqlite3.Connection:
    """Open a connection whose transactions are begun and ended by hand."""
    mode = "ro" if readonly else "rw"
    uri = f"file:{quote(str(path.absolute()))}?mode={mode}"
    with guarded(path):
        connection = sqlite3.connect(
            uri, uri=True, isolation_level=None, check_same_thread=False, timeout=5.0, cached_statements=64
        )
        connection.execute("PRAGMA cache_size = -2048")
    return connection


def connect_readonly(path: Path) -> sqlite3.Connection:
    """Open for reading, from read-only media too (where SQLite cannot make its side files)."""
    connection = connect(path, readonly=True)
    try:
        connection.execute("SELECT count(*) FROM meta").fetchone()
    except sqlite3.Error:
        connection.close()
        uri = f"file:{quote(str(path.absolute()))}?mode=ro&immutable=1"
        with guarded(path):
            connection = sqlite3.connect(uri, uri=True, isolation_level=None, check_same_thread=False)
            connection.execute("SELECT count(*) FROM meta").fetchone()
    return connection
