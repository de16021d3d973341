"""The whole drive laid out in one frame, for export only: every scan's pose, and every node's.

While mapping, a scan's pose is relative to its node, and the robot goes from node to node as matches say.
For export the window's own smooth track is taken as odometry, cut into *stretches* in which the associated
node stands still in the window; each stretch is tied to its node as surely as the node was found in the
window, and closures join nodes. So an error of one match is spread, not jumped over.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lemtomap.se2 import Pose, adjoint, between, compose, inverse
from lemtomap.topo.graph import Covariance, Edge, chain_covariance
from lemtomap.topo.solve import Problem, solve_whole, straightened
from lemtomap.topo.store import TopoStore
from lemtomap.topo.trail import ScanTrail
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
    track = records["T_grid_base"]
    starts = _stretches(records)
    stretch = np.zeros(len(records), np.int64)
    stretch[starts[1:]] = 1
    stretch = np.cumsum(stretch)
    node_ids = np.unique(records["node_id"])
    index = {int(node_id): len(starts) + k for k, node_id in enumerate(node_ids)}
    links = [*_track_links(records, starts), *_tie_links(records, starts, index)]
    links += _closure_links([e for e in store.edges() if e.type is EdgeType.LOOP_CLOSING], index)
    poses = _solved(links, _start(records, starts, index))
    poses = between(poses[index[int(records["node_id"][0])]], poses)
    T_map_base = compose(poses[stretch], between(track[starts][stretch], track))
    return Smoothed(records["stamp_s"].copy(), T_map_base, {n: poses[k] for n, k in index.items()})


def _stretches(records: NDArray[np.void]) -> NDArray[np.int64]:
    """Return the first scan of each stretch: where the node changes or moves in the window."""
    T_grid_node = compose(records["T_grid_base"], inverse(records["T_node_base"]))
    moved = np.abs(np.diff(T_grid_node[:, :2], axis=0)).max(axis=1, initial=0.0) > STILL_M
    changed = np.diff(records["node_id"]) != 0
    return np.concatenate([[0], np.flatnonzero(moved | changed) + 1])


def _track_links(records: NDArray[np.void], starts: NDArray[np.int64]) -> list[_Link]:
    """Join each stretch to the next by the window's track."""
    track, links = records["T_grid_base"], []
    for k in range(len(starts) - 1):
        covariance = np.zeros((3, 3))
        for m in range(starts[k] + 1, starts[k + 1] + 1):
            step = between(track[m - 1], track[m])
            turn = adjoint(np.array([0.0, 0.0, -step[2]]))
            covariance = chain_covariance(covariance, step, turn @ records["step"][m] @ turn.T)
        T = between(track[starts[k]], track[starts[k + 1]])
        links.append(_Link(k, k + 1, T, STEP_SHARE * covariance + STEP_FLOOR))
    return links


def _tie_links(records: NDArray[np.void], starts: NDArray[np.int64], index: dict[int, int]) -> list[_Link]:
    """Tie each stretch to its node, unless the node was only predicted."""
    links, born = [], set()
    for k, first in enumerate(starts):
        record = records[first]
        node_id = int(record["node_id"])
        is_birth = node_id not in born
        born.add(node_id)
        tie = BORN if is_birth else record["tie"].astype(np.float64) + TIE_FLOOR
        if np.isfinite(tie).all():
            T_base_node = inverse(record["T_node_base"])
            links.append(_Link(k, index[node_id], T_base_node, tie, 0.0 if is_birth else ROBUST_PHI))
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


def _start(records: NDArray[np.void], starts: NDArray[np.int64], index: dict[int, int]) -> Pose:
    """Return where everything is by the window's track alone."""
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
    problem = Problem(
        np.array([(link.source, link.target) for link in links], np.int64).reshape(-1, 2),
        np.array([link.T_source_target for link in links], np.float64).reshape(-1, 3),
        np.linalg.inv(np.array([link.covariance for link in links]).reshape(-1, 3, 3)).astype(np.float64),
        np.zeros(len(links)),
    )
    held = np.zeros(len(start), dtype=bool)
    held[0] = True
    poses = solve_whole(problem, straightened(problem, start, held), held).poses
    return solve_whole(replace(problem, phi=np.array([link.phi for link in links])), poses, held).poses
