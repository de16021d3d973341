"""Closures that a person would call obvious: once round a hall and on, along one wall."""

import numpy as np
import pytest

from tools.bench.parts import atria


@pytest.mark.parametrize(
    ("seed", "start", "wheels"),
    [(0, 0, "Kobuki"), (3, 0, "Kobuki"), (7, 1, "Kobuki"), (1, 0, "poor wheels")],
    ids=["triangle", "bare triangle", "atrium", "atrium, poor wheels"],
)
def test_who_comes_back_along_one_wall_of_a_hall_is_known_to_be_back_within_five_metres(
    tmp_path, seed, start, wheels
):
    driven = atria.drive(seed, start, tmp_path, wheels)
    assert (driven.revisits.closed, driven.revisits.missed, driven.wrong) == (1, 0, 0)


@pytest.mark.parametrize("kind", atria.KINDS)
def test_every_start_drives_the_whole_round_and_a_third_of_it_again_inside_the_walls(kind):
    corners = atria.outline(kind, np.random.default_rng(3))
    ring = atria.inset(corners, 2.0)
    round_m = float(np.hypot(*(ring - np.roll(ring, 1, axis=0)).T).sum())
    for start in range(atria.STARTS):
        way = np.array(atria.round_trip(corners, start, 2.0))
        driven_m = float(np.hypot(*np.diff(way, axis=0).T).sum())
        assert driven_m == pytest.approx((1.0 + atria.AGAIN) * round_m)
        assert (way >= corners.min(axis=0) + 1.9).all()
        assert (way <= corners.max(axis=0) - 1.9).all()
