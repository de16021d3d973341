"""What a map file may hold. A map may come from a stranger: whatever reads it relies on what is checked here.

Two checks, each on opening and before anything of the file is used. Of the schema: exactly our tables,
columns, look-ups and triggers, nothing else, for SQLite would run what stands there. Of the rows: every
value of its type and within its bounds, every edge between two nodes that exist.
"""

import sqlite3
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lemtomap.errors import BadMap
from lemtomap.topo.file import schema
from lemtomap.topo.file.rows import (
    CORRELATION_STEPS,
    MEASURE,
    MOST_PLACE_CELLS,
    PLACE_FORMAT,
    SHARE_STEPS,
    TYPES,
)
from lemtomap.topo.graph import FOR_EVER_S, OpeningState
from lemtomap.topo.naming import shown

MOST_ID = 1 << 48
MOST_LEVEL = 999
MOST_LENGTH_M = 1e6  # no edge is a thousand kilometres long
MOST_YAW_RAD = 2.0 * np.pi
MOST_BLOB_BYTES = 1 << 16  # of a place or a picture of ground, which take some hundred
MOST_TEXT = 1 << 20  # characters; the journal's largest are a tenth of it
AT_ONCE = 50_000  # edges whose measures are looked at together, 2 MB


@dataclass(frozen=True, slots=True)
class Kind:
    """What a column may hold."""

    sql: str
    """An SQL term that is true of good values of the column `{0}`, and true or false of any."""
    fault: str
    """What to say of the others."""


def _whole(low: int, high: int = MOST_ID) -> Kind:
    sql = f"typeof({{0}}) = 'integer' AND {{0}} BETWEEN {low} AND {high}"
    return Kind(sql, f"no whole number from {low} to {high}")


def _real(low: float, high: float) -> Kind:
    sql = f"typeof({{0}}) = 'real' AND {{0}} BETWEEN {low!r} AND {high!r}"
    return Kind(sql, f"no number from {low:g} to {high:g}")


def _blob(most: int) -> Kind:
    return Kind(f"typeof({{0}}) = 'blob' AND length({{0}}) <= {most}", f"no blob of at most {most} bytes")


def _or_none(kind: Kind) -> Kind:
    return Kind(f"{{0}} IS NULL OR {kind.sql}", kind.fault)


def _one_of(words: list[str]) -> Kind:
    choice = ", ".join(f"'{word}'" for word in words)
    return Kind(f"{{0}} IN ({choice}) AND {{0}} IS NOT NULL", f"none of {choice}")


ID = _whole(1)
COUNT = _whole(0)
NODE = Kind("typeof({0}) = 'integer' AND {0} IN (SELECT id FROM node)", "no node of this map")
OTHER_NODE = Kind(f"{NODE.sql} AND {{0}} != source", "no other node of this map")
METRES = _real(-MOST_LENGTH_M, MOST_LENGTH_M)
STAMP = _real(-FOR_EVER_S, FOR_EVER_S)
TEXT = Kind(f"typeof({{0}}) = 'text' AND length({{0}}) <= {MOST_TEXT}", f"no text of at most {MOST_TEXT}")
JSON = Kind(f"{TEXT.sql} AND json_valid({{0}})", "no JSON text")
BLOB = _blob(MOST_BLOB_BYTES)
BOUNDARY = Kind(
    f"{BLOB.sql} AND substr({{0}}, 1, 1) = X'{PLACE_FORMAT:02X}' "
    f"AND substr({{0}}, 2, 1) BETWEEN X'01' AND X'{MOST_PLACE_CELLS:02X}'",
    "localisation data of an unknown format",
)
META = Kind(
    "CASE WHEN key IN ('next_node', 'next_edge', 'next_area', 'next_door', 'pruned_to') "
    "THEN typeof({0}) = 'integer' AND {0} >= 0 WHEN key = 'stamp_s' THEN typeof({0}) IN ('real', 'integer') "
    f"ELSE {{0}} IS NULL OR length({{0}}) <= {MOST_BLOB_BYTES} END",
    "no number, or too long",
)
SPLIT = Kind("typeof({0}) = 'integer' AND {0} > id", "no split further down")
PASSAGE = {
    "node": COUNT,  # whose node may have gone since
    "x": METRES,
    "y": METRES,
    "yaw": _real(-MOST_YAW_RAD, MOST_YAW_RAD),
    "width": _real(0.0, MOST_LENGTH_M),
}
"""Of a door or an opening: the node in whose frame it lies, where, and how wide it is."""
COLUMNS: dict[str, dict[str, Kind]] = {
    "node": {
        "id": ID,
        "area": COUNT,
        "level": _whole(-MOST_LEVEL, MOST_LEVEL),
        "created": STAMP,
        "visits": COUNT,
        "doubts": COUNT,
    },
    "place": {"node": NODE, "taken": STAMP, "boundary": BOUNDARY, "descriptor": _or_none(BLOB)},
    "edge": {
        "id": ID,
        "source": NODE,
        "target": OTHER_NODE,
        "type": _whole(0, len(TYPES) - 1),
        "share": _whole(0, SHARE_STEPS),
        "time": _or_none(_real(1e-9, FOR_EVER_S)),
        "blocked": _or_none(STAMP),
        "measure": Kind(
            f"typeof({{0}}) = 'blob' AND length({{0}}) = {MEASURE.size}", f"not of {MEASURE.size} bytes"
        ),
    },
    "meta": {"key": TEXT, "value": META},
    "name": {"name": TEXT, "node": NODE},
    "area": {"id": ID, "name": _or_none(TEXT), "kind": _or_none(TEXT), "tags": _or_none(JSON)},
    "door": {
        "id": ID,
        **PASSAGE,
        "seen_open": COUNT,
        "seen_shut": COUNT,
        "last_open": _or_none(STAMP),
        "last_shut": _or_none(STAMP),
        "passed": COUNT,
        "is_door": _whole(0, 1),
    },
    "door_edge": {"edge": ID, "door": ID},
    "placeholder": {
        "id": COUNT,
        **PASSAGE,
        "state": _one_of([str(state) for state in OpeningState]),
    },
    "ground": {"node": ID, "picture": BLOB},
    "mark": {"id": ID, "node": COUNT, "kind": TEXT, "x": METRES, "y": METRES, "stamp": STAMP},
    "change": {"version": COUNT, "node": COUNT},
    "journal": {"id": ID, "stamp": STAMP, "what": TEXT, "before": TEXT},
    "place_leaf": {"id": COUNT, "entries": _blob(schema.MOST_VALUE_BYTES)},
    "place_split": {
        "id": Kind(
            "{0} BETWEEN 0 AND 2 * (SELECT count(*) FROM place_split)", "more than twice the number of splits"
        ),
        "axis": _whole(0, schema.DESCRIPTOR_BYTES - 1),
        "cut": _whole(0, 255),
        "low": SPLIT,
        "high": Kind("{0} = low + 1", "not beside the lower one"),
    },
    "place_fresh": {"id": ID, "node": ID, "was": _or_none(BLOB), "now": _or_none(BLOB)},
}


def check_content(path: Path, connection: sqlite3.Connection) -> None:
    """Raise BadMap unless the file is whole, of our schema, and every row is sound. Reads all of it: some
    5 ms a thousand nodes.
    """
    with schema.guarded(path):
        _check_size(path, connection)
        check_schema(path, connection)
        (verdict,) = connection.execute("PRAGMA quick_check(1)").fetchone()
        if verdict != "ok":
            raise BadMap(f"{path}: damaged map file ({shown(str(verdict).splitlines()[-1])})")
        check_rows(path, connection)


def _check_size(path: Path, connection: sqlite3.Connection) -> None:
    (pages,) = connection.execute("PRAGMA page_count").fetchone()
    (page_size,) = connection.execute("PRAGMA page_size").fetchone()
    wal = path.with_name(path.name + "-wal")
    settled = not wal.exists() or wal.stat().st_size == 0
    size = path.stat().st_size
    if settled and size < pages * page_size:
        raise BadMap(f"{path}: truncated, {size} of {pages * page_size} bytes are there")


def check_schema(path: Path, connection: sqlite3.Connection) -> None:
    """Raise BadMap when the file holds a table, column, view, trigger or index that is not ours."""
    ours = {("table", name): f"CREATE TABLE {name}{columns}" for name, columns in schema.TABLES.items()}
    ours |= {("table", name): f"CREATE TABLE {name}{how}" for name, how in schema.LOOK_UP_TABLES.items()}
    ours |= {("index", name): f"CREATE INDEX {name} ON {what}" for name, what in schema.INDEXES.items()}
    ours |= {("trigger", name): f"CREATE TRIGGER {name} {what}" for name, what in schema.TRIGGERS.items()}
    found = connection.execute("SELECT type, name, sql FROM main.sqlite_schema").fetchall()
    for kind, name, sql in found:
        if " ".join(str(sql).split()) != ours.get((kind, name)):
            raise BadMap(f"{path}: damaged, or made for harm: {shown(f'{kind} {name}')} is not ours")
    missing = set(schema.ALWAYS) - {name for kind, name, _ in found if kind == "table"}
    if missing:
        raise BadMap(f"{path}: damaged map file (no table {', '.join(sorted(missing))})")


def check_rows(path: Path, connection: sqlite3.Connection) -> None:
    """Raise BadMap when a row holds what no map of ours does; names table, row and column."""
    present = {
        name for (name,) in connection.execute("SELECT name FROM main.sqlite_schema WHERE type = 'table'")
    }
    for table, columns in COLUMNS.items():
        if table in present:
            _check_table(path, connection, table, columns)
    _check_measures(path, connection)


def _check_table(path: Path, connection: sqlite3.Connection, table: str, columns: dict[str, Kind]) -> None:
    cases = " ".join(
        f"WHEN ({kind.sql.format(column)}) IS NOT TRUE THEN '{column}'" for column, kind in columns.items()
    )
    key = next(iter(columns))
    sql = f"SELECT {key}, CASE {cases} END AS wrong FROM main.{table} WHERE wrong IS NOT NULL LIMIT 1"  # noqa: S608 - names from this program
    for row, column in connection.execute(sql):
        raise BadMap(f"{path}: {table} {shown(str(row))}: {column} is {columns[column].fault}")


_FIELDS = np.dtype([("pose", "<f8", 3), ("sigma", "<f2", 3), ("steps", "<i2", 3)])


def _check_measures(path: Path, connection: sqlite3.Connection) -> None:
    for ids, measures in _measures(connection):
        odd = ~_is_sound(measures)
        if odd.any():
            edge_id = ids[int(odd.argmax())]
            raise BadMap(f"{path}: edge {edge_id}: its measure is no pose, or its covariance not positive")


def _measures(connection: sqlite3.Connection) -> Iterator[tuple[list[int], NDArray[np.void]]]:
    cursor = connection.execute("SELECT id, measure FROM main.edge")
    while rows := cursor.fetchmany(AT_ONCE):
        ids, blobs = zip(*rows, strict=True)
        yield list(ids), np.frombuffer(b"".join(blobs), _FIELDS)


def _is_sound(measures: NDArray[np.void]) -> NDArray[np.bool_]:
    """Return bool (N,): the pose is within bounds and the covariance positive definite (Sylvester)."""
    pose, sigma = measures["pose"], measures["sigma"].astype(np.float64)
    most = np.array([MOST_LENGTH_M, MOST_LENGTH_M, MOST_YAW_RAD])
    within = (np.abs(pose) <= most).all(axis=1)  # false of NaN
    spread = (sigma > 0.0).all(axis=1) & np.isfinite(sigma).all(axis=1)
    xy, xt, yt = (measures["steps"] / CORRELATION_STEPS).T
    minors = (np.abs(xy) < 1.0) & (1.0 + 2.0 * xy * xt * yt - xy**2 - xt**2 - yt**2 > 0.0)
    return np.asarray(within & spread & minors)
