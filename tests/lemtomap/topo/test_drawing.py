"""The graph on a figure, in the colours that every picture of a map has."""

import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

import lemtomap
from lemtomap import palette
from lemtomap.topo.whole.drawing import draw_edges, draw_graph
from lemtomap.types import EdgeType

PLACES = {1: np.array([0.0, 0.0, 0.0]), 2: np.array([1.0, 0.0, 0.0]), 3: np.array([1.0, 1.0, 0.0])}


@pytest.fixture
def axes():
    return Figure().add_subplot()


def test_each_kind_of_edge_is_drawn_in_its_colour_with_closures_on_top(axes):
    edges = [(1, 2, EdgeType.LOOP_CLOSING), (2, 3, EdgeType.ODOMETRY), (1, 3, EdgeType.NEAR_NEIGHBOUR)]
    draw_graph(axes, PLACES, edges)
    drawn = {to_hex(lines.get_edgecolor()[0]): lines for lines in axes.collections[:3]}
    assert set(drawn) == {palette.EDGES[kind] for kind in EdgeType}
    closure = drawn[palette.EDGES[EdgeType.LOOP_CLOSING]]
    np.testing.assert_allclose(closure.get_segments()[0], [[0, 0], [1, 0]])
    assert closure.get_zorder() == max(lines.get_zorder() for lines in drawn.values())


def test_every_node_is_a_dot_above_all_edges(axes):
    draw_graph(axes, PLACES, [(1, 2, EdgeType.ODOMETRY)])
    dots = axes.collections[-1]
    np.testing.assert_allclose(np.asarray(dots.get_offsets()), [[0, 0], [1, 0], [1, 1]])
    assert dots.get_zorder() > max(lines.get_zorder() for lines in axes.collections[:-1])


def test_an_edge_to_a_node_without_a_place_is_left_out_and_not_counted(axes):
    draw_edges(axes, PLACES, [(1, 2), (2, 99)], EdgeType.ODOMETRY, label="driven")
    assert axes.collections[0].get_label() == "driven (1)"


def test_a_map_without_a_node_can_be_drawn(axes):
    draw_graph(axes, {}, [])


def test_no_picture_of_a_map_has_a_colour_of_its_own():
    package = Path(lemtomap.__file__).parent
    files = [*(package / "robot" / "output").glob("*.py"), *(package / "topo" / "whole").glob("*.py")]
    assert len(files) > 10
    own = {file.name: found for file in files if (found := re.findall(r"#[0-9a-f]{6}\b", file.read_text()))}
    assert own == {}


def test_a_colour_is_told_in_numbers_too():
    assert palette.rgb("#ff0080") == (255, 0, 128)
