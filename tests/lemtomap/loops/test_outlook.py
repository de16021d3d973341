"""How the doubt about distant nodes grows."""

from collections import defaultdict

import numpy as np
import pytest

from lemtomap.se2 import between, compose
from lemtomap.topo.graph import DirectedEdge, Edge
from lemtomap.topo.loops.config import GateConfig
from lemtomap.topo.loops.outlook import GraphUncertainty
from lemtomap.types import EdgeType

EXACT = GateConfig(shift_var_m2_per_m=0.0, turn_var_rad2_per_m=0.0)
STEP = np.array([1.0, 0.0, np.deg2rad(12.0)])
SIGMA = np.array([0.02, 0.02, 0.01])


class Graph:
    def __init__(self):
        self.at = defaultdict(list)

    def join(self, a, b, T_a_b):
        edge = Edge(0, a, b, T_a_b, np.diag(SIGMA**2), EdgeType.ODOMETRY)
        self.at[a].append(edge)
        self.at[b].append(edge)

    def legs_of(self, node_id):
        return [DirectedEdge.along(edge, node_id) for edge in self.at[node_id]]


def chain(count):
    graph = Graph()
    for k in range(count):
        graph.join(k, k + 1, STEP)
    return graph


def sampled(count, start, draws=4000):
    """Node `count` seen from node `start`, over noisy edges."""
    rng = np.random.default_rng(0)
    pose = np.zeros((draws, 3))
    for _ in range(count - start):
        pose = compose(pose, compose(STEP, rng.normal(0.0, SIGMA, (draws, 3))))
    return pose


@pytest.mark.parametrize("start", [0, 9])
def test_covariance_is_that_of_sampled_chains(start):
    outlook = GraphUncertainty(chain(24), 4, EXACT)
    outlook.advance(100)
    expected = outlook.between(start, 24)
    poses = sampled(24, start)
    assert np.allclose(expected.T_from_node[:2], poses[:, :2].mean(axis=0), atol=0.03)
    cloud = np.cov(poses[:, :2].T)
    assert np.allclose(expected.covariance[:2, :2], cloud, rtol=0.12, atol=0.06 * np.trace(cloud))
    assert expected.covariance[2, 2] == pytest.approx((24 - start) * SIGMA[2] ** 2)
    assert expected.way_m == pytest.approx(24 - start)


def test_a_node_made_later_is_reached_by_its_edge():
    graph = chain(5)
    outlook = GraphUncertainty(graph, 0, EXACT)
    outlook.advance(100)
    graph.join(5, 6, STEP)
    assert outlook.between(0, 6) is None
    outlook.extend(6)
    assert np.allclose(outlook.between(5, 6).T_from_node, STEP)


def test_only_nodes_that_may_be_here_are_near():
    graph = Graph()
    for k in range(60):
        graph.join(k, k + 1, np.array([1.0, 0.0, 0.0 if k != 30 else np.pi]))
    outlook = GraphUncertainty(graph, 60, GateConfig(shift_var_m2_per_m=1e-4, turn_var_rad2_per_m=1e-6))
    outlook.advance(100)
    x, y, _ = outlook.pose(60)
    near, _, _ = outlook.near(60, x, y, 3.0, 12.0)
    assert 1 in near
    assert 58 not in near  # too near over edges
    assert 20 not in near  # surely elsewhere


def test_slices_reach_what_one_go_reaches():
    graph = chain(50)
    whole, sliced = GraphUncertainty(graph, 25, EXACT), GraphUncertainty(graph, 25, EXACT)
    whole.advance(1000)
    while not sliced.advance(3):
        pass
    for node_id in range(51):
        assert np.allclose(between(whole.pose(node_id), sliced.pose(node_id)), 0.0)
