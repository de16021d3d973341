"""Opened and eroded masks are what mathematical morphology makes of them."""

import numpy as np
import pytest
from scipy import ndimage

from lemtomap.nav.kernels import shapes


def blobs(seed):
    rng = np.random.default_rng(seed)
    return ndimage.uniform_filter(rng.random((37, 52)), 3) > 0.45


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("side", [1, 2, 3, 4, 5])
def test_what_squares_cover_is_the_opening(seed, side):
    mask = blobs(seed)
    opening = ndimage.binary_opening(mask, np.ones((side, side), np.bool_))
    np.testing.assert_array_equal(shapes.opened(mask, side), opening)


@pytest.mark.parametrize("cells", [0, 1, 2, 3])
def test_what_is_far_enough_inside_is_what_a_minimum_filter_leaves(cells):
    bits = blobs(1).astype(np.uint8)
    least = ndimage.minimum_filter(bits, size=2 * cells + 1, mode="constant", cval=0)
    np.testing.assert_array_equal(shapes.eroded(bits, cells), least)


def test_a_square_at_the_border_counts_and_a_beam_beside_it_does_not():
    mask = np.zeros((6, 6), np.bool_)
    mask[3:, 3:] = True
    mask[4, :] = True
    expected = np.zeros((6, 6), np.bool_)
    expected[3:, 3:] = True
    np.testing.assert_array_equal(shapes.opened(mask, 3), expected)
