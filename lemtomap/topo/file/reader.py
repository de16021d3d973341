"""The map as the navigation thread sees it: its own read-only connection, always the last committed state."""

from collections import OrderedDict
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Self

import numpy as np

from lemtomap.errors import BadMap
from lemtomap.topo.file import checks, schema
from lemtomap.topo.file.rows import (
    MEASURE,
    placeholder_from,
    planar_length_m,
    type_code,
)
from lemtomap.topo.graph import (
    USUAL_SPEED_MPS,
    Mark,
    Placeholder,
    detour,
)
from lemtomap.topo.naming import LONGEST_NUMBER
from lemtomap.types import EdgeTable, EdgeType, RouteEdge

_NEIGHBOURS = (
    "SELECT id, target, time, blocked, measure, type FROM edge WHERE source = ?1 "
    "UNION ALL SELECT id, source, time, blocked, measure, type FROM edge WHERE target = ?1"
)
_ALL_EDGES = "SELECT id, source, target, time, blocked, measure, type FROM edge"
_EDGES_AT = _ALL_EDGES + " WHERE source = ?1 OR target = ?1"
_DETOURS = np.array([detour(kind) for kind in sorted(EdgeType, key=type_code)])  # by the file's type code
_AREA_OF_NAME = (
    "SELECT id FROM area WHERE name = ?1 OR EXISTS "
    "(SELECT 1 FROM json_each(area.tags, '$.names') WHERE value = ?1)"
)
_AREA_OF_NUMBER = (
    "SELECT id FROM area WHERE id = ?1 OR EXISTS "
    "(SELECT 1 FROM json_each(area.tags, '$.aliases') WHERE value = ?1)"
)
_CLOSURE = type_code(EdgeType.LOOP_CLOSING)
_MEASURE = np.dtype(
    {"names": ["x", "y"], "formats": ["<f8", "<f8"], "offsets": [0, 8], "itemsize": MEASURE.size}
)
CACHED_NODES = 16_384  # some 500 bytes each, 8 MB: more than a map has that is planned over node by node


class TopoReader:
    """A RouteGraph over a map file that another connection may be writing."""

    def __init__(
        self, path: Path | str, *, cached_nodes: int = CACHED_NODES, is_checked: bool = False
    ) -> None:
        """Open a map. `is_checked`: a TopoStore of this program holds it, and has checked all of it."""
        self.path = Path(path)
        schema.check_file(self.path)
        self._db = schema.connect_readonly(self.path)
        if not is_checked:
            try:
                checks.check_content(self.path, self._db)
            except BadMap:
                self._db.close()
                raise
        self._cached_nodes = cached_nodes
        self._edges: OrderedDict[int, Sequence[RouteEdge]] = OrderedDict()
        self._seen_data_version = -1
        self._version = 0

    @property
    def version(self) -> int:
        """Changes whenever an edge appears, goes, or changes its cost or blocking; cheap to ask."""
        with schema.guarded(self.path):
            (data_version,) = self._db.execute("PRAGMA data_version").fetchone()
            if data_version != self._seen_data_version:
                self._seen_data_version = data_version
                self._follow()
        return self._version

    def _follow(self) -> None:
        """Forget what changed since the version seen last: a few nodes, or all after a long absence."""
        oldest, newest = self._db.execute(
            "SELECT coalesce(min(version), 0), coalesce(max(version), 0) FROM change"
        ).fetchone()
        if newest == self._version:
            return
        if oldest > self._version + 1:
            self._edges.clear()
        else:
            changed = self._db.execute("SELECT node FROM change WHERE version > ?", (self._version,))
            for (node_id,) in changed:
                self._edges.pop(node_id, None)
        self._version = newest

    def has_node(self, node_id: int) -> bool:
        """Return True if the map knows this node."""
        with schema.guarded(self.path):
            return self._db.execute("SELECT 1 FROM node WHERE id = ?", (node_id,)).fetchone() is not None

    def edges_of(self, node_id: int) -> Sequence[RouteEdge]:
        """Return the edges at a node, blocked ones too; empty for an unknown node."""
        edges = self._edges.get(node_id)
        if edges is None:
            edges = self._read(node_id)
            self._edges[node_id] = edges
            if len(self._edges) > self._cached_nodes:
                self._edges.popitem(last=False)
        return edges

    def _read(self, node_id: int) -> Sequence[RouteEdge]:
        with schema.guarded(self.path):
            rows = self._db.execute(_NEIGHBOURS, (node_id,)).fetchall()
        edges = []
        for edge_id, other_id, time_s, blocked_s, measure, code in rows:
            length_m = planar_length_m(measure)
            expected_s = length_m / USUAL_SPEED_MPS * _DETOURS[code] if time_s is None else time_s
            proven = time_s is not None or code != _CLOSURE
            edges.append(RouteEdge(edge_id, other_id, length_m, expected_s, blocked_s or 0.0, proven))
        return tuple(edges)

    def node_count(self) -> int:
        """Return about how many nodes the map has: the largest ID, which costs nothing to find."""
        with schema.guarded(self.path):
            return int(self._db.execute("SELECT coalesce(max(id), 0) FROM node").fetchone()[0])

    def edge_table(self, node_ids: Iterable[int] | None = None) -> EdgeTable:
        """Return all edges, or those at some nodes, in columns: for planning across a large map."""
        with schema.guarded(self.path):
            if node_ids is None:
                rows = self._db.execute(_ALL_EDGES).fetchall()
            else:
                found: dict[int, tuple[Any, ...]] = {}  # an edge is met from both its ends
                for node_id in set(node_ids):
                    found.update((row[0], row) for row in self._db.execute(_EDGES_AT, (node_id,)))
                rows = list(found.values())
        return _table(rows)

    def changed_since(self, version: int) -> Sequence[int] | None:
        """Return the nodes whose edges changed after a version; None when that is too long ago to tell."""
        with schema.guarded(self.path):
            oldest = self._db.execute("SELECT coalesce(min(version), 0) FROM change").fetchone()[0]
            if oldest > version + 1:
                return None
            rows = self._db.execute("SELECT DISTINCT node FROM change WHERE version > ?", (version,))
            return [int(node_id) for (node_id,) in rows]

    def openings(self) -> list[Placeholder]:
        """Return the openings towards unexplored space, explored and closed ones too."""
        with schema.guarded(self.path):
            rows = self._db.execute("SELECT id, node, x, y, yaw, width, state FROM placeholder ORDER BY id")
            return [placeholder_from(row) for row in rows]

    def ground_seen(self, node_id: int) -> bytes | None:
        """Return what exploration told of the ground around a node, None when it told nothing."""
        with schema.guarded(self.path):
            row = self._db.execute("SELECT picture FROM ground WHERE node = ?", (node_id,)).fetchone()
        return None if row is None else bytes(row[0])

    def marks(self) -> list[Mark]:
        """Return everything that was felt rather than seen."""
        with schema.guarded(self.path):
            return [Mark(*row) for row in self._db.execute("SELECT id, node, kind, x, y, stamp FROM mark")]

    def node_of(self, name: str) -> int | None:
        """Return the node that bears this name."""
        with schema.guarded(self.path):
            row = self._db.execute("SELECT node FROM name WHERE name = ?", (name,)).fetchone()
        return None if row is None else int(row[0])

    def names(self) -> dict[str, int]:
        """Return every name, and the node that bears it."""
        with schema.guarded(self.path):
            return dict(self._db.execute("SELECT name, node FROM name"))

    def area_nodes(self, place: str) -> list[int]:
        """Return the nodes of the area meant by `area:N` or a name, also of one that merged; empty: none."""
        number = place.removeprefix("area:")
        if number != place and not (number.isdecimal() and len(number) <= LONGEST_NUMBER):
            return []
        with schema.guarded(self.path):
            if number == place:
                rows = self._db.execute(_AREA_OF_NAME, (place,)).fetchall()
            else:
                rows = self._db.execute(_AREA_OF_NUMBER, (int(number),)).fetchall()
            found = [self._db.execute("SELECT id FROM node WHERE area = ?", row).fetchall() for row in rows]
        return [node_id for nodes in found for (node_id,) in nodes]

    def close(self) -> None:
        """Close the connection; the file is untouched."""
        self._db.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _table(rows: Sequence[tuple[Any, ...]]) -> EdgeTable:
    edge_id, source, target, time, blocked, measure, code = zip(*rows, strict=True) if rows else ((),) * 7
    values = np.frombuffer(b"".join(measure), dtype=_MEASURE)
    length_m = np.hypot(values["x"], values["y"])
    learnt_s = np.array(time, dtype=np.float64)  # None becomes NaN
    straight_s = length_m / USUAL_SPEED_MPS * _DETOURS[np.array(code, dtype=np.intp)]
    return EdgeTable(
        edge_id=np.array(edge_id, dtype=np.int64),
        source_id=np.array(source, dtype=np.int64),
        target_id=np.array(target, dtype=np.int64),
        length_m=length_m.astype(np.float32),
        time_s=np.where(np.isnan(learnt_s), straight_s, learnt_s).astype(np.float32),
        blocked_until_s=np.nan_to_num(np.array(blocked, dtype=np.float64)),
        proven=~np.isnan(learnt_s) | (np.array(code, dtype=np.intp) != _CLOSURE),
    )
