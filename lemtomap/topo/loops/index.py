"""Look-up of places over all nodes of a map file: a k-d tree whose leaves are rows of the file.

Leaves hold up to a few dozen descriptors and split as they fill (Robinson 1981); a look-up opens the leaves
nearest to the descriptor first and stops after a fixed number (best bin first, Beis and Lowe 1997), so its
cost grows with the logarithm of the map. Only the splits are kept in memory: about a quarter of a byte a
node.

Whoever writes localisation data into the file (mapper, editor, undo), triggers of the file queue the change,
and `catch_up` takes it into the tree a few at a time: the two never differ for long.
"""

import heapq
from array import array
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from lemtomap.topo.file import schema
from lemtomap.topo.loops.descriptor import BYTES, unpack

LEAF_ENTRIES = 96
QUEUE = (
    f"CREATE TABLE place_fresh{schema.LOOK_UP_TABLES['place_fresh']}",
    *(f"CREATE TRIGGER {name} {what}" for name, what in schema.TRIGGERS.items()),
    "INSERT INTO place_fresh(node, was, now) SELECT node, NULL, descriptor FROM place",
)
AT_ONCE = 64  # changes taken into the tree at one call: 3 ms
_ENTRY = np.dtype([("node_id", "<i8"), ("descriptor", "u1", (BYTES,))])
_NO_SPLIT = -1
_ROOT = 0


class Table(Protocol):
    """The two things the index needs of a map file; changes belong to the file's open transaction."""

    def write(self, sql: str, values: Iterable[Any] = ()) -> None:
        """Run one statement."""
        ...

    def query(self, sql: str, values: Iterable[Any] = ()) -> Iterator[tuple[Any, ...]]:
        """Iterate over the rows of a read."""
        ...


@dataclass(frozen=True, slots=True)
class Alike:
    """A node whose place resembles the one looked for."""

    node_id: int
    distance: float
    """Of the descriptors, see descriptor.distances."""


class PlaceIndex:
    """All descriptors of one map, in the map's own file."""

    def __init__(self, table: Table) -> None:
        self._table = table
        for name in ("place_leaf", "place_split"):
            table.write(f"CREATE TABLE IF NOT EXISTS {name}{schema.LOOK_UP_TABLES[name]}")
        self._axis, self._cut = array("b"), array("B")
        self._low, self._high = array("i"), array("i")
        self._grow(1)
        for at, axis, cut, low, high in table.query(
            "SELECT id, axis, cut, low, high FROM place_split ORDER BY id"
        ):
            self._grow(max(at, low, high) + 1)
            self._axis[at], self._cut[at], self._low[at], self._high[at] = axis, cut, low, high

    def _grow(self, size: int) -> None:
        missing = size - len(self._axis)
        if missing > 0:
            self._axis.extend([_NO_SPLIT] * missing)
            self._cut.extend([0] * missing)
            self._low.extend([0] * missing)
            self._high.extend([0] * missing)

    @classmethod
    def of_map(cls, table: Table) -> Self:
        """Return the index of a map file; from now on it follows the file's localisation data."""
        index = cls(table)
        if not any(table.query("SELECT 1 FROM sqlite_master WHERE name = 'place_fresh'")):
            for statement in QUEUE:
                table.write(statement)
        return index

    def catch_up(self, limit: int = AT_ONCE) -> bool:
        """Take up to `limit` queued changes into the tree; return True when none are left."""
        sql = "SELECT id, node, was, now FROM place_fresh ORDER BY id LIMIT ?"
        queued = list(self._table.query(sql, (limit,)))
        for _, node_id, was, now in queued:
            if was and len(was) == BYTES:
                self.remove(node_id, was)
            if now and len(now) == BYTES:
                self.add(node_id, now)
        if queued:
            self._table.write("DELETE FROM place_fresh WHERE id <= ?", (queued[-1][0],))
        return len(queued) < limit

    def add(self, node_id: int, descriptor: bytes) -> None:
        """Add a node's place. A node that has one already must be removed first."""
        leaf = self._descend(descriptor)
        entries = np.append(
            self._entries(leaf), np.array([(node_id, np.frombuffer(descriptor, "u1"))], _ENTRY)
        )
        if len(entries) > LEAF_ENTRIES and (entries["descriptor"] != entries["descriptor"][0]).any():
            self._split(leaf, entries)
        else:
            self._put(leaf, entries)

    def remove(self, node_id: int, descriptor: bytes) -> None:
        """Take a node's place out again; nothing happens when it is not there."""
        leaf = self._descend(descriptor)
        entries = self._entries(leaf)
        self._put(leaf, entries[entries["node_id"] != node_id])

    def nearest(self, descriptor: bytes, count: int, *, leaves: int = 24) -> list[Alike]:
        """Return up to `count` nodes whose places look most alike, best first, from the `leaves` nearest
        leaves.
        """
        wanted = unpack(descriptor)[0]
        queue: list[tuple[float, int]] = [(0.0, _ROOT)]
        found: list[NDArray[np.void]] = []
        while queue and len(found) < leaves:
            gap, at = heapq.heappop(queue)
            while (axis := self._axis[at]) != _NO_SPLIT:
                beyond = float(wanted[axis]) - self._cut[at]
                near, far = (
                    (self._high[at], self._low[at]) if beyond >= 0.0 else (self._low[at], self._high[at])
                )
                heapq.heappush(queue, (gap + beyond * beyond, far))
                at = near
            found.append(self._entries(at))
        entries = np.concatenate(found)
        unlike = np.linalg.norm(entries["descriptor"].astype(np.float32) - wanted, axis=1)
        best = np.argsort(unlike, kind="stable")[:count]
        return [Alike(int(entries["node_id"][i]), float(unlike[i])) for i in best]

    def _descend(self, descriptor: bytes) -> int:
        at = _ROOT
        while (axis := self._axis[at]) != _NO_SPLIT:
            at = self._high[at] if descriptor[axis] >= self._cut[at] else self._low[at]
        return at

    def _entries(self, leaf: int) -> NDArray[np.void]:
        for (blob,) in self._table.query("SELECT entries FROM place_leaf WHERE id = ?", (leaf,)):
            return np.frombuffer(blob, _ENTRY)
        return np.empty(0, _ENTRY)

    def _put(self, leaf: int, entries: NDArray[np.void]) -> None:
        self._table.write("REPLACE INTO place_leaf(id, entries) VALUES(?, ?)", (leaf, entries.tobytes()))

    def _split(self, leaf: int, entries: NDArray[np.void]) -> None:
        """Make a full leaf an inner node over two: cut the widest axis at its median."""
        values = entries["descriptor"]
        axis = int(np.argmax(values.astype(np.float32).std(axis=0)))
        column = values[:, axis]
        cut = int(np.median(column))
        cut = max(cut, int(column.min()) + 1)  # the low side is never empty
        high = column >= cut
        low_id, high_id = len(self._axis), len(self._axis) + 1
        self._grow(high_id + 1)
        self._axis[leaf], self._cut[leaf], self._low[leaf], self._high[leaf] = axis, cut, low_id, high_id
        self._table.write(
            "INSERT INTO place_split(id, axis, cut, low, high) VALUES(?, ?, ?, ?, ?)",
            (leaf, axis, cut, low_id, high_id),
        )
        self._table.write("DELETE FROM place_leaf WHERE id = ?", (leaf,))
        self._put(low_id, entries[~high])
        self._put(high_id, entries[high])
