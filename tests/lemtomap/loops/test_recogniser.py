"""What the mapper makes of what a recogniser decides."""

from dataclasses import replace

import numpy as np
import pytest

from lemtomap.se2 import between, compose, pose
from lemtomap.topo.config import TopoConfig
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.loops import LoopRecogniser
from lemtomap.topo.loops.index import PlaceIndex
from lemtomap.topo.mapper import TopoMapper
from lemtomap.topo.recognition import (
    Closed,
    Closure,
    Confirmed,
    Found,
    Located,
    News,
    NotFound,
    Revoked,
)
from lemtomap.types import EdgeType
from tests.lemtomap.topo.drive import lead, room, said

SURE = np.diag([1e-4, 1e-4, 1e-5])
GRID = room(40.0, origin_m=(-20, -20))


class Oracle:
    """A recogniser that decides what it is told to, once, and keeps what it hears."""

    def __init__(self):
        self.says, self.heard, self.became = [], [], []

    def attach(self, graph):
        self.graph = graph

    def describe(self, points_node):
        return points_node[:0].tobytes()

    def place_taken(self, node_id, place):
        pass

    def update(self, situation):
        self.heard.append(situation)
        says, self.says = self.says, []
        return says

    def committed(self, decision, edges):
        self.became.append((decision, edges))


@pytest.fixture
def oracle():
    return Oracle()


@pytest.fixture
def back(tmp_path, oracle):
    """A robot that came back along its way to beside its start, which the graph does not know."""
    store = TopoStore.create(tmp_path / "m.lemto", durable=False)
    mapper = TopoMapper(TopoConfig(local_radius_m=20.0), store, recogniser=oracle)
    mapper.stamp_s = lead(mapper, [(-9, -9), (9, -9), (9, 9), (-9, 9), (-9, 4.8)], GRID)
    yield mapper
    mapper.close()


def stand(mapper):
    """One more scan from where the robot is."""
    mapper.stamp_s += 0.2
    mapper.update(said(mapper.stamp_s, mapper.now[0].T_grid_base), GRID)


def unsure(mapper):
    """Make the robot's own node one that the window does not hold for sure."""
    here = mapper.local.standings[mapper.associated_id]
    mapper.local.standings[mapper.associated_id] = replace(here, born=False)


def found(mapper, node_id, T_base_node):
    return Found(node_id, compose(mapper.now[0].T_grid_base, T_base_node), SURE)


def closed(mapper, node_id, T_base_node, *, informs=True):
    place, here = found(mapper, node_id, T_base_node), mapper.local.standings[mapper.associated_id]
    T_here_node = between(here.T_grid_node, place.T_grid_node)
    return Closed((Closure(mapper.associated_id, T_here_node, SURE, place, informs, 1.0),))


@pytest.mark.parametrize(("gap_m", "stands_there"), [(0.4, True), (4.0, False)])
def test_an_unsure_robot_stands_at_a_place_found_again_only_when_it_is_there(
    back, oracle, gap_m, stands_there
):
    """Else the next odometry edge would begin far off, across walls that nobody has driven through."""
    here = back.associated_id
    unsure(back)
    oracle.says = [closed(back, 20, pose(gap_m, 0.0, 0.0))]
    stand(back)
    assert back.associated_id == (20 if stands_there else here)
    lead(back, [(-9, 4.7), (-9, 1.0)], GRID, start_s=back.stamp_s)
    driven = [edge.length_m for edge in back.store.edges() if edge.type is EdgeType.ODOMETRY]
    assert max(driven) < 1.5


def test_a_robot_sure_of_its_node_stays_at_it_when_a_loop_is_closed(back, oracle):
    here = back.associated_id
    oracle.says = [closed(back, 20, pose(0.1, 0.0, 0.0))]
    stand(back)
    assert back.associated_id == here
    assert back.local.standings[20].sure


def test_a_closure_becomes_an_edge_that_the_recogniser_hears_of(back, oracle):
    decision = closed(back, 20, pose(1.0, 0.0, 0.0))
    oracle.says = [decision]
    stand(back)
    ((of, (edge,)),) = oracle.became
    assert of is decision
    assert back.store.edge(edge.edge_id) is not None
    assert (edge.source_id, edge.target_id, edge.type) == (back.associated_id, 20, EdgeType.LOOP_CLOSING)


def test_a_closure_that_tells_nothing_new_only_says_where_its_node_stands(back, oracle):
    edges = back.store.count("edge")
    oracle.says = [closed(back, 20, pose(1.0, 0.0, 0.0), informs=False)]
    stand(back)
    assert back.store.count("edge") == edges
    assert oracle.became[0][1] == []
    assert back.local.standings[20].sure


def test_a_closure_proved_wrong_is_taken_back(back, oracle):
    oracle.says = [closed(back, 20, pose(1.0, 0.0, 0.0))]
    stand(back)
    (_, (edge,)) = oracle.became[0]
    oracle.says = [Revoked((edge.edge_id,))]
    stand(back)
    assert back.store.edge(edge.edge_id) is None


def test_where_a_node_was_found_is_where_it_stands_unless_it_was_made_there(back, oracle):
    here, at = back.associated_id, back.local.standings[back.associated_id].T_grid_node
    oracle.says = [Confirmed(found(back, here, pose(0.3, 0.0, 0.0)))]
    stand(back)
    np.testing.assert_array_equal(back.local.standings[here].T_grid_node, at)
    unsure(back)
    place = found(back, here, pose(0.3, 0.0, 0.0))
    oracle.says = [Confirmed(place)]
    stand(back)
    np.testing.assert_array_equal(back.local.standings[here].T_grid_node, place.T_grid_node)
    stand(back)
    assert here in oracle.heard[-1].measured


def lost(back, level=0):
    """Put the robot down elsewhere in the map it knows."""
    back.lose()
    back.level = level
    back.update(said(back.stamp_s + 9.0, pose(0.0, 0.0, 0.0)), GRID)
    back.stamp_s += 9.0


def test_a_lost_robot_that_is_located_is_joined_to_its_place_and_stands_there(back, oracle):
    lost(back, level=2)
    assert back.lost
    assert oracle.heard[-1].news is News.LOST
    part_id = oracle.heard[-1].part_id
    oracle.says = [Located(found(back, 5, pose(0.2, 0.0, 0.0)))]
    stand(back)
    assert not back.lost
    assert back.known_place
    assert back.associated_id == 5
    assert back.graph.node(part_id).level == back.level == 0
    assert back.graph.edge_between(part_id, 5).type is EdgeType.LOOP_CLOSING
    assert oracle.became[-1][1] == [back.graph.edge_between(part_id, 5)]


def test_a_lost_robot_that_is_found_nowhere_maps_on(back, oracle):
    lost(back)
    oracle.says = [NotFound()]
    stand(back)
    assert not back.lost
    assert not back.known_place


def test_a_situation_tells_how_far_the_robot_went_since_it_was_sure_of_its_node(back, oracle):
    assert oracle.heard[-1].unsure_m < 1.2
    assert back.associated_id in oracle.heard[-1].measured
    nodes = [each for each in oracle.heard if each.news is News.NODE]
    assert [each.here_id for each in nodes] == list(range(2, back.associated_id + 1))


def test_the_index_is_filled_a_slice_at_a_time_until_it_has_caught_up(tmp_path, monkeypatch):
    calls = []
    monkeypatch.setattr(PlaceIndex, "catch_up", lambda _: calls.append(1) or len(calls) >= 3)
    store = TopoStore.create(tmp_path / "m.lemto", durable=False)
    mapper = TopoMapper(TopoConfig(), store, recogniser=LoopRecogniser())
    for k in range(8):
        mapper.update(said(0.2 * k, pose(0.0, 0.0, 0.0)), GRID)
    assert len(calls) == 3
    mapper.close()
