"""What lies under a straight line over a window of cells."""

import math

import numpy as np
import pytest

from lemtomap.kernels.lines import first_on_line


def layer_with(*cells):
    """20 x 30 free cells, one of 100 for each of `cells`."""
    layer = np.zeros((20, 30), np.int8)
    for cell in cells:
        layer[cell] = 100
    return layer


@pytest.mark.parametrize("dtype", [np.int8, np.uint8, np.float32, np.bool_])
def test_a_line_is_free_unless_something_stands_under_it_in_layers_of_any_kind(dtype):
    layer = layer_with((5, 10)).astype(dtype)
    assert math.isfinite(first_on_line(layer, 5.5, 2.5, 5.5, 20.5, 1.0, 0.0))
    assert math.isinf(first_on_line(layer, 6.5, 2.5, 6.5, 20.5, 1.0, 0.0))


def test_of_two_things_on_a_line_the_nearer_to_its_start_is_told():
    layer = layer_with((5, 10), (5, 20))
    assert first_on_line(layer, 5.5, 0.5, 5.5, 20.5, 50.0, 0.0) == pytest.approx(9.5 / 20.0, abs=0.026)
    assert first_on_line(layer, 5.5, 20.5, 5.5, 0.5, 50.0, 0.0) == 0.0


@pytest.mark.parametrize("slope", [(0, 1), (1, 0), (3, 7), (-3, 7), (-7, -2)])
def test_no_cell_in_the_way_is_passed_over(slope):
    middle = np.array([10.5, 15.5])
    start, end = middle - np.array(slope), middle + np.array(slope)
    assert math.isfinite(first_on_line(layer_with((10, 15)), *start, *end, 50.0, 0.0))


def test_both_ends_count_and_a_line_without_length_is_its_cell():
    layer = layer_with((5, 10))
    assert first_on_line(layer, 5.5, 10.5, 5.5, 20.5, 50.0, 0.0) == 0.0
    assert first_on_line(layer, 5.5, 2.5, 5.5, 10.01, 50.0, 0.0) == 1.0
    assert first_on_line(layer, 5.5, 10.5, 5.5, 10.5, 50.0, 0.0) == 0.0
    assert math.isinf(first_on_line(layer, 5.5, 11.5, 5.5, 11.5, 50.0, 0.0))


@pytest.mark.parametrize("line", [(-0.4, 2.5, -0.4, 9.5), (19.5, 2.5, 20.1, 2.5), (3.5, -0.2, 3.5, 9.5)])
def test_beyond_the_border_is_what_the_caller_says_there_is(line):
    assert math.isinf(first_on_line(layer_with(), *line, 50.0, 0.0))
    assert math.isfinite(first_on_line(layer_with(), *line, 50.0, 50.0))
