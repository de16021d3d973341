"""When a guess about where the robot is may be believed."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from lemtomap.topo.loops.config import LoopConfig
from lemtomap.topo.loops.locator import Guess, Locator
from lemtomap.topo.loops.matcher import SearchMatch

CONFIG = LoopConfig()
CHECKS = CONFIG.locator.checks
GOOD = SearchMatch(np.zeros(3), np.eye(3) * 1e-4, *([1.0] * (len(SearchMatch.__dataclass_fields__) - 2)))
SEEN = 2 * CONFIG.points


def is_believed(fits=(0.95,) * CHECKS, seen=SEEN, **match):
    locator = Locator(CONFIG, SimpleNamespace(), SimpleNamespace(), lambda _: True)
    guess = Guess(7, np.zeros(3), list(fits))
    view = SimpleNamespace(points_base=np.zeros((seen, 2)))
    return locator._is_sound(guess, replace(GOOD, **match), view, CONFIG.weakest)


def test_a_guess_that_has_borne_every_check_on_walls_that_hold_it_is_believed():
    assert is_believed()


@pytest.mark.parametrize(
    "lacks",
    [
        {"fits": (0.95,) * (CHECKS - 1)},
        {"fits": (0.95,) * CHECKS + (CONFIG.locator.fit - 0.01, 0.95)},
        {"weakest": CONFIG.weakest - 0.01},
        {"explained": 0.7, "known": 0.7},
        {"seen": CONFIG.points - 1},
    ],
    ids=[
        "too few checks",
        "one check failed of late",
        "free along a corridor",
        "little known",
        "little seen",
    ],
)
def test_one_thing_that_it_lacks_is_enough_to_doubt_it(lacks):
    assert not is_believed(**lacks)


def test_a_check_that_failed_long_ago_is_forgiven():
    assert is_believed(fits=(0.1,) + (0.95,) * CHECKS)


@pytest.mark.parametrize(("off_m", "fit"), [(0.0, 0.7), (1.0, 0.35)])
def test_what_lies_where_the_robot_looked_through_speaks_against_a_guess_and_so_does_a_leap(off_m, fit):
    locator = Locator(CONFIG, SimpleNamespace(), SimpleNamespace(), lambda _: True)
    locator.places = SimpleNamespace(
        around=lambda *_: {}, company=lambda _: SimpleNamespace(points_node=np.zeros((1, 2)))
    )
    locator._picture = lambda _: None
    moved = replace(GOOD, T_grid_place=np.array([off_m, 0.0, 0.0]), contradicted=0.2)
    view = SimpleNamespace(reference=SimpleNamespace(refine=lambda *_: moved), explained_by=lambda *_: 0.9)
    guess = Guess(7, np.zeros(3))
    locator._check(guess, view)
    assert guess.fits == [pytest.approx(fit)]
