"""Every node of a map has its place in the picture, also one that no scan belongs to yet."""

import numpy as np
import pytest

from lemtomap.robot.output.final_map import _with_the_rest
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.graph import Edge
from lemtomap.types import EdgeType


def test_a_node_without_a_scan_follows_from_its_edge(tmp_path):
    with TopoStore.create(tmp_path / "map.lemto") as store:
        first, second, alone = (store.add_node() for _ in range(3))
        step = np.array([1.0, 0.5, 0.3])
        store.add_edge(Edge(0, first.node_id, second.node_id, step, 1e-4 * np.eye(3), EdgeType.ODOMETRY))
        placed = _with_the_rest(store, {first.node_id: np.array([2.0, 3.0, np.pi / 2])})
    assert placed[second.node_id] == pytest.approx([1.5, 4.0, np.pi / 2 + 0.3])
    assert alone.node_id in placed
