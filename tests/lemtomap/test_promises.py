"""What the whole promises, in worlds made up for it: the parts may all be right and the sum still wrong."""

from itertools import pairwise

import numpy as np
import pytest

from lemtomap.grid import SlamConfig, WindowMatcher
from lemtomap.nav.navigator import Navigator
from lemtomap.nav.types import NavState
from lemtomap.pipeline import Mapper
from lemtomap.se2 import between, compose, inverse
from lemtomap.topo.config import TopoConfig
from lemtomap.topo.graph import Edge
from lemtomap.topo.learning import learn
from lemtomap.topo.loops import LoopRecogniser
from lemtomap.topo.mapper import TopoMapper
from lemtomap.topo.paging import PagedGraph
from lemtomap.topo.store import TopoStore
from lemtomap.types import EdgeType
from tests.lemtomap.grid.rooms import corridor_round, drive, way_round
from tests.lemtomap.nav.test_navigator import two_rooms
from tests.lemtomap.nav.world import run

ROUND = 18.0, 12.0
LAPS = way_round(*ROUND)


class Mapped:
    """A building driven through from an empty map, and where each node truly is."""

    def __init__(self, path, walls, folder):
        self.store = TopoStore.create(folder / "map.lemto", durable=False)
        self.recogniser = LoopRecogniser()
        topo = TopoMapper(TopoConfig(), self.store, recogniser=self.recogniser)
        self.mapper = Mapper(WindowMatcher(SlamConfig()), topo)
        self.born = {}
        for truth, odometry, scan in drive(path, walls, seed=2, odometry_noise=0.05):
            self.mapper.update(scan, odometry)
            self.born.setdefault(topo.associated_id, compose(truth, inverse(topo.T_node_base)))

    def off(self, edge):
        true = between(self.born[edge.source_id], self.born[edge.target_id])
        return between(true, edge.T_source_target)


@pytest.fixture(scope="module")
def twice_round(tmp_path_factory):
    """One and a third rounds of a corridor that is longer than a window can hold."""
    mapped = Mapped(
        LAPS[: len(LAPS) * 2 // 3], corridor_round(*ROUND), tmp_path_factory.mktemp("twice_round")
    )
    yield mapped
    mapped.mapper.topo.close()


def test_a_round_driven_again_is_closed_and_every_closure_is_right(twice_round):
    closures = [edge for edge in twice_round.store.edges() if edge.type is EdgeType.LOOP_CLOSING]
    assert closures
    off = np.array([twice_round.off(edge) for edge in closures])
    assert np.hypot(off[:, 0], off[:, 1]).max() < 0.25
    assert np.abs(off[:, 2]).max() < 0.05


def test_the_second_time_round_the_robot_is_at_the_nodes_of_the_first(twice_round):
    first_lap = set(range(1, max(twice_round.born) // 2))
    assert twice_round.mapper.topo.associated_id in first_lap
    assert first_lap & set(twice_round.mapper.view().T_grid_node)


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
