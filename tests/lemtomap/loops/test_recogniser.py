"""What comes of a closure in the mapper."""

import numpy as np
import pytest

from lemtomap.se2 import between, compose, pose
from lemtomap.topo.config import TopoConfig
from lemtomap.topo.loops import LoopRecogniser
from lemtomap.topo.loops.cases import Closure
from lemtomap.topo.loops.closer import LoopCloser
from lemtomap.topo.loops.matcher import Match
from lemtomap.topo.mapper import TopoMapper
from lemtomap.topo.store import TopoStore
from lemtomap.types import EdgeType
from tests.lemtomap.topo.drive import lead, room

SURE = np.diag([1e-4, 1e-4, 1e-5])
GRID = room(40.0, origin_m=(-20, -20))


@pytest.fixture
def unsure(tmp_path):
    """A robot that came back along its way and is no longer sure where its associated node stands."""
    recogniser = LoopRecogniser()
    store = TopoStore.create(tmp_path / "m.lemto", durable=False)
    mapper = TopoMapper(TopoConfig(local_radius_m=20.0), store, recogniser=recogniser)
    stamp = lead(mapper, [(-9, -9), (9, -9), (9, 9), (-9, 9), (-9, 4.8)], GRID)
    yield mapper, recogniser, stamp
    mapper.close()


def closure(mapper, node_id, T_base_node):
    here_id, T_grid_base = mapper.associated_id, mapper.now[0].T_grid_base
    T_grid_node = compose(T_grid_base, T_base_node)
    T_here_node = between(mapper.local.standings[here_id].T_grid_node, T_grid_node)
    match = Match(T_grid_node, SURE, *([1.0] * (len(Match.__dataclass_fields__) - 2)))
    return Closure(here_id, node_id, T_here_node, SURE, T_grid_node, match, informs=True, evidence=1.0)


@pytest.mark.parametrize(("gap_m", "stands_there"), [(0.4, True), (4.0, False)])
def test_a_robot_stands_at_a_place_found_again_only_when_it_is_there(
    unsure, monkeypatch, gap_m, stands_there
):
    """Else the next odometry edge would begin far off, across walls that nobody has driven through."""
    mapper, recogniser, stamp = unsure
    here = mapper.associated_id
    found = [closure(mapper, 20, pose(gap_m, 0.0, 0.0))]
    monkeypatch.setattr(LoopCloser, "update", lambda _: [found.pop()] if found else [])
    monkeypatch.setattr(recogniser, "_stands", lambda *_: False)
    recogniser.update(mapper)
    assert mapper.associated_id == (20 if stands_there else here)
    lead(mapper, [(-9, 4.7), (-9, 1.0)], GRID, start_s=stamp)
    driven = [edge.length_m for edge in mapper.store.edges() if edge.type is EdgeType.ODOMETRY]
    assert max(driven) < 1.5
