"""One search of a graph for all: cheapest first, as far as it is asked for."""

from itertools import pairwise

import networkx as nx
import numpy as np
import pytest

from lemtomap.dijkstra import CheapestFirst, way_back


def random_graph(seed, nodes=60, edges=150):
    rng = np.random.default_rng(seed)
    graph = nx.Graph()
    graph.add_nodes_from(range(1, nodes + 1))
    for a, b in rng.integers(1, nodes + 1, (edges, 2)).tolist():
        if a != b:
            graph.add_edge(a, b, weight=float(rng.uniform(0.1, 3.0)))
    return graph


def steps(graph):
    return lambda node: [(other, data["weight"], (node, other)) for other, data in graph.adj[node].items()]


@pytest.mark.parametrize("seed", range(5))
def test_costs_and_ways_are_those_of_a_library_that_knows(seed):
    graph = random_graph(seed)
    settled = {found.node_id: found for found in CheapestFirst(1, steps(graph))}
    expected = nx.single_source_dijkstra_path_length(graph, 1)
    assert {node: found.cost for node, found in settled.items()} == pytest.approx(expected)
    for node, found in settled.items():
        nodes, edges = way_back(settled, node)
        assert (nodes[0], nodes[-1]) == (1, node)
        assert list(edges) == list(pairwise(nodes))
        assert nx.path_weight(graph, nodes, "weight") == pytest.approx(found.cost)


def test_the_nearest_come_first_and_each_once():
    costs = [found.cost for found in CheapestFirst(1, steps(random_graph(1)))]
    assert costs == sorted(costs)
    nodes = [found.node_id for found in CheapestFirst(1, steps(random_graph(1)))]
    assert len(nodes) == len(set(nodes))


def test_nothing_dearer_than_asked_for_is_settled_but_what_costs_just_that_is():
    line = nx.path_graph(range(1, 7))
    nx.set_edge_attributes(line, 1.0, "weight")
    assert [found.node_id for found in CheapestFirst(1, steps(line), most=3.0)] == [1, 2, 3, 4]


def test_a_search_reads_no_more_of_the_graph_than_it_is_asked_for():
    asked = []

    def endless(node):
        asked.append(node)
        return [(node + 1, 1.0, None)]

    search = CheapestFirst(1, endless)
    assert [next(search).node_id for _ in range(3)] == [1, 2, 3]
    assert asked == [1, 2, 3]
    assert not search.is_over


def test_a_node_that_joins_meanwhile_is_searched_on_from():
    graph = nx.Graph()
    graph.add_edge(1, 2, weight=1.0)
    search = CheapestFirst(1, steps(graph))
    assert [found.node_id for found in search] == [1, 2]
    graph.add_edge(2, 3, weight=1.0)
    graph.add_edge(3, 4, weight=1.0)
    search.settle(3, 2.0)
    assert [(found.node_id, found.cost) for found in search] == [(4, 3.0)]


def test_of_ways_that_cost_the_same_the_one_found_first_counts():
    square = nx.Graph()
    square.add_weighted_edges_from([(1, 2, 1.0), (1, 3, 1.0), (2, 4, 1.0), (3, 4, 1.0)])
    settled = {found.node_id: found for found in CheapestFirst(1, steps(square))}
    assert way_back(settled, 4)[0] == (1, 2, 4)
