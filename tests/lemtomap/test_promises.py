"""What the whole promises, in worlds made up for it: the parts may all be right and the sum still wrong."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from lemtomap.grid import SlamConfig, WindowMatcher
from lemtomap.nav.navigator import Navigator
from lemtomap.nav.types import NavState
from lemtomap.pipeline import Mapper
from lemtomap.se2 import between, compose, inverse
from lemtomap.topo.config import TopoConfig
from lemtomap.topo.events import LevelChanged
from lemtomap.topo.file.paging import PagedGraph
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.graph import Edge
from lemtomap.topo.learning import learn
from lemtomap.topo.loops import LoopRecogniser
from lemtomap.topo.mapper import TopoMapper
from lemtomap.types import EdgeType
from tests.lemtomap.grid.rooms import corridor_round, drive, way_round
from tests.lemtomap.nav.test_navigator import two_rooms
from tests.lemtomap.nav.world import run

ROUND = 18.0, 12.0
LAPS = way_round(*ROUND)
WALLS = corridor_round(*ROUND)


class Building:
    """A building mapped from an empty map on, and where each node truly is."""

    def __init__(self, folder):
        self.store = TopoStore.create(folder / "map.lemto", durable=False)
        self.topo = TopoMapper(TopoConfig(), self.store, recogniser=LoopRecogniser())
        self.mapper = Mapper(lambda: WindowMatcher(SlamConfig()), self.topo)
        self.born = {}

    def map(self, path, walls=WALLS, **kinds):
        """Yield (true pose, what became of the scan) along poses."""
        for truth, odometry, scan in drive(path, walls, seed=2, odometry_noise=0.05, **kinds):
            mapped = self.mapper.update(scan, odometry)
            if mapped.used:
                for node_id, standing in self.topo.local.standings.items():
                    T_base_node = between(mapped.slam.T_grid_base, standing.T_grid_node)
                    self.born.setdefault(node_id, compose(truth, T_base_node))
            yield truth, mapped

    def closures(self):
        return [edge for edge in self.store.edges() if edge.type is EdgeType.LOOP_CLOSING]

    def off(self, edge):
        """How an edge differs from the truth."""
        true = between(self.born[edge.source_id], self.born[edge.target_id])
        return between(true, edge.T_source_target)


@pytest.fixture(scope="module")
def twice_round(tmp_path_factory):
    """One and a third rounds of a corridor that is longer than a window can hold."""
    building = Building(tmp_path_factory.mktemp("twice_round"))
    for _ in building.map(LAPS[: len(LAPS) * 2 // 3]):
        pass
    yield building
    building.mapper.close()


def test_a_round_driven_again_is_closed_and_every_closure_is_right(twice_round):
    off = np.array([twice_round.off(edge) for edge in twice_round.closures()])
    assert len(off) > 0
    assert np.hypot(off[:, 0], off[:, 1]).max() < 0.25
    assert np.abs(off[:, 2]).max() < 0.05


def test_the_second_time_round_the_robot_is_at_the_nodes_of_the_first(twice_round):
    first_lap = set(range(1, max(twice_round.born) // 2))
    assert twice_round.topo.associated_id in first_lap
    assert first_lap & set(twice_round.mapper.view().T_grid_node)


@pytest.fixture
def building(tmp_path):
    building = Building(tmp_path)
    yield building
    building.mapper.close()


@pytest.mark.parametrize(("away", "to"), [(260, 150), (330, 150), (400, 0)])
def test_a_robot_carried_to_where_it_looks_different_says_so_at_once_and_is_found_again(building, away, to):
    """Whoever uses the library alone has it too: no bumper, no wheel switch and no robot around it."""
    path = [*LAPS[:away], *LAPS[to : to + 100]]
    said, lost, known = {}, [], set()
    for k, (_, mapped) in enumerate(building.map(path, carried_at={away})):
        view = building.mapper.view()
        if k == away - 1:
            known = set(building.born)
        if mapped.displaced:
            said[k] = view.quality
        if view.lost:
            lost.append(k)
    assert said == {away: 0.0}
    assert lost == list(range(away + 1, away + 1 + len(lost)))
    assert 0 < len(lost) < 60
    off = [building.off(edge) for edge in building.closures() if edge.target_id in known]
    assert off
    assert np.hypot(*np.array(off).T[:2]).max() < 0.15
    assert len(building.topo.graph.reach(building.topo.associated_id, 1e9)) == building.store.count("node")


@pytest.mark.parametrize("watched", [True, False])
def test_wheels_that_leap_are_a_moved_robot_except_on_a_recorded_drive(tmp_path, watched):
    """Whoever carried the robot would have stopped the recording; a logger that lost messages did not."""
    mapper = Mapper.open(tmp_path / "leap.lemto", watched=watched)
    leap = np.zeros(3)
    displaced = []
    for k, (truth, odometry, scan) in enumerate(drive(LAPS[:80], WALLS, seed=2)):
        if k == 50:
            here = odometry.T_odom_base
            leap = compose(compose(here, [0.0, 0.0, 1.0]), inverse(here))
        told = replace(odometry, T_odom_base=compose(leap, odometry.T_odom_base))
        mapped = mapper.update(scan, told)
        displaced += [k] if mapped.displaced else []
        if k == 0:
            start = between(mapper.topo.now[0].T_grid_base, truth)
    assert displaced == ([50] if watched else [])
    if not watched:
        off = between(compose(mapper.topo.now[0].T_grid_base, start), truth)
        assert np.hypot(off[0], off[1]) < 0.1
    mapper.close()


def test_a_robot_lifted_for_a_moment_goes_on_and_one_lifted_for_long_is_lost(building):
    scans = list(drive(LAPS[:60], WALLS, seed=2))
    for _, odometry, scan in scans[:50]:
        building.mapper.update(scan, odometry)
    nodes = building.store.count("node")
    _, odometry, scan = scans[50]

    def later(after_s, **lifted):
        when = replace(scan, stamp_s=scan.stamp_s + after_s)
        return building.mapper.update(when, replace(odometry, stamp_s=when.stamp_s), **lifted)

    assert not later(0.1, lifted=True).used
    assert building.mapper.view().quality == 0.0
    assert later(0.2).displaced == ""
    assert building.mapper.view().quality > 0.5
    later(0.5, lifted=True)
    later(2.0, lifted=True)
    put_down = later(2.1)
    assert put_down.used
    assert "carried" in put_down.displaced
    assert building.mapper.view().lost
    assert building.store.count("node") == nodes + 1


def test_a_new_floor_begins_with_an_empty_window_joined_by_the_lift(building):
    scans = list(drive(LAPS[:60], WALLS, seed=2))
    for _, odometry, scan in scans[:50]:
        building.mapper.update(scan, odometry)
    below = building.topo.associated_id
    _, odometry, scan = scans[50]
    building.mapper.update(scan, odometry, events=[LevelChanged(1)])
    above = building.topo.associated_id
    assert building.topo.graph.node(above).level == building.topo.level == 1
    assert building.topo.graph.edge_between(below, above).type is EdgeType.ODOMETRY
    assert not building.mapper.view().lost


class Taught:
    """A map on file of a world's graph, taught by what navigation tells."""

    def __init__(self, world, folder):
        self.store = TopoStore.create(folder / "map.lemto", durable=False)
        self.graph = PagedGraph(self.store)
        self.ids, places = {}, world.graph.places
        for node_id in sorted(places):
            self.ids[node_id] = self.graph.add_node().node_id
        for _, a, b in world.graph.links:
            T = np.array([*np.subtract(places[b], places[a]), 0.0])
            self.graph.add_edge(Edge(0, self.ids[a], self.ids[b], T, np.eye(3) * 1e-4, EdgeType.ODOMETRY))
        assert all(number == node_id for number, node_id in self.ids.items())

    def hear(self, outputs):
        for output in outputs:
            for event in output.events:
                learn(event, self.graph, 1, np.zeros(3))

    def edge(self, a, b):
        return self.graph.edge_between(a, b)


@pytest.fixture
def rooms(tmp_path):
    world = two_rooms()
    taught = Taught(world, tmp_path)
    yield world, taught
    taught.store.close()


def test_edges_driven_there_and_back_have_learnt_how_long_they_take(rooms):
    world, taught = rooms
    been = []  # (node, since when)

    def watch(w):
        node_id = w.view().associated_id
        if not been or been[-1][0] != node_id:
            been.append((node_id, w.now_s))

    navigator = Navigator()
    for goal in (8, 1, 8):
        outputs = run(world, navigator, goal, 90.0, watch)
        assert outputs[-1].state == NavState.ARRIVED
        taught.hear(outputs)
    took_s = {}
    for (a, since_s), (b, until_s) in pairwise(been):
        took_s.setdefault(frozenset((a, b)), []).append(until_s - since_s)
    inner = {ends: took for ends, took in took_s.items() if len(took) == 3 and not ends & {1, 8}}
    assert len(inner) >= 2
    for ends, took in inner.items():
        edge = taught.edge(*sorted(ends))
        assert edge.time_s is not None, sorted(ends)
        assert min(took) - 0.2 <= edge.time_s <= max(took) + 0.2, sorted(ends)


def test_an_edge_found_closed_is_open_in_the_map_again_once_its_door_was_seen_open(rooms):
    world, taught = rooms
    world.pose[:2] = (4.0, 1.0)
    world.box(6.55, 2.0, 7.45, 2.15)
    navigator = Navigator()
    taught.hear(run(world, navigator, 8, 90.0))
    closed = [edge for edge in taught.store.edges() if edge.blocked_until_s > world.now_s]
    assert closed
    world.box(6.55, 2.0, 7.45, 2.15, value=False)
    taught.hear(run(world, navigator, 6, 60.0))
    assert all(taught.store.edge(edge.edge_id).blocked_until_s <= world.now_s for edge in closed)
