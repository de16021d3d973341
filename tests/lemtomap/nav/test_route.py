"""Routes: the flat network against plain Dijkstra, and both against what may happen to a graph."""

from dataclasses import replace

import numpy as np
import pytest

from lemtomap.errors import NoRoute
from lemtomap.nav.config import RouteConfig
from lemtomap.nav.route.fresh import FreshGraph
from lemtomap.nav.route.network import RouteNetwork
from lemtomap.nav.route.planner import edge_cost_s, plan_route, price_s
from lemtomap.nav.route.planning import RoutePlanner, table_of
from lemtomap.topo.config import TopoConfig
from lemtomap.topo.file.paging import PagedGraph
from lemtomap.topo.file.reader import TopoReader
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.graph import Edge
from lemtomap.topo.local import LocalMap
from lemtomap.topo.snapshots import Snapshots
from lemtomap.types import EdgeType, RouteEdge
from tests.lemtomap.nav.world import Graph, World

CONFIG = RouteConfig()


def city(rng, side=12) -> Graph:
    """A grid of places with some links missing."""
    places = {1 + r * side + c: (float(c), float(r)) for r in range(side) for c in range(side)}
    pairs = [(n, n + 1) for n in places if n % side] + [(n, n + side) for n in places if n + side in places]
    return Graph.of(places, [pair for pair in pairs if rng.random() < 0.8])


def edges_of(graph: Graph):
    return {node_id: graph.edges_of(node_id) for node_id in graph.places}


@pytest.mark.parametrize("seed", range(4))
def test_flat_network_agrees_with_dijkstra_while_edges_close_and_open(seed):
    rng = np.random.default_rng(seed)
    graph = city(rng)
    network = RouteNetwork(table_of(edges_of(graph)), CONFIG)
    start, goal = 1, 144
    for _ in range(25):
        closed = {
            int(rng.integers(100, 100 + len(graph.links))): 10.0 for _ in range(int(rng.integers(0, 30)))
        }
        start = int(rng.integers(1, 145)) if rng.random() < 0.3 else start
        try:
            slow = plan_route(graph, start, goal, 0.0, CONFIG, closed)
        except NoRoute:
            with pytest.raises(NoRoute):
                network.plan(start, goal, 0.0, closed)
            continue
        fast = network.plan(start, goal, 0.0, closed)
        assert fast.cost_s == pytest.approx(slow.cost_s, rel=1e-4)
        assert fast.nodes[0] == start
        assert fast.nodes[-1] == goal
        assert not {edge.edge_id for edge in fast.edges} & closed.keys()
        for here, edge, there in zip(fast.nodes, fast.edges, fast.nodes[1:], strict=False):
            assert edge.edge_id in {e.edge_id for e in graph.edges_of(here) if e.other_id == there}


def test_prefers_the_way_that_is_known_to_be_quicker():
    graph = Graph.of(
        {1: (0.0, 0.0), 2: (1.0, 0.0), 3: (2.0, 0.0), 4: (1.0, 1.2)}, [(1, 2), (2, 3), (1, 4), (4, 3)]
    )
    edges = {
        node_id: [replace(edge, time_s=30.0) if edge.edge_id == 101 else edge for edge in every]
        for node_id, every in edges_of(graph).items()
    }  # usually somebody stands on the second one
    assert RouteNetwork(table_of(edges), CONFIG).plan(1, 3, 0.0).nodes == (1, 4, 3)


def test_blocked_edge_opens_again_after_its_time():
    graph = Graph.of({1: (0.0, 0.0), 2: (1.0, 0.0)}, [(1, 2)])
    graph.blocked_s[100] = 50.0
    with pytest.raises(NoRoute, match="tried again in 40 s"):
        plan_route(graph, 1, 2, 10.0, CONFIG)
    assert plan_route(graph, 1, 2, 51.0, CONFIG).nodes == (1, 2)


def test_large_map_on_file_is_planned_in_step_with_its_changes(tmp_path):
    def edge(a: int, b: int) -> Edge:
        return Edge(0, a, b, np.array([1.0, 0.0, 0.0]), np.eye(3) * 1e-4, EdgeType.ODOMETRY)

    store = TopoStore.create(tmp_path / "map.lemto", durable=False)
    for _ in range(40):
        store.add_node()
    chain = [store.add_edge(edge(n, n + 1)) for n in range(1, 40)]
    store.commit()
    world = World(5.0, 5.0, Graph.of({1: (1.0, 1.0)}, []))
    planner, view = RoutePlanner(RouteConfig(large_nodes=10)), world.view(1)
    with TopoReader(tmp_path / "map.lemto") as reader:

        def route() -> tuple[int, ...]:
            return planner.plan(FreshGraph(reader, view), 1, 40, 0.0, {}).nodes

        assert route() == tuple(range(1, 41))
        store.add_edge(edge(2, 39))
        store.commit()
        assert route() == (1, 2, 39, 40)
        store.delete_edge(chain[-1].edge_id)
        store.commit()
        with pytest.raises(NoRoute):
            route()
    store.close()


def test_a_closure_that_the_view_tells_joins_the_map_before_it_is_on_file():
    graph = Graph({1: (0.0, 0.0), 2: (1.0, 0.0), 9: (1.0, 1.0)}, [(100, 1, 2)])
    view = World(4.0, 4.0, graph).view(9)
    with pytest.raises(NoRoute):
        RoutePlanner(CONFIG).plan(FreshGraph(graph, view), 9, 1, 0.0, {})
    closure = {9: [RouteEdge(101, 2, 1.0, 2.5)], 2: [*graph.edges_of(2), RouteEdge(101, 9, 1.0, 2.5)]}
    joined = replace(view, changed=closure)
    assert RoutePlanner(CONFIG).plan(FreshGraph(graph, joined), 9, 1, 0.0, {}).nodes == (9, 2, 1)


def test_what_the_view_tells_of_an_edge_counts_for_what_the_file_holds():
    graph = Graph.of({1: (0.0, 0.0), 2: (1.0, 0.0), 3: (2.0, 0.0)}, [(1, 2), (2, 3)])
    view = World(4.0, 4.0, graph).view(1)
    revoked = FreshGraph(graph, replace(view, changed={2: graph.edges_of(2)[:1], 3: []}))
    with pytest.raises(NoRoute, match="not connected"):
        RoutePlanner(CONFIG).plan(revoked, 1, 3, 0.0, {})
    assert RoutePlanner(CONFIG).plan(revoked, 1, 2, 0.0, {}).nodes == (1, 2)


def test_the_version_changes_with_a_change_and_not_when_it_goes_into_the_file():
    graph = Graph({1: (0.0, 0.0)}, [], version=5)
    view = World(4.0, 4.0, graph).view(1)
    before = FreshGraph(graph, replace(view, graph_version=5)).version
    told = FreshGraph(graph, replace(view, graph_version=7)).version
    graph.version = 7
    assert (before, told, FreshGraph(graph, replace(view, graph_version=7)).version) == (5, 7, 7)


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_an_edge_costs_the_same_alone_and_in_a_table_proven_or_not(share):
    config = RouteConfig(learnt_weight=share)
    edges = [RouteEdge(1, 2, 1.0, 9.0), RouteEdge(2, 3, 4.0, 10.0, proven=False), RouteEdge(3, 4, 0.5, 1.0)]
    names = ("time_s", "length_m", "proven")
    columns = [np.array([getattr(edge, name) for edge in edges], float) for name in names]
    assert price_s(*columns, config) == pytest.approx([edge_cost_s(edge, config) for edge in edges])
    known = [share * edge.time_s + (1.0 - share) * edge.length_m / config.usual_speed_mps for edge in edges]
    assert price_s(*columns, config) == pytest.approx(
        np.array(known) + np.array([0.0, config.unproven_s, 0.0])
    )


@pytest.mark.parametrize("large_nodes", [10, 1000])
def test_a_map_of_any_size_is_planned_over_with_changes_that_were_never_committed(tmp_path, large_nodes):
    def edge(a: int, b: int) -> Edge:
        return Edge(0, a, b, np.array([1.0, 0.0, 0.0]), np.eye(3) * 1e-4, EdgeType.ODOMETRY)

    store = TopoStore.create(tmp_path / "map.lemto", durable=False)
    for _ in range(20):
        store.add_node()
    chain = [store.add_edge(edge(n, n + 1)) for n in range(1, 20)]
    store.commit()
    graph = PagedGraph(store)
    snapshots = Snapshots(graph, LocalMap(graph, TopoConfig()))
    planner = RoutePlanner(RouteConfig(large_nodes=large_nodes))
    empty = World(5.0, 5.0, Graph({1: (1.0, 1.0)}))
    with TopoReader(tmp_path / "map.lemto") as reader:

        def route(goal_id: int) -> tuple[int, ...]:
            view = replace(empty.view(1), changed=snapshots.changed(), graph_version=store.version)
            return planner.plan(FreshGraph(reader, view), 1, goal_id, 0.0, {}).nodes

        assert route(20) == tuple(range(1, 21))
        new_id = graph.add_node().node_id
        shortcut, last = graph.add_edge(edge(1, 19)), graph.add_edge(edge(20, new_id))
        assert not reader.has_node(new_id)
        assert route(new_id) == (1, 19, 20, new_id)
        graph.delete_edge(shortcut)
        assert route(new_id) == (*range(1, 21), new_id)
        graph.put_edge(replace(last, blocked_until_s=60.0))
        with pytest.raises(NoRoute, match=r"closed"):
            route(new_id)
        graph.delete_edge(chain[0])
        with pytest.raises(NoRoute):
            route(20)
        graph.add_edge(edge(1, 2))
        store.commit()
        assert snapshots.changed() == {}
        assert route(20) == tuple(range(1, 21))
    store.close()
