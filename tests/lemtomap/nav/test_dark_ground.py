"""Which unseen patches are in sight of a place, on grids of a few cells."""

import numpy as np
import pytest

from lemtomap.nav.kernels.explore import FREE, LETHAL, UNKNOWN, dark_in_sight


def floor(*patch):
    """40 x 40 free cells with one unseen cell, and where it is."""
    state = np.full((40, 40), FREE, np.uint8)
    state[patch] = UNKNOWN
    large = np.zeros((40, 40), np.uint8)
    large[patch] = 1
    return state, large


@pytest.mark.parametrize(("row", "col"), [(20, 27), (27, 20), (13, 20), (15, 15)])
def test_a_patch_within_the_radius_is_in_sight_unless_something_stands_before_it(row, col):
    state, large = floor(row, col)
    assert dark_in_sight(state, large, 20.5, 20.5, 8.0)
    state[abs(np.hypot(*(np.indices((40, 40)) - 20)) - 5.0) < 0.8] = LETHAL
    assert not dark_in_sight(state, large, 20.5, 20.5, 8.0)


@pytest.mark.parametrize(("row", "col"), [(20, 29), (27, 27), (13, 14), (12, 27)])
def test_a_patch_beyond_the_radius_is_not_for_all_that_it_lies_in_the_square_around(row, col):
    assert not dark_in_sight(*floor(row, col), 20.5, 20.5, 8.0)


def test_a_place_without_free_floor_around_says_nothing():
    state, large = floor(30, 30)
    state[10:31, 10:31] = LETHAL
    assert dark_in_sight(state, large, 20.5, 20.5, 8.0)
