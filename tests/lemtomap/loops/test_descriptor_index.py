"""Descriptors that do not mind where the robot stands, and the index that finds them."""

import sqlite3

import numpy as np
import pytest

from lemtomap.se2 import transform
from lemtomap.topo.file.journal import recorded, undo
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.graph import Place
from lemtomap.topo.loops.descriptor import (
    BYTES,
    describe,
    distances,
    unpack,
)
from lemtomap.topo.loops.index import LEAF_ENTRIES, PlaceIndex


class Table:
    def __init__(self):
        self.db = sqlite3.connect(":memory:", isolation_level=None)

    def write(self, sql, values=()):
        self.db.execute(sql, tuple(values))

    def query(self, sql, values=()):
        yield from self.db.execute(sql, tuple(values))


@pytest.fixture
def table():
    table = Table()
    yield table
    table.db.close()


def place(seed):
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-4.0, 4.0, (6, 2))
    return np.concatenate(
        [np.linspace(a, b, 60) for a, b in zip(corners, np.roll(corners, 1, axis=0), strict=True)]
    )


def test_a_turned_and_shifted_place_looks_the_same_and_another_does_not():
    here = place(0)
    moved = transform(np.array([0.7, -0.4, 2.1]), here)
    others = np.concatenate([unpack(describe(place(seed))) for seed in range(1, 30)])
    same = distances(describe(here), unpack(describe(moved)))[0]
    assert same < 20.0
    assert same < 0.3 * distances(describe(here), others).min()


def test_no_points_have_a_descriptor_too():
    assert describe(np.empty((0, 2))) == bytes(BYTES)


def test_look_up_finds_what_a_full_search_finds(table):
    rng = np.random.default_rng(2)
    index = PlaceIndex(table)
    every = rng.normal(100, 20, (3000, BYTES)).clip(0, 255).astype(np.uint8)
    for node_id, row in enumerate(every):
        index.add(node_id, row.tobytes())
    found = 0
    for node_id in range(0, 3000, 60):
        wanted = (every[node_id] + rng.normal(0, 4, BYTES)).clip(0, 255).astype(np.uint8)
        found += node_id in [alike.node_id for alike in index.nearest(wanted.tobytes(), 5)]
    assert found >= 48  # of 50
    exact = index.nearest(wanted.tobytes(), 7, leaves=10**6)
    slow = np.argsort(np.linalg.norm(every.astype(float) - wanted, axis=1), kind="stable")[:7]
    assert [alike.node_id for alike in exact] == slow.tolist()


def test_an_index_reopened_goes_on_where_it_was(table):
    index = PlaceIndex(table)
    codes = [describe(place(seed)) for seed in range(2 * LEAF_ENTRIES)]
    for node_id, code in enumerate(codes):
        index.add(node_id, code)
    again = PlaceIndex(table)
    assert again.nearest(codes[17], 1)[0].node_id == 17
    again.remove(17, codes[17])
    assert all(alike.node_id != 17 for alike in again.nearest(codes[17], 10**6, leaves=10**6))


def test_equal_descriptors_without_end_are_kept(table):
    index = PlaceIndex(table)
    for node_id in range(3 * LEAF_ENTRIES):
        index.add(node_id, bytes(BYTES))
    assert len(index.nearest(bytes(BYTES), 10**6)) == 3 * LEAF_ENTRIES


def test_the_index_follows_what_anybody_writes_into_the_map(tmp_path):
    codes = [describe(place(seed)) for seed in range(4)]
    with TopoStore.create(tmp_path / "map.lemto") as store:
        node_ids = [store.add_node().node_id for _ in codes]
        store.put_place(node_ids[0], Place(0.0, b"\x02\x01", codes[0]))
        index = PlaceIndex.of_map(store)
        for node_id, code in zip(node_ids[1:], codes[1:], strict=True):
            store.put_place(node_id, Place(0.0, b"\x02\x01", code))
        assert index.catch_up()
        assert [index.nearest(code, 1)[0].node_id for code in codes] == node_ids
        with recorded(store, "delete") as edit:
            edit.touch("place", node_ids[2])
            edit.touch("node", node_ids[2])
            store.delete_node(node_ids[2])
        store.put_place(node_ids[1], Place(1.0, b"\x02\x01", codes[2]))
        index.catch_up()
        alike = index.nearest(codes[2], 9)
        assert (alike[0].node_id, alike[0].distance) == (node_ids[1], 0.0)
        assert len(alike) == 3
        undo(store)
        assert not PlaceIndex.of_map(store).catch_up(limit=1)
        assert {each.node_id for each in index.nearest(codes[2], 2)} == {node_ids[1], node_ids[2]}
