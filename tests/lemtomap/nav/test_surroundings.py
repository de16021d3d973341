"""What was met by touch: how long it shuts its place, how wide a berth it gets, what outlives a run."""

import numpy as np
import pytest

from lemtomap.nav.config import NavConfig
from lemtomap.nav.kernels import fields as kernels
from lemtomap.nav.surroundings import Surroundings
from lemtomap.nav.types import Contact, ContactKind
from lemtomap.topo.graph import Mark
from tests.lemtomap.nav.world import Graph, World

CONFIG = NavConfig()
SHUT_S = CONFIG.costmap.contact_hard_s
AHEAD_M = CONFIG.body.radius_m + CONFIG.costmap.contact_radius_m


@pytest.fixture
def world() -> World:
    return World(6.0, 6.0, Graph.of({1: (3.0, 3.0)}, []), pose=(3.0, 3.0, 0.0))


@pytest.fixture
def surroundings(world) -> Surroundings:
    surroundings = Surroundings(CONFIG)
    surroundings.take(world.view(), ())
    return surroundings


def touch(surroundings, world, stamp_s, kind=ContactKind.BUMPER) -> None:
    surroundings.touch(Contact(stamp_s, kind, 0.0), world.view(), world.pose)


def at(surroundings, world, now_s, ahead_m=AHEAD_M) -> tuple[int, float]:
    """State and price of the floor straight ahead."""
    costs = surroundings.costs(world.view(), np.array([1.0, 1.0, 0.0]), now_s)
    row, col = costs.cell((3.0 + ahead_m, 3.0))
    return int(costs.state[int(row), int(col)]), float(costs.cost[int(row), int(col)])


def test_what_was_bumped_shuts_its_place_and_later_only_makes_it_dear(surroundings, world):
    touch(surroundings, world, 10.0)
    assert at(surroundings, world, 10.1)[0] == kernels.LETHAL
    state, price = at(surroundings, world, 11.0 + SHUT_S)
    assert state == kernels.FREE
    assert price == pytest.approx(CONFIG.costmap.contact_price)
    assert at(surroundings, world, 11.0 + CONFIG.costmap.contact_memory_s)[1] < 1.1


def test_floor_beside_what_was_bumped_is_dear_from_the_start_but_open(surroundings, world):
    touch(surroundings, world, 10.0)
    state, price = at(surroundings, world, 10.1, AHEAD_M + 0.45)
    assert state == kernels.FREE
    assert CONFIG.costmap.contact_price <= price < np.inf
    assert at(surroundings, world, 10.1, AHEAD_M + 1.0)[1] < 1.5


def test_what_is_felt_again_shuts_its_place_for_longer(surroundings, world):
    touch(surroundings, world, 10.0)
    again_s = 20.0 + SHUT_S
    touch(surroundings, world, again_s)
    assert at(surroundings, world, again_s + 1.1 * SHUT_S)[0] == kernels.LETHAL
    assert at(surroundings, world, again_s + 1.1 * CONFIG.costmap.contact_growth * SHUT_S)[0] == kernels.FREE


def test_the_bounces_of_one_bump_are_not_felt_again(surroundings, world):
    for stamp_s in (10.0, 10.2, 10.9):
        touch(surroundings, world, stamp_s)
    assert at(surroundings, world, 12.0 + SHUT_S)[0] == kernels.FREE


def test_a_cliff_stays_for_ever(surroundings, world):
    touch(surroundings, world, 10.0, ContactKind.CLIFF)
    assert at(surroundings, world, 1e6)[0] == kernels.LETHAL


def test_of_an_earlier_run_cliffs_shut_their_place_and_bumps_make_it_dear(world):
    class Marked(Graph):
        def marks(self):
            return [
                Mark(1, 1, str(ContactKind.BUMPER), AHEAD_M, 0.0, 0.0),
                Mark(2, 1, str(ContactKind.CLIFF), -AHEAD_M, 0.0, 0.0),
                Mark(3, 1, "of another program", 0.0, 2.0, 0.0),
            ]

    surroundings = Surroundings(CONFIG)
    surroundings.take(world.view(), ())
    surroundings.recall(Marked(world.graph.places), 5.0)
    assert at(surroundings, world, 6.0) == (kernels.FREE, pytest.approx(CONFIG.costmap.contact_price))
    assert at(surroundings, world, 6.0, -AHEAD_M)[0] == kernels.LETHAL
