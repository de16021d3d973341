"""Committed closures stay on trial."""

import numpy as np
import pytest

from lemtomap.se2 import pose
from lemtomap.topo.config import TopoConfig
from lemtomap.topo.file.paging import PagedGraph
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.graph import Edge
from lemtomap.topo.loops import LoopRecogniser
from lemtomap.topo.loops.audit import Audit
from lemtomap.topo.loops.config import AuditConfig, GateConfig
from lemtomap.topo.mapper import TopoMapper
from lemtomap.types import EdgeType
from tests.lemtomap.topo.drive import lead, room

NODES = 30
SURE = np.diag([0.03, 0.03, 0.01]) ** 2


@pytest.fixture
def line(tmp_path):
    """Thirty nodes in a line, a metre apart; each step is 20 cm unsure."""
    store = TopoStore.create(tmp_path / "m.lemto", durable=False)
    graph = PagedGraph(store)
    for node_id in range(1, NODES + 1):
        graph.add_node()
        if node_id > 1:
            unsure = np.diag([0.2, 0.2, 0.002]) ** 2
            graph.add_edge(Edge(0, node_id - 1, node_id, pose(1, 0, 0), unsure, EdgeType.ODOMETRY))
    yield graph
    store.close()


def closure(graph, source_id, target_id, off_m):
    T = pose(target_id - source_id + off_m, 0, 0)
    return graph.add_edge(Edge(0, source_id, target_id, T, SURE, EdgeType.LOOP_CLOSING))


def verdicts(audit):
    for _ in range(100):
        audit.advance(5)
    return [edge for trial in audit.lost() for edge in trial.edges]


@pytest.fixture
def audit(line):
    return Audit(line, AuditConfig(), GateConfig())


@pytest.mark.parametrize(("off_m", "is_lost"), [(1.5, False), (20.0, True)])
def test_a_closure_must_agree_with_the_way_round_as_far_as_that_is_sure(line, audit, off_m, is_lost):
    edge = closure(line, NODES, 1, off_m)
    audit.commit([edge], support=2.0)
    assert verdicts(audit) == ([edge] if is_lost else [])


def test_of_two_that_contradict_each_other_the_less_seen_goes(line, audit):
    well_seen, once_seen = closure(line, NODES, 1, 0.0), closure(line, NODES - 1, 2, 4.0)
    audit.commit([well_seen], support=4.0)
    audit.commit([once_seen], support=1.0)
    assert verdicts(audit) == [once_seen]
    line.delete_edge(once_seen)
    assert verdicts(audit) == []


def test_a_closure_that_somebody_put_in_needs_two_witnesses_against_it_and_a_proven_one_more(line, audit):
    edge = closure(line, NODES, 1, 0.5)
    audit.notice(line.edges_of(1))
    (trial,) = audit.crossed(line.reach(1, 40.0, 50), NODES)
    audit.hear([trial], agrees=False)
    assert verdicts(audit) == []
    audit.hear([trial], agrees=True)
    audit.hear([trial], agrees=False)
    assert verdicts(audit) == [edge]
    audit.commit([edge], support=3.0)
    (trial,) = audit.crossed(line.reach(1, 40.0, 50), NODES)
    audit.hear([trial, trial], agrees=False)
    assert verdicts(audit) == []


def test_a_false_closure_is_taken_back_on_the_drive_and_leaves_the_map_as_it_was(tmp_path):
    mapper = TopoMapper(
        TopoConfig(local_radius_m=20.0), TopoStore.create(tmp_path / "m.lemto"), recogniser=LoopRecogniser()
    )
    grid = room(40.0, origin_m=(-20, -20))
    stamp = lead(mapper, [(-9, -9), (9, -9), (9, 9), (-9, 9), (-9, 4.8)], grid)
    nodes, here = mapper.store.count("node"), mapper.associated_id
    edges = {edge.edge_id for edge in mapper.store.edges()}
    false = mapper.close_loop(here, 20, pose(0.5, 0.5, 1.0), SURE)
    lead(mapper, [(-9, 4.8), (-9, 4.5)], grid, start_s=stamp)
    assert mapper.store.edge(false.edge_id) is None
    assert {edge.edge_id for edge in mapper.store.edges()} == edges
    assert mapper.store.count("node") == nodes
    assert mapper.associated_id == here
    mapper.close()
