"""What may go from a map that is driven through again and again, and what stays."""

import itertools

import numpy as np
import pytest

from lemtomap.topo.file import edit
from lemtomap.topo.file.paging import PagedGraph
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.graph import Edge, Place, Placeholder
from lemtomap.topo.place import encode_place
from lemtomap.topo.whole.pruning import prune
from lemtomap.types import EdgeType

SURE = np.diag([1e-4, 1e-4, 1e-5])
FAR_WALL = np.stack([np.linspace(-4, 4, 80), np.full(80, 3.0)], axis=1)


class Building:
    """Nodes at known places along a corridor, joined as a drive joins them."""

    def __init__(self, path):
        self.store = TopoStore.create(path, durable=False)
        self.at = {}

    def node(self, x, y, wall=FAR_WALL):
        node_id = self.store.add_node().node_id
        self.at[node_id] = np.array([x, y])
        self.store.put_place(node_id, Place(0.0, encode_place(wall - [0.0, y], 5.0, 240)))
        return node_id

    def join(self, *pairs, kind=EdgeType.NEAR_NEIGHBOUR):
        for a, b in pairs:
            T = np.array([*(self.at[b] - self.at[a]), 0.0])
            self.store.add_edge(Edge(0, a, b, T, SURE, kind))

    def ways(self, node_ids):
        graph = PagedGraph(self.store)
        reached = {a: graph.reach(a, 1e9) for a in node_ids}
        return {(a, b): reached[a][b].distance_m for a, b in itertools.combinations(node_ids, 2)}


@pytest.fixture
def twice(tmp_path):
    """A corridor of 12 nodes, driven again beside the old nodes by a robot that did not know them."""
    building = Building(tmp_path / "map.lemto")
    old = [building.node(float(k), 0.0) for k in range(12)]
    building.join(*itertools.pairwise(old), kind=EdgeType.ODOMETRY)
    new = [building.node(k + 0.2, 0.3) for k in range(11)]
    building.join(*itertools.pairwise(new), kind=EdgeType.ODOMETRY)
    building.join(*zip(old, new, strict=False))
    yield building, old, new
    building.store.close()


def test_the_second_pass_goes_and_no_way_becomes_longer(twice):
    building, old, new = twice
    before = building.ways(old)
    gone = prune(building.store)
    assert set(gone) <= set(new)
    assert len(gone) >= 10
    after = building.ways(old)
    assert max(after[pair] / before[pair] for pair in before) <= 1.05
    assert prune(building.store) == []


def test_what_somebody_points_at_stays(twice):
    building, _, new = twice
    edit.name_node(building.store, new[3], "kitchen")
    building.store.add_placeholder(Placeholder(0, new[5], 1.0, 0.0, 0.0))
    blocked = edit.edge_between(building.store, new[8], new[9])
    edit.block_edge(building.store, blocked.edge_id)
    gone = prune(building.store)
    assert not {new[3], new[5], new[8], new[9]} & set(gone)
    assert new[10] in gone


def test_a_node_behind_a_wall_or_on_the_only_way_stays(tmp_path):
    building = Building(tmp_path / "map.lemto")
    thin = np.stack([np.linspace(-4, 4, 80), np.full(80, 0.25)], axis=1)
    a, b = building.node(0.0, 0.0), building.node(3.0, 0.0)
    behind = building.node(0.0, 0.5, thin)
    bridge, end = building.node(3.0, 0.5), building.node(3.0, 4.0)
    building.join((a, b), (b, behind), (b, bridge), (bridge, end))
    assert prune(building.store) == []
    building.join((b, end))
    building.store.set_meta("pruned_to", 0)
    assert prune(building.store) == [bridge]
    building.store.close()
