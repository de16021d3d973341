import numpy as np
import pytest

from lemtomap.se2 import between, compose
from lemtomap.topo.graph import Edge
from lemtomap.topo.whole.layout import lay_out_edges
from lemtomap.types import EdgeType

STEP = np.array([1.0, 0.0, 2.0 * np.pi / 200])
DRIFT = np.array([0.0, 0.0, 0.006])  # 200 m on, the way round is some 100 m off


def edge(number, a, b, T_a_b, kind):
    return Edge(number, a, b, T_a_b, np.diag([0.02, 0.02, 0.01]) ** 2, kind)


def truth():
    poses = [np.zeros(3)]
    for _ in range(219):
        poses.append(compose(poses[-1], STEP))
    return poses


def a_drifted_round():
    """Return the edges of a round of 200 m whose last 20 m lie on the first, seen again at three places."""
    edges = [edge(k, k, k + 1, compose(STEP, DRIFT), EdgeType.ODOMETRY) for k in range(219)]
    return edges + [edge(300 + k, 200 + k, k, np.zeros(3), EdgeType.LOOP_CLOSING) for k in (0, 8, 16)]


def worst_m(layout):
    """Return the largest error of a relation between nodes ten apart."""
    T, true = layout.T_map_node, truth()
    errors = [between(between(true[k], true[k + 10]), between(T[k], T[k + 10])) for k in range(0, 210, 5)]
    return max(float(np.hypot(*e[:2])) for e in errors)


def test_true_closures_are_believed_however_far_the_way_has_drifted():
    layout = lay_out_edges(range(220), a_drifted_round())
    gap = between(layout.T_map_node[0], layout.T_map_node[200])
    assert np.hypot(*gap[:2]) < 0.1
    assert worst_m(layout) < 0.6  # the drift itself stays in the edges


def test_a_closure_that_nothing_agrees_with_is_doubted():
    straight = [edge(k, k, k + 1, np.array([1.0, 0.0, 0.0]), EdgeType.ODOMETRY) for k in range(40)]
    lie = edge(99, 35, 5, np.array([3.0, 4.0, 1.0]), EdgeType.LOOP_CLOSING)
    T = lay_out_edges(range(41), [*straight, lie]).T_map_node
    assert T[40][:2] == pytest.approx([40.0, 0.0], abs=1.0)
