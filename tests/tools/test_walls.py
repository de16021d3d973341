"""The true plan's walls between two places, as the benches judge by them."""

import numpy as np

from lemtomap.sim.world import Raster
from tools.truth.walls import wall_between


def test_a_wall_of_the_plan_stands_between_places_on_either_side_of_it():
    occupied = np.zeros((40, 60), dtype=np.bool_)
    occupied[:30, 30] = True
    raster = Raster(occupied, ~occupied, 0.1, (-3.0, -2.0))  # the wall: x 0 to 0.1, y -2 to 1
    left, right = np.array([-1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])
    assert wall_between(raster, left, right)
    assert not wall_between(raster, left, np.array([-0.1, 0.5, 0.0]))
    above = np.array([0.0, 1.5, 0.0])
    assert not wall_between(raster, left + above, right + above)
