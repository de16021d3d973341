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


def entered(fits, new_fit, new_at_m):
    """The guesses left when one of a fit comes in beside an older one, so far from it."""
    locator = Locator(CONFIG, SimpleNamespace(), SimpleNamespace(), lambda _: True)
    locator.places = SimpleNamespace(around=lambda node_id, *_: {node_id: np.zeros(3)})
    locator.guesses = [Guess(7, np.zeros(3), list(fits), from_m=1.0)]
    locator._check = lambda guess, _: guess.fits.append(new_fit)
    found = SimpleNamespace(T_grid_place=np.array([-new_at_m, 0.0, 0.0]))
    here = SimpleNamespace(T_grid_base=np.zeros(3), travelled_m=3.0, turned_rad=0.0)
    locator._take(7, SimpleNamespace(look=here), SimpleNamespace(match=found, rival=None))
    locator._unite()
    return [(guess.T_grid_node[0], guess.fits, guess.from_m) for guess in locator.guesses]


def test_a_better_guess_takes_the_place_of_one_on_the_other_face_of_the_wall_and_is_checked_from_the_start():
    """The true pose was thrown away 13 m long, because a worse one stood 0.2 m beside it."""
    assert entered((0.8, 0.7, 0.65), 1.0, 0.2) == [(0.2, [1.0], 3.0)]


def test_a_guess_about_as_good_as_one_checked_before_is_the_same_and_no_news():
    assert entered((0.95, 0.95), 1.0, 0.2) == [(0.0, [0.95, 0.95], 1.0)]


def test_a_guess_of_another_place_is_one_more():
    assert len(entered((0.95, 0.95), 1.0, 2.0)) == 2


def test_two_guesses_that_have_become_one_place_are_the_better_one_even_if_checked_less():
    locator = Locator(CONFIG, SimpleNamespace(), SimpleNamespace(), lambda _: True)
    locator.places = SimpleNamespace(around=lambda node_id, *_: {node_id: np.zeros(3)})
    worse, better = Guess(7, np.zeros(3), [0.7] * 5), Guess(7, np.array([0.2, 0.0, 0.0]), [0.98] * 3)
    locator.guesses = [worse, better]
    locator._unite()
    assert locator.guesses == [better]
