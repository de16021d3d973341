"""The export of a whole drive: a loop with drift, closed."""

import numpy as np

from lemtomap.se2 import between, compose
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.graph import Edge
from lemtomap.topo.whole.smooth import smooth
from lemtomap.topo.whole.trail import ScanTrail
from lemtomap.types import EdgeType, SlamUpdate

STEP = np.array([0.5, 0.0, np.pi / 40])
BENT = np.array([0.5, 0.0, np.pi / 40 * 1.02])  # the window turns 2 % too far
SCANS = 81


def update(k, T_grid_base):
    sure = np.diag([0.01, 0.01, 0.01]) ** 2
    return SlamUpdate(float(k), T_grid_base, np.zeros(3), sure, sure, 1.0, 1.0, matched=True, integrated=True)


def drive(tmp_path):
    """Twice round nothing: a circle of 80 scans with a node at every second one."""
    store, trail = TopoStore.create(tmp_path / "m.lemto", durable=False), ScanTrail.temporary()
    truth, track, node = np.zeros(3), np.zeros(3), 0
    T_grid_node, poses = np.zeros(3), []
    for k in range(SCANS):
        if k % 2 == 0:
            node, T_grid_node = store.add_node().node_id, track
        trail.append(update(k, track), node, between(T_grid_node, track), np.diag([1e-4] * 3))
        poses.append(truth)
        truth, track = compose(truth, STEP), compose(track, BENT)
    return store, trail, np.array(poses)


def error_m(smoothed, truth):
    return np.hypot(*(smoothed.T_map_base - truth)[:, :2].T)


def test_a_closure_takes_the_drift_out_of_every_scan(tmp_path):
    store, trail, truth = drive(tmp_path)
    with store:
        open_m = error_m(smooth(store, trail), truth).max()
        exact = np.diag([1e-4, 1e-4, 1e-5])
        store.add_edge(Edge(0, 41, 1, np.zeros(3), exact, EdgeType.LOOP_CLOSING))
        closed = smooth(store, trail)
    assert open_m > 0.5
    assert error_m(closed, truth).max() < 0.1 * open_m
    assert len(closed.stamps_s) == SCANS
    assert set(closed.T_map_node) == set(range(1, 42))


def test_without_closures_the_track_stays_as_it_was(tmp_path):
    store, trail, _ = drive(tmp_path)
    with store:
        records = np.concatenate(list(trail.records()))
        assert np.allclose(smooth(store, trail).T_map_base, records["T_grid_base"], atol=1e-6)
