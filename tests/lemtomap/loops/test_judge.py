"""What a sighting is worth: in a corridor of like rooms each place is seen again a door further on."""

from types import SimpleNamespace

import numpy as np
import pytest

from lemtomap.se2 import pose
from lemtomap.topo.loops.config import LoopConfig
from lemtomap.topo.loops.judge import Judge
from lemtomap.topo.loops.places import LocalSubmap

PITCH_M, HERE, SEEN = 10.0, 24, 26
AT = {node_id: pose(float(node_id), 0.0, 0.0) for node_id in range(41)}


def corridor():
    """Walls with a niche every ten metres and, here and there, a cupboard that no other room has."""
    xs = np.arange(-10.0, 50.0, 0.05)
    in_niche = xs % PITCH_M < 1.0
    walls = [np.column_stack([xs, np.where(in_niche, side * 1.6, side)]) for side in (-1.0, 1.0)]
    for left_m in (3.0, 13.5, 17.0, 22.0, 28.5, 36.0):
        depth = np.arange(0.5, 1.0, 0.05)
        front = np.arange(left_m, left_m + 0.8, 0.05)
        walls += [
            np.column_stack([front, np.full(len(front), 0.5)]),
            np.column_stack([0 * depth + left_m, depth]),
        ]
    return np.concatenate(walls)


WORLD = corridor()


def near(x_m):
    return WORLD[abs(WORLD[:, 0] - x_m) <= 7.0]


@pytest.fixture
def judge():
    around = {node_id: at - AT[HERE] for node_id, at in AT.items()}
    places = SimpleNamespace(
        around=lambda *_: around,
        has=lambda node_id: node_id in AT,
        company=lambda node_id: LocalSubmap(
            node_id, near(AT[node_id][0]) - AT[node_id][:2], np.empty((0, 2))
        ),
    )
    return Judge(LoopConfig(), places)


def task(slipped_m, measured=()):
    """The window says that the robot's node is where the graph has it; the walls are so much further back."""
    situation = SimpleNamespace(here_id=HERE, T_grid_here=AT[HERE], measured=measured)
    reference = SimpleNamespace(points_grid=WORLD - [slipped_m, 0.0])
    return SimpleNamespace(node_id=SEEN, situation=situation, reference=reference)


def found_at(x_m):
    return SimpleNamespace(T_grid_place=pose(x_m, 0.0, 0.0))


def test_a_room_further_on_that_only_looks_alike_is_no_sighting(judge):
    """Four hours of driving committed one: all nodes near the robot moved by 10.2 metres."""
    assert judge.is_alias(found_at(AT[SEEN][0] - PITCH_M), task(slipped_m=0.0))


@pytest.mark.parametrize("slipped_m", [1.5, 3.0, PITCH_M])
def test_a_window_that_did_slip_is_told_by_what_the_rooms_do_not_share(judge, slipped_m):
    assert not judge.is_alias(found_at(AT[SEEN][0] - slipped_m), task(slipped_m))


def test_a_place_found_where_the_graph_has_it_is_no_alias(judge):
    assert not judge.is_alias(found_at(AT[SEEN][0] + 0.2), task(slipped_m=0.0))


def test_a_robot_sure_of_its_node_searches_where_the_graph_says_so_it_needs_no_second_look(judge):
    assert not judge.is_alias(found_at(AT[SEEN][0] - PITCH_M), task(slipped_m=0.0, measured={HERE}))
