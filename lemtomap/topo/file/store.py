"""The map file as the mapper writes it: a little at a time, safe at every moment.

Writes go into one open transaction that `tick` commits at least every half second of the data's own time,
so a power cut loses at most that; SQLite's write-ahead log keeps the file whole. One TopoStore writes, a
second is refused; any number of TopoReader read the same file meanwhile. A file that is deleted or moved
while it is open is written anew on closing.
"""

import contextlib
import os
import sqlite3
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from lemtomap.errors import BadMap
from lemtomap.se2 import compose
from lemtomap.topo.file import checks, schema
from lemtomap.topo.file.rows import (
    EDGE_COLUMNS,
    NODE_COLUMNS,
    edge_from,
    edge_row,
    node_from,
    node_row,
    placeholder_from,
)
from lemtomap.topo.graph import (
    FOR_EVER_S,
    Edge,
    Mark,
    Node,
    OpeningState,
    Place,
    Placeholder,
)

COMPACT_BELOW_BYTES = 8 << 20  # rewriting a map of this size on closing takes some 50 ms
STRIP_BELOW_BYTES = 1 << 20  # below this all look-ups are made again within seconds of opening
KEPT_CHANGES = 8192  # a reader further behind than this reads afresh


class TopoStore:
    """One `.lemto` file, open for writing."""

    def __init__(
        self,
        path: Path,
        connection: sqlite3.Connection,
        *,
        commit_every_s: float = 0.5,
        readonly: bool = False,
    ) -> None:
        self.path = path
        """Where the map stands when it is closed."""
        self.commit_every_s = commit_every_s
        self.before_commit: Callable[[], None] | None = None
        """Called before each commit, for whoever sees to the room on the disk: a failed one takes back all
        that it holds."""
        self._db = connection
        self._file = path.stat()
        self._readonly = readonly
        self._closed = False
        self._begun_s: float | None = None
        self._stamp_s: float | None = None
        self._next_node = self._next_id("node")
        self._next_edge = self._next_id("edge")
        self._uncommitted: set[int] = set()
        self.version = int(self._one("SELECT coalesce(max(version), 0) FROM change"))

    @classmethod
    def create(cls, path: Path | str, *, durable: bool = True, commit_every_s: float = 0.5) -> Self:
        """Make a new, empty map. Raises BadMap when the path exists or cannot be written."""
        path = Path(path)
        if path.exists():
            raise BadMap(f"{path}: exists already")
        try:
            path.touch(exist_ok=False)
        except OSError as error:
            raise BadMap(f"{path}: cannot be created ({error.strerror})") from None
        try:
            connection = schema.connect(path)
            with schema.guarded(path):
                connection.execute(f"PRAGMA page_size = {schema.PAGE_SIZE}")
                connection.execute(f"PRAGMA application_id = {schema.APPLICATION_ID}")
                connection.execute(f"PRAGMA user_version = {schema.SCHEMA_VERSION}")
            return cls._prepared(path, connection, durable=durable, commit_every_s=commit_every_s)
        except BadMap:
            path.unlink(missing_ok=True)
            raise

    @classmethod
    def open(cls, path: Path | str, *, durable: bool = True, commit_every_s: float = 0.5) -> Self:
        """Open a map to go on with it. Raises BadMap for anything that is not a whole map of our schema, for
        one whose rows cannot be (`checks`), and for one that another program has open.
        """
        path = Path(path)
        schema.check_file(path)
        connection = schema.connect(path)
        try:
            checks.check_content(path, connection)
            with schema.guarded(path):
                schema.claim(path, connection)
            return cls._prepared(path, connection, durable=durable, commit_every_s=commit_every_s)
        except BadMap:
            connection.close()
            raise

    @classmethod
    def view(cls, path: Path | str) -> Self:
        """Open a map to look into it, also while another program maps and on media that cannot be written."""
        path = Path(path)
        schema.check_file(path)
        connection = schema.connect_readonly(path)
        try:
            checks.check_content(path, connection)
            return cls(path, connection, readonly=True)
        except BadMap:
            connection.close()
            raise

    @classmethod
    @contextmanager
    def editing(cls, path: Path | str) -> Iterator[Self]:
        """Open a map for one change, kept when the body ends well; else the file stays as it was.

        Raises BadMap as `open` does.
        """
        path = Path(path)
        schema.check_file(path)
        connection = schema.connect(path)
        try:
            checks.check_content(path, connection)
            with schema.guarded(path):
                schema.claim(path, connection)
                connection.execute("BEGIN IMMEDIATE")
                schema.complete(connection)
                store = cls(path, connection)
            yield store
        except BaseException:
            connection.close()  # which rolls back
            raise
        store.close()

    @classmethod
    def _prepared(
        cls, path: Path, connection: sqlite3.Connection, *, durable: bool, commit_every_s: float
    ) -> Self:
        with schema.guarded(path):
            connection.execute("PRAGMA journal_mode = WAL")
            connection.execute(f"PRAGMA synchronous = {'FULL' if durable else 'NORMAL'}")
            connection.execute("BEGIN IMMEDIATE")
            schema.complete(connection)
            connection.execute("COMMIT")
            return cls(path, connection, commit_every_s=commit_every_s)

    # -- transactions ---------------------------------------------------------------------------------------

    def tick(self, now_s: float) -> None:
        """Tell the data's time; commits what has waited `commit_every_s`."""
        if self._stamp_s is None:
            self._carry_blocks_over(now_s)
        self._stamp_s = now_s
        if self._begun_s is None or not self._db.in_transaction:
            return
        if not 0.0 <= now_s - self._begun_s < self.commit_every_s:
            self.commit()

    def commit(self) -> None:
        """Make everything so far safe."""
        if self._db.in_transaction:
            if self.before_commit is not None:
                self.before_commit()
            with schema.guarded(self.path):
                if self._stamp_s is not None and self._blocked():
                    self.set_meta("stamp_s", self._stamp_s)
                self._db.execute("COMMIT")
            self._uncommitted.clear()

    @property
    def uncommitted(self) -> frozenset[int]:
        """The nodes that are new, or whose edges changed, since readers of the file could last see them."""
        return frozenset(self._uncommitted)

    def _blocked(self) -> list[tuple[int, float]]:
        """Return edges that are closed for a while, and until when."""
        sql = "SELECT id, blocked FROM edge WHERE blocked IS NOT NULL AND blocked < ?"
        return list(self.query(sql, (FOR_EVER_S,)))

    def _carry_blocks_over(self, now_s: float) -> None:
        """Count what is left of a block on from now: the clock may have begun anew since it was written."""
        left_s = self.meta("stamp_s")
        for edge_id, blocked_s in self._blocked() if left_s is not None else []:
            edge = self.edge(edge_id)
            if edge is not None:
                until_s = now_s + blocked_s - left_s if blocked_s > left_s else 0.0
                self.put_edge(replace(edge, blocked_until_s=until_s))

    def close(self) -> None:
        """Commit, fold the write-ahead log into the one file, close. May be called again.

        Raises BadMap when the disk refuses it, and OSError when a deleted file cannot be written anew.
        """
        if self._closed:
            return
        self._closed = True
        if self._readonly:
            self._db.close()
            return
        try:
            self._write("DELETE FROM change WHERE version < ?", (self.version,))
            self.commit()
            if not self._in_place():
                self._write_anew()
                return
            with schema.guarded(self.path):
                self._db.execute("PRAGMA wal_checkpoint(TRUNCATE)")
            with contextlib.suppress(
                sqlite3.OperationalError
            ):  # a reader holds the file: it stays in WAL mode
                self._db.execute("PRAGMA busy_timeout = 0")
                self._db.execute("PRAGMA journal_mode = DELETE")
                size = self.path.stat().st_size
                if size < STRIP_BELOW_BYTES:
                    schema.strip(self._db)
                if size < COMPACT_BELOW_BYTES:
                    self._db.execute("VACUUM")
        finally:
            self._db.close()

    def _in_place(self) -> bool:
        """Return True if the open file is the one at the map's path."""
        try:
            return os.path.samestat(self._file, self.path.stat())
        except OSError:
            return False

    def _write_anew(self) -> None:
        """Write a copy to the map's path, from which the open file has gone; beside it if another took it."""
        while self.path.exists():
            self.path = self.path.with_stem(f"{self.path.stem}-kept")
        self.path.parent.mkdir(parents=True, exist_ok=True)
        for suffix in ("-wal", "-shm"):  # of the file that has gone: they would be taken for the copy's
            self.path.with_name(self.path.name + suffix).unlink(missing_ok=True)
        with schema.guarded(self.path), contextlib.closing(sqlite3.connect(self.path)) as copy:
            self._db.backup(copy)
            copy.execute("PRAGMA journal_mode = DELETE")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @contextmanager
    def whole(self) -> Iterator[None]:
        """Keep what the body writes as a whole: when it raises, nothing of it."""
        self._begin()
        with schema.guarded(self.path):
            self._db.execute("SAVEPOINT whole")
        try:
            yield
        except BaseException:
            with schema.guarded(self.path):
                self._db.execute("ROLLBACK TO whole")
                self._db.execute("RELEASE whole")
            raise
        with schema.guarded(self.path):
            self._db.execute("RELEASE whole")

    def check_rows(self) -> None:
        """Raise BadMap when some row, uncommitted writes included, holds what no map of ours does."""
        with schema.guarded(self.path):
            checks.check_rows(self.path, self._db)

    def write(self, sql: str, values: Iterable[Any] = ()) -> None:
        """Run one statement inside the open transaction (edits and undo)."""
        self._write(sql, tuple(values))

    def _write(self, sql: str, values: tuple[Any, ...]) -> None:
        self._begin()
        with schema.guarded(self.path):
            self._db.execute(sql, values)

    def _begin(self) -> None:
        if not self._db.in_transaction:
            with schema.guarded(self.path):
                self._db.execute("BEGIN IMMEDIATE")
            self._begun_s = self._stamp_s or 0.0

    def query(self, sql: str, values: Iterable[Any] = ()) -> Iterator[tuple[Any, ...]]:
        """Iterate over the rows of a read, uncommitted writes included."""
        with schema.guarded(self.path):
            yield from self._db.execute(sql, tuple(values))

    def _one(self, sql: str, values: tuple[Any, ...] = ()) -> Any:
        with schema.guarded(self.path):
            row = self._db.execute(sql, values).fetchone()
        return None if row is None else row[0]

    # -- nodes ----------------------------------------------------------------------------------------------

    def add_node(self, *, area_id: int = 1, level: int = 0, created_s: float = 0.0) -> Node:
        """Make a node with an ID never used before in this file."""
        node = Node(self._next_node, area_id, level, created_s)
        self._next_node += 1
        self._write(f"INSERT INTO node({NODE_COLUMNS}) VALUES(?, ?, ?, ?, ?, ?)", node_row(node))
        self._uncommitted.add(node.node_id)
        return node

    def node(self, node_id: int) -> Node | None:
        """Return the node, None when the map has none of this ID."""
        for row in self.query(f"SELECT {NODE_COLUMNS} FROM node WHERE id = ?", (node_id,)):  # noqa: S608
            return node_from(row)
        return None

    def nodes(self, since_id: int = 0) -> Iterator[Node]:
        """Iterate over all nodes from one on, by ID; streams, so also over maps larger than memory."""
        wanted = f"SELECT {NODE_COLUMNS} FROM node WHERE id >= ? ORDER BY id"  # noqa: S608
        return (node_from(row) for row in self.query(wanted, (since_id,)))

    def put_node(self, node: Node) -> None:
        """Write a changed node."""
        self._write(
            "UPDATE node SET area = ?, level = ?, created = ?, visits = ?, doubts = ? WHERE id = ?",
            (node.area_id, node.level, node.created_s, node.visits, node.doubts, node.node_id),
        )

    def delete_node(self, node_id: int) -> None:
        """Remove a node with its edges, names and marks; its doors move to a neighbour. Its ID stays used."""
        self._rehome_doors(node_id)
        for edge in self.edges_of(node_id):
            self.delete_edge(edge.edge_id)
        for table in ("name", "place", "placeholder", "ground", "mark"):
            self._write(f"DELETE FROM {table} WHERE node = ?", (node_id,))  # noqa: S608
        self._write("DELETE FROM node WHERE id = ?", (node_id,))
        self.set_meta("next_node", self._next_node)

    def _rehome_doors(self, node_id: int) -> None:
        """Let the doors in a node's frame stand in that of its nearest neighbour, as `edges_of` has it."""
        doors = list(self.query("SELECT id, x, y, yaw FROM door WHERE node = ?", (node_id,)))
        edges = self.edges_of(node_id) if doors else []
        if not edges:
            self._write("DELETE FROM door WHERE node = ?", (node_id,))
            return
        edge = min(edges, key=lambda edge: edge.length_m)
        other_id = edge.other(node_id)
        for door_id, *pose in doors:
            x, y, yaw = compose(edge.seen_from(other_id), np.array(pose)).tolist()
            values = (other_id, x, y, yaw, door_id)
            self._write("UPDATE door SET node = ?, x = ?, y = ?, yaw = ? WHERE id = ?", values)

    def place(self, node_id: int) -> Place | None:
        """Return a node's localisation data, None when it has none yet."""
        sql = "SELECT taken, boundary, descriptor FROM place WHERE node = ?"
        for taken_s, boundary, descriptor in self.query(sql, (node_id,)):
            return Place(taken_s, boundary, descriptor or b"")
        return None

    def put_place(self, node_id: int, place: Place) -> None:
        """Write a node's localisation data over what it had."""
        self._write(
            "REPLACE INTO place(node, taken, boundary, descriptor) VALUES(?, ?, ?, ?)",
            (node_id, place.taken_s, place.boundary, place.descriptor or None),
        )

    def places(self, after_id: int = 0) -> Iterator[tuple[int, Place]]:
        """Iterate over (node ID, localisation data) of all nodes beyond `after_id` that have it, by ID."""
        sql = "SELECT node, taken, boundary, descriptor FROM place WHERE node > ? ORDER BY node"
        for node_id, taken_s, boundary, descriptor in self.query(sql, (after_id,)):
            yield node_id, Place(taken_s, boundary, descriptor or b"")

    # -- edges ----------------------------------------------------------------------------------------------

    def add_edge(self, edge: Edge) -> Edge:
        """Write a new edge; returns it with an ID never used before (`edge.edge_id` is ignored)."""
        edge = replace(edge, edge_id=self._next_edge)
        self._next_edge += 1
        self._write(f"INSERT INTO edge({EDGE_COLUMNS}) VALUES(?, ?, ?, ?, ?, ?, ?, ?)", edge_row(edge))
        self._changed(edge.source_id, edge.target_id)
        return edge

    def edge(self, edge_id: int) -> Edge | None:
        """Return the edge, None when the map has none of this ID."""
        for row in self.query(f"SELECT {EDGE_COLUMNS} FROM edge WHERE id = ?", (edge_id,)):  # noqa: S608
            return edge_from(row)
        return None

    def edges(self) -> Iterator[Edge]:
        """Iterate over all edges by ID; streams."""
        return (edge_from(row) for row in self.query(f"SELECT {EDGE_COLUMNS} FROM edge ORDER BY id"))  # noqa: S608

    def edges_of(self, node_id: int) -> list[Edge]:
        """Return the edges at a node by ID; empty for an unknown node."""
        sql = f"SELECT {EDGE_COLUMNS} FROM edge WHERE source = ?1 UNION ALL SELECT {EDGE_COLUMNS} FROM edge WHERE target = ?1"  # noqa: E501, S608
        return sorted((edge_from(row) for row in self.query(sql, (node_id,))), key=lambda edge: edge.edge_id)

    def put_edge(self, edge: Edge) -> None:
        """Write a changed edge over the one with its ID."""
        sql = f"REPLACE INTO edge({EDGE_COLUMNS}) VALUES(?, ?, ?, ?, ?, ?, ?, ?)"
        self._write(sql, edge_row(edge))
        self._changed(edge.source_id, edge.target_id)

    def delete_edge(self, edge_id: int) -> None:
        """Remove an edge. Its ID stays used for ever."""
        edge = self.edge(edge_id)
        if edge is None:
            return
        self._write("DELETE FROM edge WHERE id = ?", (edge_id,))
        self._write("DELETE FROM door_edge WHERE edge = ?", (edge_id,))
        self.set_meta("next_edge", self._next_edge)
        self._changed(edge.source_id, edge.target_id)

    def _changed(self, *node_ids: int) -> None:
        self._uncommitted.update(node_ids)
        for node_id in node_ids:
            self.version += 1
            self._write("INSERT INTO change(version, node) VALUES(?, ?)", (self.version, node_id))
        if self.version % 1024 < len(node_ids):
            self._write("DELETE FROM change WHERE version <= ?", (self.version - KEPT_CHANGES,))

    def changed_everywhere(self) -> None:
        """Tell readers to forget all they know (after undo)."""
        self.version += KEPT_CHANGES + 1
        self._write("DELETE FROM change", ())
        self._write("INSERT INTO change(version, node) VALUES(?, 0)", (self.version,))
        self._next_node = max(self._next_node, self._next_id("node"))
        self._next_edge = max(self._next_edge, self._next_id("edge"))

    # -- names, openings, marks, meta -----------------------------------------------------------------------

    def names(self) -> dict[str, int]:
        """Return all names and their nodes."""
        return dict(self.query("SELECT name, node FROM name ORDER BY name"))

    def set_name(self, name: str, node_id: int) -> None:
        """Give a node a name; a name belongs to one node."""
        self._write("REPLACE INTO name(name, node) VALUES(?, ?)", (name, node_id))

    def add_placeholder(self, opening: Placeholder) -> Placeholder:
        """Write an unexplored opening; returns it with its ID."""
        number = int(self._one("SELECT coalesce(max(id), 0) + 1 FROM placeholder"))
        opening = replace(opening, placeholder_id=number)
        self.put_placeholder(opening)
        return opening

    def put_placeholder(self, opening: Placeholder) -> None:
        """Write a changed opening over the one with its ID."""
        self._write(
            "REPLACE INTO placeholder(id, node, x, y, yaw, width, state) VALUES(?, ?, ?, ?, ?, ?, ?)",
            (
                opening.placeholder_id,
                opening.node_id,
                opening.x_m,
                opening.y_m,
                opening.yaw_rad,
                opening.width_m,
                str(opening.state),
            ),
        )

    def end_placeholder(self, number: int, state: OpeningState) -> None:
        """Say what became of an opening; of one that is not there nothing is said."""
        self._write("UPDATE placeholder SET state = ? WHERE id = ?", (str(state), number))

    def placeholders(self) -> list[Placeholder]:
        """Return all openings."""
        rows = self.query("SELECT id, node, x, y, yaw, width, state FROM placeholder ORDER BY id")
        return [placeholder_from(row) for row in rows]

    def put_ground(self, node_id: int, picture: bytes) -> None:
        """Write what has been seen around a node over what was there before."""
        self._write("REPLACE INTO ground(node, picture) VALUES(?, ?)", (node_id, picture))

    def add_mark(self, mark: Mark) -> None:
        """Remember something felt at a node (`mark.mark_id` is ignored)."""
        values = (mark.node_id, mark.kind, mark.x_m, mark.y_m, mark.stamp_s)
        self._write("INSERT INTO mark(node, kind, x, y, stamp) VALUES(?, ?, ?, ?, ?)", values)

    def meta(self, key: str) -> Any:
        """Return a stored value, None when there is none."""
        return self._one("SELECT value FROM meta WHERE key = ?", (key,))

    def set_meta(self, key: str, value: float | str | bytes | None) -> None:
        """Store a value by name."""
        self._write("REPLACE INTO meta(key, value) VALUES(?, ?)", (key, value))

    def count(self, table: str) -> int:
        """Return how many rows `table` (node, edge, ...) has."""
        return int(self._one(f"SELECT count(*) FROM {table}"))  # noqa: S608

    def _next_id(self, table: str) -> int:
        highest = int(self._one(f"SELECT coalesce(max(id), 0) FROM {table}"))  # noqa: S608
        return max(highest + 1, int(self.meta(f"next_{table}") or 1))
