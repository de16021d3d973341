"""What the exploration bench says about a contact."""

import math

import pytest

from lemtomap.sim.world import Box
from tools.bench.explore import _away_m

FOOT = Box((1.0, 0.0, 0.04), (0.14, 0.02, 0.025), math.pi / 2)
TABLE_TOP = Box((1.0, 0.0, 0.73), (0.7, 0.35, 0.015))


@pytest.mark.parametrize(("x", "y", "away_m"), [(0.5, 0.0, 0.48), (1.0, 0.3, 0.16), (1.0, 0.1, 0.0)])
def test_a_turned_box_is_as_far_as_its_side(x, y, away_m):
    assert _away_m(FOOT, x, y) == pytest.approx(away_m)


def test_what_the_robot_passes_under_is_not_what_it_touched():
    assert min([TABLE_TOP, FOOT], key=lambda box: _away_m(box, 1.0, 0.3)) is FOOT
