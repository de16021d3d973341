import numpy as np
import pytest

from lemtomap.se2 import between, compose, pose
from lemtomap.topo.config import TopoConfig
from lemtomap.topo.events import (
    Bumped,
    EdgeBlocked,
    EdgeTraversed,
    GroundSeen,
    OpeningDone,
    OpeningSeen,
)
from lemtomap.topo.file.reader import TopoReader
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.graph import OpeningState, Place
from lemtomap.topo.local import LocalMap
from lemtomap.topo.mapper import TopoMapper
from lemtomap.topo.place import decode_place
from lemtomap.types import EdgeType
from tests.lemtomap.topo.drive import (
    lead,
    relative,
    room,
    said,
)

SURE = np.diag([1e-4, 1e-4, 1e-5])
CORRIDORS = [(-9, -9), (9, -9), (9, 9), (-9, 9), (-9, -8.2)]


@pytest.fixture
def loop(tmp_path):
    """A round of 72 m whose grid frame drifted, its end beside its start but further than D_nn over edges."""
    config = TopoConfig(local_radius_m=20.0)
    mapper = TopoMapper(config, TopoStore.create(tmp_path / "map.lemto"))
    lead(mapper, CORRIDORS, room(40.0, origin_m=(-20, -20)))
    yield mapper
    mapper.close()


def test_a_round_longer_than_d_nn_stays_open_until_a_closure_joins_it(loop):
    last = loop.associated_id
    assert 1 not in loop.view().T_grid_node
    truth = between(loop.local.standings[last].T_grid_node, pose(-9, -9, 0))
    edge = loop.close_loop(last, 1, truth, SURE)
    assert edge.type is EdgeType.LOOP_CLOSING
    view = loop.view()
    np.testing.assert_allclose(view.T_grid_node[1], [-9, -9, 0], atol=1e-9)
    assert {1, 2, 3} <= set(view.T_grid_node)
    loop.store.commit()
    with TopoReader(loop.store.path) as reader:
        assert 1 in {each.other_id for each in reader.edges_of(last)}


@pytest.mark.parametrize(("walls", "proven"), [((), True), ([(-9.5, -8.7, -8.5, -8.6)], False)])
def test_a_closure_is_a_way_at_once_where_the_window_shows_its_line_free(loop, walls, proven):
    last = loop.associated_id
    loop.update(said(1e4, loop.local.standings[last].T_grid_node), room(40.0, walls=walls))
    edge = loop.close_loop(last, 1, between(loop.local.standings[last].T_grid_node, pose(-9, -9, 0)), SURE)
    assert (edge.time_s is not None) is proven
    loop.store.commit()
    with TopoReader(loop.store.path) as reader:
        assert next(each.proven for each in reader.edges_of(last) if each.edge_id == edge.edge_id) is proven


def test_from_whatever_frame_the_map_is_seen_its_nodes_lie_the_same_way(loop):
    """Also where edges contradict one another, so that the local solve has work to do."""
    last = loop.associated_id
    truth = between(loop.local.standings[last].T_grid_node, pose(-9, -9, 0))
    loop.close_loop(last, 1, compose(truth, pose(0.2, -0.1, 0.05)), SURE)
    loop.close_loop(last - 5, 6, compose(truth, pose(5.0, 0.0, 0.0)), SURE)
    rng, seen = np.random.default_rng(4), []
    for _ in range(10):
        local = LocalMap(loop.graph, loop.config)
        local.anchor(last, rng.uniform([-1000, -1000, -np.pi], [1000, 1000, np.pi]), SURE)
        local.settle(last)
        seen.append(relative({i: s.T_grid_node for i, s in local.standings.items()}, last))
    solved = between(seen[0][1], seen[0][6])
    assert np.abs(solved - between(*(loop.local.standings[i].T_grid_node for i in (1, 6)))).max() > 1e-3
    for poses in seen[1:]:
        assert list(poses) == list(seen[0])
        for node_id, T in poses.items():
            np.testing.assert_allclose(between(T, seen[0][node_id]), 0.0, atol=1e-9)


def test_a_revoked_closure_leaves_nothing_behind(loop):
    last, before = loop.associated_id, loop.view().T_grid_node
    wrong = loop.close_loop(last, 30, pose(0.5, 0.5, 1.0), SURE)
    loop.revoke(wrong.edge_id)
    loop.revoke(wrong.edge_id)  # once more does no harm
    assert loop.store.edge(wrong.edge_id) is None
    after = loop.view().T_grid_node
    assert set(after) == set(before)
    for node_id, T in before.items():
        np.testing.assert_allclose(after[node_id], T, atol=1e-6)


def test_carried_elsewhere_a_new_part_begins_and_a_closure_joins_it(loop):
    nodes = loop.store.count("node")
    loop.lose()
    first = nodes + 1
    stamp = lead(loop, [(-9, -8.2), (-5, -8.2)], room(40.0, origin_m=(-20, -20)), start_s=1000.0)
    assert min(loop.view().T_grid_node) == loop.part_id == first
    last = loop.associated_id
    loop.close_loop(last, 5, between(loop.local.standings[last].T_grid_node, pose(-4.6, -9, 0)), SURE)
    assert {1, 5, first, last} <= set(loop.view().T_grid_node)
    lead(loop, [(-5, -8.2), (-4.6, -8.8)], room(40.0, origin_m=(-20, -20)), start_s=stamp)
    assert loop.associated_id == 5


def test_a_known_place_recognised_becomes_the_associated_node(loop):
    at = loop.now[0].T_grid_base
    loop.relocate(7, compose(at, [0.2, 0.0, 0.0]), SURE)
    assert loop.associated_id == 7
    np.testing.assert_allclose(loop.T_node_base, [-0.2, 0, 0], atol=1e-9)


def test_a_known_map_is_gone_on_with_in_a_part_of_its_own(tmp_path):
    path = tmp_path / "map.lemto"
    mapper = TopoMapper(TopoConfig(), TopoStore.create(path))
    lead(mapper, [(-2, 0), (2.3, 0)], room())
    here = mapper.associated_id
    mapper.close()
    elsewhere = TopoMapper(TopoConfig(), TopoStore.open(path))
    elsewhere.update(said(0.0, pose(5, 5, 1.0)), room())
    assert elsewhere.associated_id == elsewhere.store.count("node") > here
    elsewhere.close()


def test_one_glance_at_a_changed_place_renews_nothing_but_visits_in_a_row_do(tmp_path):
    mapper = TopoMapper(TopoConfig(), TopoStore.create(tmp_path / "map.lemto"))
    before = room(walls=[(-6, 1, 6, 1.2), (-6, -1.2, 6, -1)])
    after = room(walls=[(-6, 1, 6, 1.2), (-6, -1.2, 6, -1), (-5.3, 0.5, -4.9, 0.7)])
    there_and_back = [(2, 0), (-5, 0), (2, 0)]
    stamp = lead(mapper, [(-5, 0), (2, 0)], before)
    taken = mapper.store.place(1)
    for grid in (before, after, before, after):
        stamp = lead(mapper, there_and_back, grid, start_s=stamp)
        assert mapper.store.place(1) == taken
    lead(mapper, there_and_back, after, start_s=stamp)
    renewed = mapper.store.place(1)
    assert isinstance(renewed, Place)
    assert renewed.taken_s > taken.taken_s
    points = decode_place(renewed.boundary).points
    assert (np.hypot(*(points - [0.0, 0.5]).T) < 0.2).any()
    mapper.close()


def test_a_side_never_seen_before_is_taken_up_at_once(tmp_path):
    """Behind the robot where the map began; it comes back facing that way."""
    mapper = TopoMapper(TopoConfig(), TopoStore.create(tmp_path / "map.lemto"))
    half = room(walls=[(-5, 1, 6, 1.2), (-5, -1.2, 6, -1)])
    whole = room(walls=[(-9, 1, 6, 1.2), (-9, -1.2, 6, -1)])
    stamp = lead(mapper, [(-5, 0), (2, 0)], half)
    lead(mapper, [(2, 0), (-5, 0)], whole, start_s=stamp)
    mapper.close()
    kept = TopoStore.open(tmp_path / "map.lemto")
    points = decode_place(kept.place(1).boundary).points
    assert (points[:, 0] < -2.0).any()
    kept.close()


def test_what_was_taken_away_makes_a_place_stale_as_well(tmp_path):
    mapper = TopoMapper(TopoConfig(), TopoStore.create(tmp_path / "map.lemto"))
    full, cleared = (
        room(walls=[(-8, 1.5, 8, 1.7), *chest]) for chest in ([(-5.3, 0.5, -4.9, 0.7)], list[tuple]())
    )
    stamp = lead(mapper, [(-5, 0), (2, 0)], full)
    taken = mapper.store.place(1)
    for _ in range(2):
        stamp = lead(mapper, [(2, 0), (-5, 0), (2, 0)], cleared, start_s=stamp)
    assert mapper.store.place(1) != taken
    mapper.close()


def test_navigation_teaches_times_blocks_bumps_and_openings(loop):
    store = loop.store
    edge = loop.graph.edge_between(1, 2)
    loop.apply(EdgeTraversed(1, 2, 5.0))
    assert store.edge(edge.edge_id).time_s == 5.0
    loop.apply(EdgeTraversed(2, 1, 3.0))
    assert 3.0 < store.edge(edge.edge_id).time_s < 5.0
    loop.apply(EdgeBlocked(2, 1, 77.0))
    assert store.edge(edge.edge_id).blocked_until_s == 77.0
    loop.apply(EdgeBlocked(1, 40, 77.0))  # no such edge: nothing to learn
    here = loop.associated_id
    loop.apply(Bumped("bump", 0.2, 0.0, 9.0))
    store.commit()
    with TopoReader(store.path) as reader:
        (mark,) = reader.marks()
    assert mark.node_id == here
    at = compose(loop.T_node_base, [0.2, 0.0, 0.0])
    assert (mark.x_m, mark.y_m) == pytest.approx((at[0], at[1]))
    loop.apply(GroundSeen(here, b"old"))
    loop.apply(GroundSeen(here, b"picture"))
    loop.apply(GroundSeen(4000, b"picture"))  # no such node
    assert list(store.query("SELECT node, picture FROM ground")) == [(here, b"picture")]
    loop.apply(OpeningSeen(1, here, 2.0, 0.0, 0.1, 0.9))
    loop.apply(OpeningDone(1, closed=True))
    assert [(o.node_id, o.state) for o in store.placeholders()] == [(here, OpeningState.CLOSED)]
