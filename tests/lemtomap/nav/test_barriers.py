"""What is believed to bar an edge: what fills it, not what stands on its line."""

from types import SimpleNamespace

import numpy as np
import pytest

from lemtomap.nav.config import NavConfig
from lemtomap.nav.motion.costmap import Costmap
from lemtomap.nav.motion.metric import reach_from
from lemtomap.nav.route.barriers import find_barrier
from tests.lemtomap.nav.test_navigator import two_rooms
from tests.lemtomap.nav.world import RES

BELOW, ABOVE = (7.0, 1.4), (7.0, 3.6)
ROUTE = SimpleNamespace(nodes=(1, 2), edges=[SimpleNamespace(edge_id=9, length_m=2.2)])


def barrier(world):
    """The edge leads through a door of 0.9 m; the floor behind the door was forgotten."""
    world.known[round(2.3 / RES) :] = world.walls[round(2.3 / RES) :] & (world.known[round(2.3 / RES) :])
    config = NavConfig()
    costmap = Costmap(config.costmap, config.body)
    costmap.follow_window(world.view().grid)
    reach = reach_from(costmap.build(world.now_s, world.pose[:2]), world.pose)
    places = {1: np.array([*BELOW, 0.0]), 2: np.array([*ABOVE, 0.0])}
    return find_barrier(ROUTE, places, reach, 0)


@pytest.fixture
def world():
    world = two_rooms()
    world.box(4.5, 2.0, 4.65, 6.0)
    world.pose[:2] = (7.0, 1.0)
    return world


def test_a_ghost_on_the_line_over_forgotten_floor_bars_nothing(world):
    world.box(7.0, 3.0, 7.05, 3.05)
    assert barrier(world) is None


def test_a_post_in_the_middle_of_a_wide_passage_bars_nothing(world):
    world.box(6.3, 2.0, 7.7, 2.15, value=False)
    world.box(6.95, 2.0, 7.05, 2.15)
    assert barrier(world) is None


def test_a_shut_door_bars_the_edge_whatever_may_lie_behind_it(world):
    world.box(1.75, 2.0, 2.65, 2.15, value=False)
    world.box(6.55, 2.0, 7.45, 2.15)
    found = barrier(world)
    assert found is not None
    assert found.edge_id == 9
    assert found.p_middle_grid[1] == pytest.approx(2.0, abs=0.15)


def test_somebody_in_the_door_bars_the_edge(world):
    world.box(6.8, 1.95, 7.25, 2.2)
    assert barrier(world) is not None
