"""Which drives tell how long an edge takes."""

import pytest

from lemtomap.nav.route.watching import EdgeClock
from lemtomap.topo.events import EdgeTraversed
from tests.lemtomap.nav.world import Graph

GRAPH = Graph.of({1: (0.0, 0.0), 2: (1.0, 0.0), 3: (2.0, 0.0), 4: (9.0, 0.0)}, [(1, 2), (2, 3), (3, 4)])


def told(*steps):
    """Return what a clock tells of (associated node, time, whether it drives) after one another."""
    clock = EdgeClock()
    return [
        event
        for node_id, now_s, driving in steps
        if (event := clock.step(node_id, GRAPH, now_s, driving=driving))
    ]


def test_an_edge_takes_as_long_as_the_robot_is_at_its_first_node():
    steps = [(1, 0.0, True), (2, 3.0, True), (2, 4.0, True), (3, 5.5, True)]
    assert told(*steps) == [EdgeTraversed(1, 2, 3.0), EdgeTraversed(2, 3, 2.5)]


@pytest.mark.parametrize("waited_at", [0, 1, 2])
def test_an_edge_on_which_the_robot_waited_tells_nothing(waited_at):
    steps = [(1, 0.0, True), (1, 1.0, True), (2, 9.0, True)]
    steps[waited_at] = (*steps[waited_at][:2], False)
    assert told(*steps) == []


def test_nodes_that_no_edge_joins_tell_nothing():
    assert told((1, 0.0, True), (3, 2.0, True)) == []
