import numpy as np
import pytest

from lemtomap.se2 import between, compose, pose
from lemtomap.topo.config import TopoConfig
from lemtomap.topo.file.paging import PagedGraph
from lemtomap.topo.file.reader import TopoReader
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.graph import Edge
from lemtomap.topo.local import LocalMap, NodePoseEstimate
from lemtomap.topo.localisation import NotStarted
from lemtomap.topo.mapper import TopoMapper
from lemtomap.types import EdgeType
from tests.lemtomap.topo.drive import lead, relative, room


@pytest.fixture
def mapper(tmp_path):
    mapper = TopoMapper(TopoConfig(), TopoStore.create(tmp_path / "map.lemto"))
    yield mapper
    mapper.close()


def edges(mapper, kind):
    return [edge for edge in mapper.store.edges() if edge.type is kind]


def test_before_the_first_scan_there_is_no_view(mapper):
    with pytest.raises(NotStarted):
        mapper.view()


def test_a_straight_drive_makes_a_chain_of_nodes_a_metre_apart(mapper):
    lead(mapper, [(-4, 0), (4, 0)], room())
    chain = edges(mapper, EdgeType.ODOMETRY)
    assert [(edge.source_id, edge.target_id) for edge in chain] == [(k, k + 1) for k in range(1, 8)]
    assert all(1.0 < edge.length_m <= 1.15 for edge in chain)
    assert not edges(mapper, EdgeType.NEAR_NEIGHBOUR)  # a straight shortcut of a straight chain tells nothing


def test_an_odometry_edge_holds_the_uncertainty_of_all_steps_between_its_ends(mapper):
    lead(mapper, [(0, 0), (2.5, 0)], room())
    edge = edges(mapper, EdgeType.ODOMETRY)[0]
    assert 10e-5 < edge.covariance[0, 0] < 13e-5  # 11 steps of 1e-5 and the floor
    assert edge.covariance[1, 1] > edge.covariance[0, 0]  # heading errors add sideways


def test_driving_back_associates_with_old_nodes_and_makes_none(mapper):
    stamp = lead(mapper, [(-4, 0), (4, 0)], room())
    nodes = mapper.store.count("node")
    lead(mapper, [(4, 0), (-4, 0)], room(), start_s=stamp)
    assert mapper.store.count("node") == nodes
    assert mapper.associated_id == 1


def test_a_small_loop_closes_by_a_near_neighbour_edge(mapper):
    lead(mapper, [(-2, -2), (2, -2), (2, 2), (-2, 2), (-2, -1.0)], room())
    near = edges(mapper, EdgeType.NEAR_NEIGHBOUR)
    assert any(min(edge.source_id, edge.target_id) <= 2 and edge.source_id >= 12 for edge in near)
    for edge in near:
        assert edge.length_m <= TopoConfig().near_neighbour_max_m


def test_no_near_neighbour_edge_goes_through_a_wall_or_the_unknown(mapper):
    wall = room(walls=[(-3, -0.1, 3, 0.1)])
    lead(mapper, [(-2, -1), (4.5, -1), (4.5, 1), (-2, 1)], wall)
    poses = mapper.view().T_grid_node
    for edge in edges(mapper, EdgeType.NEAR_NEIGHBOUR):
        a, b = poses[edge.source_id], poses[edge.target_id]
        if a[1] * b[1] < 0:
            crossing_x = a[0] + (b[0] - a[0]) * a[1] / (a[1] - b[1])
            assert crossing_x > 3.0 + TopoConfig().robot_radius_m - 0.05
    assert edges(mapper, EdgeType.NEAR_NEIGHBOUR)


def test_two_chains_side_by_side_are_joined_when_one_is_driven_again(mapper):
    wall = room(walls=[(-7, -0.06, 7, 0.06)])
    stamp = lead(mapper, [(-6, -0.4), (7.5, -0.4), (7.5, 0.4), (-6, 0.4)], wall)
    crossing = [edge for edge in edges(mapper, EdgeType.NEAR_NEIGHBOUR) if crosses(mapper, edge, below_x=2.0)]
    assert not crossing  # behind the wall, as where the two chains' places are not known to each other yet
    lead(mapper, [(-6, 0.4), (4, 0.4)], room(), start_s=stamp)
    joins = [edge for edge in edges(mapper, EdgeType.NEAR_NEIGHBOUR) if crosses(mapper, edge, below_x=2.0)]
    assert 1 <= len(joins) <= 4  # one for each stretch, not one for each node
    assert all(edge.share == 0.0 for edge in joins)  # the solve learns nothing from them


def crosses(mapper, edge, below_x):
    poses = mapper.view().T_grid_node
    ends = [poses.get(edge.source_id), poses.get(edge.target_id)]
    if any(end is None for end in ends):
        return False
    return ends[0][1] * ends[1][1] < 0.0 and max(ends[0][0], ends[1][0]) < below_x


def test_only_a_neighbour_or_a_new_node_follows_as_associated_node(mapper):
    wall = room(walls=[(-3, -0.06, 3, 0.06)])
    lead(mapper, [(-2, -0.4), (4.5, -0.4), (4.5, 0.4), (-2, 0.4)], wall)
    assert mapper.associated_id == max(mapper.view().T_grid_node)  # not the nearer one beyond the wall


def test_turning_and_shifting_the_grid_frame_changes_nothing(tmp_path):
    loop = [(-2, -2), (2, -2), (2, 2), (-2, 2), (-2, -1.0), (1, -1.5)]
    views, maps = [], []
    for k, shift in enumerate([pose(0, 0, 0), pose(10.0, -20.0, np.pi / 2), pose(-7.5, 2.5, np.pi)]):
        mapper = TopoMapper(TopoConfig(), TopoStore.create(tmp_path / f"{k}.lemto"))
        x, y, _ = shift
        lead(mapper, loop, room(origin_m=(x - 10, y - 10)), shift=shift, step_m=0.0973)
        views.append(relative(mapper.view().T_grid_node, mapper.associated_id))
        maps.append([(e.source_id, e.target_id, e.type, *e.T_source_target) for e in mapper.store.edges()])
        mapper.close()
    for view, rows in zip(views[1:], maps[1:], strict=True):
        assert [row[:3] for row in rows] == [row[:3] for row in maps[0]]
        np.testing.assert_allclose([r[3:] for r in rows], [r[3:] for r in maps[0]], atol=1e-9)
        for node_id, T in view.items():
            np.testing.assert_allclose(T, views[0][node_id], atol=1e-9)


def test_the_trail_says_where_each_scan_was_taken(mapper):
    lead(mapper, [(-2, 0), (2, 0)], room())
    records = np.concatenate(list(mapper.trail.records()))
    assert len(records) == 40
    poses = mapper.view().T_grid_node
    for k, record in enumerate(records):
        at = compose(poses[int(record["node_id"])], record["T_node_base"])
        np.testing.assert_allclose(at, [-2 + 0.1 * k, 0, 0], atol=1e-9)


def test_navigation_reads_the_route_graph_while_it_grows(mapper):
    stamp = lead(mapper, [(-2, 0), (0, 0)], room())
    mapper.store.commit()
    with TopoReader(mapper.store.path) as reader:
        version = reader.version
        assert [edge.other_id for edge in reader.edges_of(1)] == [2]
        lead(mapper, [(0, 0), (0, 4)], room(), start_s=stamp)
        assert reader.version != version
        assert reader.has_node(3)


def test_poses_in_the_view_agree_with_the_edges(mapper):
    lead(mapper, [(-2, -2), (2, -2), (2, 2), (-2, 2), (-2, -1.0)], room())
    view = mapper.view()
    for edge in mapper.store.edges():
        seen = between(view.T_grid_node[edge.source_id], view.T_grid_node[edge.target_id])
        np.testing.assert_allclose(seen, edge.T_source_target, atol=1e-9)


def test_the_nearest_node_that_is_surely_predicted_is_looked_for_in_the_window(tmp_path):
    with TopoStore.create(tmp_path / "map.lemto") as store:
        local = LocalMap(PagedGraph(store), TopoConfig())
        for node_id, (x_m, sigma_m, anchored) in enumerate(
            [(0.5, 0.01, True), (1.0, 0.5, False), (2.0, 0.1, False), (2.5, 0.01, False)], start=1
        ):
            covariance = np.eye(3) * sigma_m**2
            local._put(
                node_id,
                NodePoseEstimate(np.array([x_m, 0.0, 0.0]), covariance, anchored=anchored),
            )
        assert local.predicted_near(np.zeros(3), 3.0, 0.2) == 3
        assert local.predicted_near(np.zeros(3), 1.9, 0.2) == 0


def test_a_refused_place_is_doubted_no_further_than_a_match_may_look():
    """What follows along the edges swung about by 16 degrees after a hall in which no place was matched."""
    config = TopoConfig()
    local = LocalMap(None, config)
    local._put(1, NodePoseEstimate(pose(0, 0, 0), np.diag([1e-4, 1e-4, 1e-4]), anchored=False))
    for _ in range(40):
        local.doubt(1)
    sigmas = np.sqrt(np.diag(local.standings[1].covariance))
    assert np.all(sigmas[:2] > config.align_widest_m)
    assert np.all(sigmas < 2.0 * np.array([config.align_widest_m] * 2 + [config.align_widest_rad]))


def test_what_is_sure_in_the_window_follows_every_change_of_a_standing(tmp_path):
    with TopoStore.create(tmp_path / "map.lemto") as store:
        local = LocalMap(PagedGraph(store), TopoConfig())
        tight = np.eye(3) * 1e-4
        local.anchor(1, np.zeros(3), tight, born=True)
        local.anchor(2, np.ones(3), tight)
        assert local.sure() == {1}
        local.anchor_found(2, np.ones(3), tight)
        assert local.sure() == {1, 2}
        local.release_matched()
        assert local.sure() == {1}
        local.forget_all()
        assert local.sure() == set()


def test_nodes_out_of_the_window_stand_where_all_edges_together_have_them(tmp_path):
    """Two ways to the third node, 0.4 m apart: it stands between, not where the first one ends."""
    with TopoStore.create(tmp_path / "map.lemto") as store:
        nodes = [store.add_node().node_id for _ in range(3)]
        for a, b, length_m in ((0, 1, 1.0), (1, 2, 1.0), (0, 2, 2.4)):
            store.add_edge(
                Edge(0, nodes[a], nodes[b], pose(length_m, 0, 0), 1e-2 * np.eye(3), EdgeType.ODOMETRY)
            )
        local = LocalMap(PagedGraph(store), TopoConfig())
        local.anchor(nodes[0], pose(5.0, 1.0, 0.0), 1e-4 * np.eye(3), born=True)
        local.settle(nodes[0])
        x = [local.standings[node_id].T_grid_node[0] for node_id in nodes]
        assert x[0] == 5.0
        assert x[1] == pytest.approx(5.0 + 1.0 + 0.4 / 3, abs=0.02)
        assert x[2] == pytest.approx(5.0 + 2.0 + 0.8 / 3, abs=0.02)
