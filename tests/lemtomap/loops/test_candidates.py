"""Where a place known before is looked for, after a short way round and after a long one."""

from collections import defaultdict

import numpy as np
import pytest

from lemtomap.se2 import compose
from lemtomap.topo.graph import DirectedEdge, Edge
from lemtomap.topo.loops.candidates import search_box, spaced
from lemtomap.topo.loops.config import GateConfig
from lemtomap.topo.loops.outlook import GraphUncertainty
from lemtomap.topo.place.hits import HitMap
from lemtomap.topo.recognition import Situation
from lemtomap.types import EdgeType, GridView

GATE = GateConfig()
SIGMA = np.array([0.02, 0.02, 0.01])
ROBOT = np.array([1.0, -2.0, 0.7])
GRID = GridView(0.0, np.zeros((1, 1), np.int8), 0.05, (0.0, 0.0))


class Ring:
    """A corridor once round, of so many nodes 1 m apart: the last node is expected at the first."""

    def __init__(self, count):
        self.at = defaultdict(list)
        for k in range(count):
            step = np.array([1.0, 0.0, 2.0 * np.pi / count])
            edge = Edge(0, k, k + 1, step, np.diag(SIGMA**2), EdgeType.ODOMETRY)
            self.at[k].append(edge)
            self.at[k + 1].append(edge)

    def legs_of(self, node_id):
        return [DirectedEdge.along(edge, node_id) for edge in self.at[node_id]]


def arrived(count, drift=(0.0, 0.0, 0.0)):
    """The robot back at node 0 after the whole way round, its map off by a drift."""
    outlook = GraphUncertainty(Ring(count), count, GATE)
    outlook.advance(10 * count)
    T_grid_here = compose(ROBOT, np.array(drift))
    return outlook, Situation(
        here_id=count,
        T_grid_here=T_grid_here,
        covariance=np.eye(3) * 1e-4,
        T_grid_base=ROBOT,
        travelled_m=1.0 * count,
        turned_rad=0.0,
        grid=GRID,
        unsure_m=0.0,
        measured={count},
        hits=HitMap(),
        occupied_from=50,
    )


def is_inside(box, T_grid_place):
    off = np.abs(T_grid_place - box.T_grid_place)
    return bool(off[0] <= box.half_x_m and off[1] <= box.half_y_m and off[2] <= box.half_yaw_rad)


def test_after_a_short_way_a_place_is_searched_where_it_is_expected():
    outlook, situation = arrived(60)
    box = search_box(outlook, situation, 0, GATE)
    assert np.allclose(box.T_grid_place, ROBOT, atol=1e-6)
    assert GATE.least_box_m < max(box.half_x_m, box.half_y_m) < GATE.widest_m
    assert not box.is_cut


@pytest.mark.parametrize("drift", [(12.0, 3.0, 0.1), (-6.0, -14.0, -0.2), (0.0, 0.0, 0.0)])
def test_after_a_long_way_it_is_searched_around_the_robot_however_far_off_it_is_expected(drift):
    outlook, situation = arrived(400, drift)
    box = search_box(outlook, situation, 0, GATE)
    assert is_inside(box, ROBOT)
    assert is_inside(box, np.add(ROBOT, [1.5, -1.5, 0.1]))
    assert max(box.half_x_m, box.half_y_m) <= GATE.window_m
    assert box.is_cut


def test_a_place_far_off_its_expected_pose_surprises_though_the_box_has_moved():
    outlook, situation = arrived(400, (12.0, 3.0, 0.1))
    box = search_box(outlook, situation, 0, GATE)
    expected = compose(situation.T_grid_here, outlook.between(400, 0).T_from_node)
    assert box.surprise(expected) == pytest.approx(0.0)
    assert box.surprise(ROBOT) > 0.5


def test_what_the_graph_excludes_is_not_searched():
    outlook, situation = arrived(400, (80.0, 0.0, 0.0))
    assert search_box(outlook, situation, 0, GATE) is None


def test_places_so_doubtful_are_tried_in_turn():
    outlook, _ = arrived(400)
    nodes = list(range(40))
    first = spaced(outlook, 400, nodes, 3, GATE.reach_m, GATE)
    then = spaced(outlook, 400, nodes, 3, GATE.reach_m, GATE, first)
    assert len(first) == len(then) == 3
    assert min(then) >= max(first) + GATE.reach_m
