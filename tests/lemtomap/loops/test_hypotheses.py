"""When a belief becomes a closure, and when it does not."""

import numpy as np

from lemtomap.se2 import compose
from lemtomap.topo.loops.config import LoopConfig
from lemtomap.topo.loops.hypotheses import Hypotheses, Sighting
from lemtomap.topo.loops.matcher import SearchMatch

OLD_MAP = {k: np.array([float(k), 0.0, 0.0]) for k in range(20)}


def around(node_id):
    start = OLD_MAP[node_id]
    return {k: pose - start for k, pose in OLD_MAP.items()}


def sighting(node_id, travelled_m, off=(0.0, 0.0, 0.0), evidence=1.0):
    T_grid_place = compose(np.array([3.0, 1.0, 0.5]), compose(OLD_MAP[node_id], np.array(off)))
    match = SearchMatch(T_grid_place, np.eye(3) * 1e-4, 0.95, 0.02, 0.9, 0.7, 0.3, 0.02, 0.5)
    return Sighting(
        node_id, match, 100, T_grid_place, np.eye(3) * 1e-4, travelled_m, informs=True, evidence=evidence
    )


def test_one_sighting_is_never_enough():
    beliefs = Hypotheses(LoopConfig(), around)
    beliefs.add(sighting(3, 10.0)).heard = True
    beliefs.add(sighting(4, 10.5))  # too near to the first to count
    assert beliefs.certain() is None


def test_two_that_agree_further_on_are():
    beliefs = Hypotheses(LoopConfig(), around)
    beliefs.add(sighting(3, 10.0)).heard = True
    found = beliefs.add(sighting(5, 12.0, (0.1, -0.1, 0.02)))
    assert beliefs.certain() is found
    assert len(found.sightings) == 2


def test_not_before_the_other_places_are_heard():
    beliefs = Hypotheses(LoopConfig(), around)
    beliefs.add(sighting(3, 10.0))
    beliefs.add(sighting(5, 12.0))
    assert beliefs.certain() is None


def test_a_living_rival_holds_it_back():
    beliefs = Hypotheses(LoopConfig(), around)
    beliefs.add(sighting(3, 10.0)).heard = True
    beliefs.add(sighting(5, 12.0))
    beliefs.add(sighting(9, 12.5, (2.0, 0.0, 0.0)))
    assert len(beliefs.alive) == 2
    assert beliefs.certain() is None


def test_what_the_next_nodes_do_not_confirm_is_forgotten():
    beliefs = Hypotheses(LoopConfig(), around)
    beliefs.add(sighting(3, 10.0))
    beliefs.drop_old(10.0 + LoopConfig().forget_after_m + 0.1)
    assert beliefs.alive == []


def test_sightings_along_a_corridor_must_go_on_for_twice_the_way():
    beliefs = Hypotheses(LoopConfig(), around)
    beliefs.add(sighting(3, 10.0, evidence=0.5)).heard = True
    for k in range(1, 4):
        assert beliefs.certain() is None
        found = beliefs.add(sighting(3 + 2 * k, 10.0 + 2.0 * k, evidence=0.5))
    assert beliefs.certain() is found


def test_what_the_window_contradicts_takes_a_sighting_away():
    beliefs = Hypotheses(LoopConfig(), around)
    beliefs.add(sighting(3, 10.0)).heard = True
    found = beliefs.add(sighting(5, 12.0))
    found.rejected = 1
    assert beliefs.certain() is None
    beliefs.add(sighting(7, 14.0))
    assert beliefs.certain() is found
