"""Which share of a scan's hits lies near those of another."""

import numpy as np
import pytest

from lemtomap.kernels.nearness import share_near


@pytest.mark.parametrize("seed", range(5))
def test_the_share_is_what_a_look_at_every_pair_says(seed):
    rng = np.random.default_rng(seed)
    points, others = rng.uniform(-2.0, 2.0, (67, 2)), rng.uniform(-2.0, 2.0, (40, 2)).astype(np.float32)
    gaps = np.linalg.norm(points[::3, None] - others[None].astype(float), axis=-1)
    assert share_near(points, others, 0.3, 3) == pytest.approx((gaps.min(axis=1) < 0.3).mean())


def test_a_point_is_found_whichever_other_was_near_the_one_before():
    others = np.array([[0.0, 0.0], [5.0, 0.0], [10.0, 0.0]])
    assert share_near(others[::-1].copy(), others, 0.1, 1) == 1.0
    assert share_near(others, others + 1.0, 0.1, 1) == 0.0
