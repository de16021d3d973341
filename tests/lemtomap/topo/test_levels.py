"""A robot that takes a lift maps the floor above in a window of its own, and takes it for no other."""

import numpy as np
import pytest

from lemtomap.se2 import (
    between,
    compose,
    inverse,
    pose,
)
from lemtomap.topo.config import TopoConfig
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.loops.config import LoopConfig
from lemtomap.topo.loops.places import PlaceBook
from lemtomap.topo.loops.recogniser import LoopRecogniser
from lemtomap.topo.mapper import TopoMapper
from lemtomap.types import EdgeType
from tests.lemtomap.topo.drive import lead, room, said

HALL = room(walls=[(-6, 2, 6, 2.2), (-6, -3, 6, -2.8), (5, -3, 5.2, 2)])


@pytest.fixture
def mapper(tmp_path):
    mapper = TopoMapper(TopoConfig(), TopoStore.create(tmp_path / "map.lemto"), recogniser=LoopRecogniser())
    yield mapper
    mapper.close()


def take_lift(mapper, stamp_s, level, T_grid_base=None):
    """Stand still in the lift; the new window's frame begins at the robot, odometry goes on."""
    slam = mapper.now[0]
    T_odom_base = between(slam.T_grid_odom, slam.T_grid_base)
    mapper.change_level(level)
    at = np.zeros(3) if T_grid_base is None else T_grid_base
    mapper.update(said(stamp_s, at, T_grid_odom=compose(at, inverse(T_odom_base))), HALL)


def test_an_odometry_edge_is_the_lift_and_nothing_else_joins_the_levels(mapper):
    stamp = lead(mapper, [(-2, 0), (2.3, 0)], HALL)
    below, T_below_base = mapper.associated_id, mapper.T_node_base
    take_lift(mapper, stamp, 1)
    above = mapper.associated_id
    lead(mapper, [(0, 0), (2, 0), (2, 1), (-2, 1), (-2, 0), (0, 0)], HALL, start_s=stamp + 0.2)
    levels = {node.node_id: node.level for node in mapper.store.nodes()}
    assert set(levels.values()) == {0, 1}
    across = [e for e in mapper.store.edges() if levels[e.source_id] != levels[e.target_id]]
    assert [(e.source_id, e.target_id, e.type) for e in across] == [(below, above, EdgeType.ODOMETRY)]
    np.testing.assert_allclose(across[0].T_source_target, T_below_base, atol=1e-6)
    assert not mapper.lost


def test_saying_the_same_level_again_changes_nothing(mapper):
    lead(mapper, [(-2, 0), (2.3, 0)], HALL)
    before = mapper.associated_id
    mapper.change_level(0)
    assert mapper.associated_id == before
    assert mapper.now is not None


def test_the_same_room_a_floor_higher_is_no_place_known_before(mapper, monkeypatch):
    """The floor above looks just like the one below and the graph says that it is there."""
    stamp = lead(mapper, [(-4, 0), (4, 0), (-4, 0.3)], HALL)
    searched = []
    monkeypatch.setattr(
        "lemtomap.topo.loops.closer.ranked",
        lambda outlook, *_: ([n for n in range(1, 60) if n in outlook], []),
    )
    monkeypatch.setattr(
        "lemtomap.topo.loops.closer.spaced", lambda *args: searched.extend(args[2]) or list(args[2][:1])
    )
    take_lift(mapper, stamp, 1, pose(-4, 0.3, 0.0))
    lead(mapper, [(-4, 0.3), (4, 0.3)], HALL, start_s=stamp + 0.2)
    levels = {node.node_id: node.level for node in mapper.store.nodes()}
    assert searched
    assert {levels[n] for n in searched} == {1}


def test_a_place_beside_the_lift_holds_no_walls_of_the_floor_above(mapper):
    stamp = lead(mapper, [(-2, 0), (2.3, 0)], HALL)
    below = mapper.associated_id
    take_lift(mapper, stamp, 1)
    lead(mapper, [(0, 0), (3, 0)], room(walls=[(-1, -1.2, 4, -1)]), start_s=stamp + 0.2)
    mapper.lose()  # takes the data of all nodes
    config = LoopConfig()
    alone = PlaceBook(mapper.graph, config.company_m, config.search_points)
    joined = alone.company(below).points_node
    at = compose(mapper.graph.edges_of(below)[-1].T_source_target, [2.0, -1.1, 0.0])[:2]
    assert np.hypot(*(joined - at).T).min() > 0.5


def test_a_lost_robot_learns_its_level_when_it_is_found(mapper):
    lead(mapper, [(-2, 0), (2.3, 0)], HALL)
    mapper.adopt_level(3)
    assert {node.level for node in mapper.store.nodes(mapper.part_id)} == {3}
    assert mapper.level == 3
