"""Which near-neighbour edges a node gets, by what is known of the other's place."""

from types import SimpleNamespace

import numpy as np
import pytest

from lemtomap.se2 import pose
from lemtomap.topo.config import TopoConfig
from lemtomap.topo.local import NodePoseEstimate
from lemtomap.topo.neighbours import NeighbourFinder
from tests.lemtomap.topo.drive import room

HERE, THERE = 1, 2
GRAPH = SimpleNamespace(
    node=lambda _node_id: SimpleNamespace(level=0),
    edge_between=lambda _a, _b: None,
    edges_of=lambda _node_id: (),
)


def seams(sigma_m, way_m=24.0, walls=()):
    """Seams of a node to another 0.3 m beside it, known to sigma_m and so far along the edges."""
    doubt = np.diag([sigma_m**2, 0.01, 0.01])
    standings = {
        HERE: NodePoseEstimate(pose(0.0, 0.0, 0.0), 1e-4 * np.eye(3), anchored=True, born=True),
        THERE: NodePoseEstimate(pose(0.3, 0.0, 0.0), doubt, anchored=False),
    }
    reached = {HERE: SimpleNamespace(distance_m=0.0), THERE: SimpleNamespace(distance_m=way_m)}
    local = SimpleNamespace(standings=standings, reached=reached)
    return list(NeighbourFinder(TopoConfig()).seams_at(HERE, GRAPH, local, room(walls=walls)))


@pytest.mark.parametrize(
    ("sigma_m", "wall_m", "count"), [(0.4, 0.5, 1), (0.8, 0.9, 0), (0.8, 1.6, 1), (1.6, 9.0, 0)]
)
def test_a_seam_leads_nowhere_near_a_wall_that_the_other_node_may_stand_behind(sigma_m, wall_m, count):
    assert len(seams(sigma_m, walls=[(-9.0, wall_m, 9.0, wall_m + 0.1)])) == count


def test_a_seam_holds_its_doubt_and_tells_the_solve_nothing():
    (seam,) = seams(0.8)
    assert seam.share == 0.0
    assert np.sqrt(seam.covariance[0, 0]) == pytest.approx(0.8, abs=0.05)


def test_a_node_near_along_the_edges_needs_no_seam():
    assert not seams(0.4, way_m=7.0)
