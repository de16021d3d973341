"""Undo: before an edit, the rows it touches are written down; undoing puts them back as they were.

It works on rows and knows nothing of what an edit means, so every edit can be undone, in reverse order. What
a file's journal says is believed only as far as it names our tables and columns and leaves a sound map.
"""

import base64
import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from lemtomap.errors import BadMap
from lemtomap.topo.file.checks import COLUMNS
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.naming import shown

KEYS = {
    "node": "id",
    "place": "node",
    "edge": "id",
    "name": "name",
    "area": "id",
    "door": "id",
    "door_edge": "edge",
    "placeholder": "id",
    "ground": "node",
    "mark": "id",
}
KEPT_EDITS = 1000


@dataclass(frozen=True, slots=True)
class JournalEntry:
    """One edit that can be undone."""

    entry_id: int
    stamp_s: float
    what: str


class RowsBefore:
    """Collects the rows an edit is about to touch. Call `touch` before each write."""

    def __init__(self, store: TopoStore) -> None:
        self._store = store
        self._before: dict[tuple[str, Any], dict[str, Any] | None] = {}

    def touch(self, table: str, key: float | str) -> None:
        """Write down a row as it is now, or that there is none."""
        if (table, key) not in self._before:
            self._before[table, key] = _row(self._store, table, key)

    def touch_where(self, table: str, column: str, value: int) -> None:
        """Write down all rows of a table with this value."""
        sql = f"SELECT {KEYS[table]} FROM {table} WHERE {column} = ?"  # noqa: S608 - names from this program
        for (key,) in list(self._store.query(sql, (value,))):
            self.touch(table, key)

    def touch_all(self, table: str) -> None:
        """Write down all rows of a table."""
        for (key,) in list(self._store.query(f"SELECT {KEYS[table]} FROM {table}")):  # noqa: S608
            self.touch(table, key)

    def touch_new(self, table: str, key: float | str) -> None:
        """Note a row that this edit itself has made, unless it was there before."""
        self._before.setdefault((table, key), None)

    def text(self) -> str:
        """Return what was written down, as JSON."""
        return json.dumps([[table, key, row] for (table, key), row in self._before.items()])


@contextmanager
def recorded(store: TopoStore, what: str, stamp_s: float = 0.0) -> Iterator[RowsBefore]:
    """Make everything written inside one edit that `undo` takes back; when the body raises, none of it."""
    recording = RowsBefore(store)
    with store.whole():
        yield recording
        sql = "INSERT INTO journal(stamp, what, before) VALUES(?, ?, ?)"
        store.write(sql, (stamp_s, what, recording.text()))
        store.write("DELETE FROM journal WHERE id <= (SELECT max(id) FROM journal) - ?", (KEPT_EDITS,))


def entries(store: TopoStore) -> list[JournalEntry]:
    """Return the edits that can be undone, newest first."""
    return [JournalEntry(*row) for row in store.query("SELECT id, stamp, what FROM journal ORDER BY id DESC")]


def undo(store: TopoStore) -> str | None:
    """Take back the newest edit; returns what it was, None when there is nothing to undo.

    Raises BadMap for a journal that is not ours; then nothing has changed.
    """
    newest = list(store.query("SELECT id, what, before FROM journal ORDER BY id DESC LIMIT 1"))
    if not newest:
        return None
    entry_id, what, before = newest[0]
    with store.whole():
        try:
            for table, key, row in _rows_of(before):
                store.write(f"DELETE FROM {table} WHERE {KEYS[table]} = ?", (key,))  # noqa: S608
                if row is not None:
                    columns, marks = ", ".join(row), ", ".join("?" * len(row))
                    store.write(f"INSERT INTO {table}({columns}) VALUES({marks})", row.values())
            store.write("DELETE FROM journal WHERE id = ?", (entry_id,))
            store.check_rows()
        except (BadMap, ValueError, TypeError, RecursionError, OverflowError):
            told = "cannot be taken back: what it changed is gone, or the journal is damaged"
            raise BadMap(f"{store.path}: '{shown(what)}' {told}") from None
    store.changed_everywhere()
    return str(what)


def _rows_of(before: str) -> list[tuple[str, float | str, dict[str, Any] | None]]:
    """Return what a journal entry wrote down: table, key and the row, None where there was none.

    Raises ValueError or TypeError for what no edit wrote.
    """
    rows: list[tuple[str, float | str, dict[str, Any] | None]] = []
    written = json.loads(before)
    if not isinstance(written, list):
        raise TypeError(before)
    for table, key, row in written:
        if table not in KEYS or not (row is None or set(row) == set(COLUMNS[table])):
            raise ValueError(table)
        plain = None if row is None else {name: _plain(value) for name, value in row.items()}
        rows.append((table, key, plain))
    return rows


def _row(store: TopoStore, table: str, key: float | str) -> dict[str, Any] | None:
    columns = [name for _, name, *_ in store.query(f"PRAGMA table_info({table})")]
    sql = f"SELECT * FROM {table} WHERE {KEYS[table]} = ?"  # noqa: S608
    for values in store.query(sql, (key,)):
        return dict(zip(columns, map(_coded, values), strict=True))
    return None


def _coded(value: Any) -> Any:
    return {"bytes": base64.b64encode(value).decode()} if isinstance(value, bytes) else value


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return base64.b64decode(str(value.get("bytes")))
    return value
