"""A place along one wall: no pose of it is unique, but the graph knows where it should be."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from lemtomap.se2 import pose
from lemtomap.topo.loops.config import LoopConfig
from lemtomap.topo.loops.judge import Judge
from lemtomap.topo.loops.matcher import Reference, SearchBox
from lemtomap.topo.loops.places import LocalSubmap
from tests.lemtomap.loops.test_search import view_of, wall

CONFIG = LoopConfig()
OFF = pose(0.4, 0.6, 0.1)
"""Where the graph expects the place; truly it stands at the origin of the window, unturned."""
NICHE = np.concatenate(
    [
        wall(-6.5, 1.5, 1.0, 1.5),
        wall(1.0, 1.5, 1.0, 1.9),
        wall(1.0, 1.9, 2.0, 1.9),
        wall(2.0, 1.9, 2.0, 1.5),
        wall(2.0, 1.5, 6.5, 1.5),
    ]
)
PLAIN = wall(-6.5, 1.5, 6.5, 1.5)
NODE, HERE = 3, 90


def sighted(walls, sigma_m=0.5, *, measured=(HERE,), way_m=90.0, is_cut=False, expected=OFF):
    """What the judge makes of a place that a search found 1.3 m too far along its wall."""
    company = LocalSubmap(NODE, walls[abs(walls[:, 0]) <= 4.0], np.empty((0, 2)))
    judge = Judge(CONFIG, SimpleNamespace(company=lambda _: company))
    reference = Reference(view_of(walls), walls, CONFIG.match)
    sigma = np.array([sigma_m, sigma_m, 0.05])
    box = SearchBox(expected, 3.0 * sigma_m, 3.0 * sigma_m, 0.15, sigma, None, is_cut=is_cut)
    situation = SimpleNamespace(
        here_id=HERE, T_grid_here=np.zeros(3), covariance=np.eye(3) * 1e-4, travelled_m=100.0
    )
    situation.measured = set(measured)
    task = SimpleNamespace(
        node_id=NODE, situation=situation, reference=reference, box=box, way_m=way_m, on_trial=()
    )
    slid = replace(reference.refine(company.points_node, pose(1.3, 0.0, 0.0)), score=0.9, rival=0.97)
    assert not judge.is_sighting(slid, task)
    found = judge.sighted(slid, task)
    return None if found is None else judge.sighting(task, found)


def test_along_a_wall_with_a_niche_it_stands_where_the_niche_says():
    at = sighted(NICHE).match.T_grid_place
    assert np.hypot(*at[:2]) < 0.1
    assert abs(at[2]) < 0.02


def test_along_a_bare_wall_the_wall_says_how_far_off_it_is_and_the_graph_where_along():
    sighting = sighted(PLAIN)
    x, y, yaw = sighting.match.T_grid_place
    assert x == pytest.approx(OFF[0], abs=0.15)
    assert (y, yaw) == pytest.approx((0.0, 0.0), abs=0.02)
    along_m, across_m = np.sqrt(np.diag(sighting.covariance)[:2])
    assert along_m >= 0.5
    assert across_m < 0.05


def test_where_the_graph_knows_it_a_place_counts_in_full():
    assert sighted(NICHE).evidence == 1.0


@pytest.mark.parametrize(
    "lacks",
    [
        {"sigma_m": 2.5},
        {"is_cut": True},
        {"measured": ()},
        {"way_m": 5.0},
        {"expected": pose(0.0, 1.4, 0.0)},
        {"expected": pose(0.0, 0.0, 0.4)},
    ],
    ids=["graph unsure", "box cut", "own node unsure", "in the window anyway", "too far off", "turned"],
)
def test_else_a_pose_that_is_not_unique_is_no_sighting(lacks):
    assert sighted(NICHE, **lacks) is None
