"""The whole drive laid out in one frame, for export only: every scan's pose, and every node's.

While mapping, a scan's pose is relative to its node, and the robot goes from node to node as matches say.
For export the window's own smooth track is taken as odometry, cut into *stretches* in which the associated
node stands still in the window; each stretch is tied to its node as surely as the node was found in the
window, and closures join nodes. So an error of one match is spread, not jumped over. Then passes by one
place are laid over one another, scan on scans, and all is fitted once more.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lemtomap.se2 import (
    Pose,
    adjoint,
    between,
    compose,
    inverse,
)
from lemtomap.topo.file.paging import PagedGraph
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.graph import Covariance, Edge
from lemtomap.topo.kernels import poses as kernels
from lemtomap.topo.solve import Problem
from lemtomap.topo.solve.whole import solve_whole, straightened
from lemtomap.topo.whole.overlays import Overlay, Passes
from lemtomap.topo.whole.trail import ScanTrail
from lemtomap.types import EdgeType

STEP_SHARE = (
    0.1  # of the summed covariances of steps: matches of neighbouring scans to one window are not new
)
STEP_FLOOR = np.diag([1e-3, 1e-3, 5e-4]) ** 2
TIE_FLOOR = np.diag([0.01, 0.01, 0.003]) ** 2  # a match is not surer than the cells it was coded in
CLOSURE_FLOOR = np.diag([0.02, 0.02, 0.006]) ** 2
BORN = np.diag([1e-4, 1e-4, 1e-4]) ** 2  # a node's frame is where the robot was at its birth
STILL_M = 1e-4  # a node that moves less in the window from one scan to the next stands still
ROBUST_PHI = 25.0  # ties beyond five sigmas are doubted
JOINED_M, JOINED_NODES = 8.0, 400  # over edges: what the map itself brings together
OVERLAY_ROUNDS = 2  # the first fit brings passes together that were too far apart to be overlaid


@dataclass(frozen=True, slots=True)
class Smoothed:
    """Everything in the frame of the first node."""

    stamps_s: NDArray[np.float64]
    T_map_base: Pose
    """float64 (scans, 3)."""
    T_map_node: dict[int, Pose]
    """Of the nodes the drive visited."""


@dataclass(frozen=True, slots=True)
class _Link:
    source: int
    target: int
    T_source_target: Pose
    covariance: Covariance
    phi: float = 0.0


def smooth(store: TopoStore, trail: ScanTrail) -> Smoothed:
    """Lay out a drive that began with an empty map. Needs at least one scan."""
    records = np.concatenate(list(trail.records()))
    drive = _Drive.of(records)
    links = [*_track_links(records, drive.starts), *_tie_links(records, drive)]
    links += _closure_links([e for e in store.edges() if e.type is EdgeType.LOOP_CLOSING], drive.index)
    poses = _solved(links, _start(records, drive))
    passes = Passes(drive.track, list(trail.looks()), _joined_by(store, records["node_id"]))
    for _ in range(OVERLAY_ROUNDS):
        overlays = [drive.link_of(each) for each in passes.overlays(drive.scans_of(poses))]
        if not overlays:
            break
        poses = _settled([*links, *overlays], poses)
    poses = between(poses[drive.index[int(records["node_id"][0])]], poses)
    T_map_node = {node_id: poses[k] for node_id, k in drive.index.items()}
    return Smoothed(records["stamp_s"].copy(), drive.scans_of(poses), T_map_node)


@dataclass(frozen=True, slots=True)
class _Drive:
    """The drive cut into stretches, rigid pieces of the window's track; unknowns: stretches, then nodes."""

    track: Pose
    """float64 (scans, 3), the window's."""
    starts: NDArray[np.int64]
    """First scan of each stretch."""
    stretch: NDArray[np.int64]
    """int64 (scans,): which stretch a scan belongs to."""
    index: dict[int, int]
    """Which unknown a node is."""

    @classmethod
    def of(cls, records: NDArray[np.void]) -> "_Drive":
        starts = _stretches(records)
        stretch = np.zeros(len(records), np.int64)
        stretch[starts[1:]] = 1
        index = {int(n): len(starts) + k for k, n in enumerate(np.unique(records["node_id"]))}
        return cls(records["T_grid_base"], starts, np.cumsum(stretch), index)

    def scans_of(self, poses: Pose) -> Pose:
        """Return where each scan is, float64 (scans, 3), from the unknowns."""
        within = between(self.track[self.starts][self.stretch], self.track)
        return compose(poses[self.stretch], within)

    def link_of(self, overlay: Overlay) -> _Link:
        """Return what an overlay of two scans says of their stretches."""
        source, target = (int(self.stretch[scan]) for scan in (overlay.earlier, overlay.later))
        T_source_earlier = between(self.track[self.starts[source]], self.track[overlay.earlier])
        T_later_target = between(self.track[overlay.later], self.track[self.starts[target]])
        T = compose(compose(T_source_earlier, overlay.T_earlier_later), T_later_target)
        turn = adjoint(inverse(T_later_target))
        return _Link(source, target, T, turn @ overlay.covariance @ turn.T, ROBUST_PHI)


def _joined_by(store: TopoStore, node_of_scan: NDArray[np.int64]) -> Callable[[int, int], bool]:
    """Return a test whether the nodes of two scans are near one another over edges."""
    graph = PagedGraph(store)
    around: dict[int, set[int]] = {}

    def joined(a: int, b: int) -> bool:
        node_id, other_id = int(node_of_scan[a]), int(node_of_scan[b])
        if node_id not in around:
            around[node_id] = set(graph.reach(node_id, JOINED_M, JOINED_NODES))
        return other_id in around[node_id]

    return joined


def _stretches(records: NDArray[np.void]) -> NDArray[np.int64]:
    """Return the first scan of each stretch: where the node changes or moves in the window."""
    T_grid_node = compose(records["T_grid_base"], inverse(records["T_node_base"]))
    moved = np.abs(np.diff(T_grid_node[:, :2], axis=0)).max(axis=1, initial=0.0) > STILL_M
    changed = np.diff(records["node_id"]) != 0
    return np.concatenate([[0], np.flatnonzero(moved | changed) + 1])


def _track_links(records: NDArray[np.void], starts: NDArray[np.int64]) -> list[_Link]:
    """Join each stretch to the next by the window's track."""
    track, links = np.ascontiguousarray(records["T_grid_base"]), []
    steps = records["step"].astype(np.float64)
    for k in range(len(starts) - 1):
        covariance = np.zeros((3, 3))
        for m in range(starts[k] + 1, starts[k + 1] + 1):
            covariance = kernels.drifted(covariance, track[m - 1], track[m], steps[m])
        T = between(track[starts[k]], track[starts[k + 1]])
        links.append(_Link(k, k + 1, T, STEP_SHARE * covariance + STEP_FLOOR))
    return links


def _tie_links(records: NDArray[np.void], drive: _Drive) -> list[_Link]:
    """Tie each stretch to its node, unless the node was only predicted."""
    links, born = [], set()
    for k, first in enumerate(drive.starts):
        record = records[first]
        node_id = int(record["node_id"])
        is_birth = node_id not in born
        born.add(node_id)
        tie = BORN if is_birth else record["tie"].astype(np.float64) + TIE_FLOOR
        if np.isfinite(tie).all():
            T_base_node = inverse(record["T_node_base"])
            links.append(_Link(k, drive.index[node_id], T_base_node, tie, 0.0 if is_birth else ROBUST_PHI))
    return links


def _closure_links(edges: list[Edge], index: dict[int, int]) -> list[_Link]:
    return [
        _Link(
            index[e.source_id],
            index[e.target_id],
            e.T_source_target,
            e.covariance + CLOSURE_FLOOR,
            ROBUST_PHI,
        )
        for e in edges
        if e.source_id in index and e.target_id in index
    ]


def _start(records: NDArray[np.void], drive: _Drive) -> Pose:
    """Return where everything is by the window's track alone."""
    starts, index = drive.starts, drive.index
    poses = np.zeros((len(starts) + len(index), 3))
    poses[: len(starts)] = records["T_grid_base"][starts]
    for first in starts[::-1]:
        record = records[first]
        poses[index[int(record["node_id"])]] = compose(record["T_grid_base"], inverse(record["T_node_base"]))
    return poses


def _solved(links: list[_Link], start: Pose) -> Pose:
    """Fit all links; then once more from there, doubting what the rest contradicts.

    Doubting from the start would throw out every true closure of a loop that has drifted.
    """
    problem = _problem(links)
    held = _first_held(start)
    return _settled(links, solve_whole(problem, straightened(problem, start, held), held).poses)


def _settled(links: list[_Link], poses: Pose) -> Pose:
    """Fit all links from near the answer, doubting what the rest contradicts."""
    problem = replace(_problem(links), phi=np.array([link.phi for link in links]))
    return solve_whole(problem, poses, _first_held(poses)).poses


def _problem(links: list[_Link]) -> Problem:
    return Problem(
        np.array([(link.source, link.target) for link in links], np.int64).reshape(-1, 2),
        np.array([link.T_source_target for link in links], np.float64).reshape(-1, 3),
        np.linalg.inv(np.array([link.covariance for link in links]).reshape(-1, 3, 3)).astype(np.float64),
        np.zeros(len(links)),
    )


def _first_held(poses: Pose) -> NDArray[np.bool_]:
    held = np.zeros(len(poses), dtype=bool)
    held[0] = True
    return held
