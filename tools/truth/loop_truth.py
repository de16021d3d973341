"""Where a drive really was, from relations that a person checked: the standard closures are held against.

A log's relations say exactly how a few thousand pairs of scans lie to one another; between them the window's
own track is right to some centimetres. Fitting both gives a reference pose for every node. A closure counts
as checked only where a relation ties the same two stretches of the drive together.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lemtomap.se2 import Pose, between
from lemtomap.topo.solve import Problem
from lemtomap.topo.solve.whole import solve_whole, straightened
from tools.truth.relations import nearest_stamps

RELATION_SIGMA = np.array([0.01, 0.01, 0.005])  # m, m, rad: as surely as scans can be laid over one another
STEP_FLOOR = np.array([0.005, 0.005, 0.002])
STEP_PER_M = np.array([0.02, 0.02, 0.01])  # drift of a track that was matched scan by scan
NEAR_WAY_M = 5.0  # along the track from an end of a closure to an end of a relation that vouches for it


@dataclass(frozen=True, slots=True)
class Reference:
    """Reference poses of a drive's scans, those of relations and those asked for."""

    T_map_base: dict[int, Pose]
    """By index of the scan."""
    ends_m: NDArray[np.float64]
    """float64 (R, 2): where on the way, in metres, the two scans of each relation lie."""
    way_m: NDArray[np.float64]
    """float64 (scans,): way since the first scan."""

    def off(self, a: int, b: int, T_a_b: Pose) -> Pose:
        """Return how far a claim about two scans is off, in the frame of where b really is."""
        return between(between(self.T_map_base[a], self.T_map_base[b]), T_a_b)

    def vouches(self, a: int, b: int) -> bool:
        """Return True if a relation joins the stretches of the drive around two scans."""
        wanted = np.array([self.way_m[a], self.way_m[b]])
        gaps = np.minimum(
            np.abs(self.ends_m - wanted).max(axis=1), np.abs(self.ends_m - wanted[::-1]).max(axis=1)
        )
        return bool(np.abs(wanted[0] - wanted[1]) <= NEAR_WAY_M or gaps.min(initial=np.inf) <= NEAR_WAY_M)


def nearest_scans(
    stamps_s: NDArray[np.float64], wanted_s: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return the scans of pairs of stamps, int64 (R, 2), and whether both were found, bool (R,)."""
    order = np.argsort(stamps_s, kind="stable")
    index, found = nearest_stamps(stamps_s[order], wanted_s.ravel())
    scans = np.asarray(order[index], dtype=np.int64).reshape(-1, 2)
    return scans, np.asarray(found.reshape(-1, 2).all(axis=1))


def reference(
    relations: NDArray[np.float64],
    indices: NDArray[np.int64],
    track: Pose,
    start: Pose,
    asked: NDArray[np.int64],
) -> Reference:
    """Fit relations, float64 (R, 5), whose scans are `indices`, int64 (R, 2), and the track between them.

    track: float64 (scans, 3), locally right; start: float64 (scans, 3), right to some metres everywhere.
    """
    way_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(track[:, :2], axis=0).T))])
    keys = np.unique(np.concatenate([indices.ravel(), asked]))
    slot = {int(key): k for k, key in enumerate(keys)}
    steps = np.column_stack([np.arange(len(keys) - 1), np.arange(1, len(keys))])
    tied = np.array([(slot[int(a)], slot[int(b)]) for a, b in indices], np.int64).reshape(-1, 2)
    sigma = STEP_FLOOR + np.diff(way_m[keys])[:, None] * STEP_PER_M
    sigma = np.concatenate([sigma, np.broadcast_to(RELATION_SIGMA, (len(tied), 3))])
    information = np.zeros((len(sigma), 3, 3))
    information[:, range(3), range(3)] = sigma**-2.0
    problem = Problem(
        np.concatenate([steps, tied]),
        np.concatenate([between(track[keys[:-1]], track[keys[1:]]), relations[:, 2:5]]),
        information,
        np.zeros(len(sigma)),
    )
    held = np.zeros(len(keys), dtype=bool)
    held[0] = True
    poses = solve_whole(problem, straightened(problem, start[keys], held), held).poses
    return Reference(dict(zip(keys.tolist(), poses, strict=True)), way_m[indices], way_m)
