"""Passes by one place laid over one another, scan on scans: the last fit of an export, never used driving.

The map's own data ties a pass to a node within some centimetres; the scans themselves know better. A scan of
a later pass is aligned with what an earlier one saw around the same spot, joined by the window's track, which
is right over so short a way (Lu and Milios 1997, with the window in the place of the single scan).
"""

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lemtomap.se2 import Pose, between
from lemtomap.topo.cells import averaged, thinned
from lemtomap.topo.graph import Covariance, sure_of
from lemtomap.topo.kernels import fitting, lines
from lemtomap.topo.whole.trail import TrailScan

Points = NDArray[np.float64]

APART_M = 10.0  # of way: nearer scans were matched to one window already
LOOK_EVERY_M = 0.7  # of way: scans that are laid over others
VIEW_EVERY_M = 1.5  # of way: views they are laid over
MEET_M = 2.5  # between the two: they see mostly the same
MOST_PASSES = 2  # that one scan is laid over
PASS_M = 5.0  # of way between two views that count as different passes
VIEW_SPAN_M = 2.0  # of way to either side that a view joins
LOOK_SPAN_M = 1.0  # ... and a look: its neighbours have gaps elsewhere
VIEW_RADIUS_M = 12.0
CELL_M = 0.05  # hits of a view are averaged in cells as fine as the window's
THIN_M = 0.1  # ... and those of a look thinned
FIELD_M = 0.1  # cell of the look-up of nearest hits
REACH_M = 0.5  # of the look-up, and ...
FIRST_GATE_M = 0.48  # ... of the alignment, before the first fit and ...
GATE_M = 0.3  # ... after it
LINE_M = 0.25  # neighbourhood a wall's direction is taken from
SCALE_M = 0.05  # of the robust weight: one window cell
ROUNDS = 15
POINT_SIGMA_M = 0.03  # of one averaged hit across its wall
CORRELATION = 12.0  # neighbouring hits err together: information is divided by this
FLOOR = np.diag([0.01, 0.01, 0.004]) ** 2  # no alignment is surer
WEAK_AXIS = 0.03  # whole scans over whole scans tell more of the way along a corridor than places do
LEAST_SHARE = 0.6  # of a look's hits that must find a wall
MOST_RESIDUAL_M = 0.06
MOST_SHIFT_M = 0.8  # further off it was another place


@dataclass(frozen=True, slots=True)
class Overlay:
    """Where a later scan lies relative to an earlier one."""

    earlier: int
    later: int
    T_earlier_later: Pose
    covariance: Covariance
    """float64 (3, 3), axes of the later."""


class Passes:
    """All looks of a drive along the window's track, float64 (scans, 3).

    `joined` tells whether the map itself brings two scans together, a short way over edges apart: passes that
    only seem to meet, because a loop is still open, must not be overlaid.
    """

    def __init__(self, track: Pose, looks: Sequence[TrailScan], joined: Callable[[int, int], bool]) -> None:
        self._hits_base = np.concatenate([look.hits_base for look in looks] or [np.empty((0, 2), np.float32)])
        self._first = np.cumsum([0, *(len(look.hits_base) for look in looks)])
        """Where each look's hits begin."""
        self._are_joined = joined
        self._scans = np.array([look.scan for look in looks], dtype=np.int64)
        way_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(track[:, :2], axis=0).T))])
        self._way_m = way_m[self._scans]
        self._track = track[self._scans]
        self._later = _every(self._way_m, LOOK_EVERY_M)
        self._earlier = _every(self._way_m, VIEW_EVERY_M)
        self._found: dict[tuple[int, int], Overlay] = {}
        self._gate_m = FIRST_GATE_M

    def overlays(self, T_map_base: Pose) -> list[Overlay]:
        """Return all overlays that hold where the drive is thought to have been, float64 (scans, 3).

        Call again after a fit: only what did not hold before is tried again.
        """
        poses = T_map_base[self._scans]
        wanted: defaultdict[int, list[int]] = defaultdict(list)
        for later, earlier in self._meetings(poses):
            if (earlier, later) not in self._found:
                wanted[earlier].append(later)
        for earlier, laters in wanted.items():
            view = _View(self._joined(earlier, VIEW_SPAN_M))
            for later in laters:
                self._try(view, earlier, later, between(poses[earlier], poses[later]))
        self._gate_m = GATE_M
        return list(self._found.values())

    def _meetings(self, poses: Pose) -> list[tuple[int, int]]:
        """Return (later, earlier) looks near one another, those of the nearest passes."""
        views = self._earlier
        tree = cKDTree(poses[views, :2])
        pairs = []
        for later in self._later:
            near = views[tree.query_ball_point(poses[later, :2], MEET_M)]
            near = near[self._way_m[later] - self._way_m[near] > APART_M]
            gaps = np.hypot(*(poses[near, :2] - poses[later, :2]).T)
            chosen: list[int] = []
            for earlier in near[np.argsort(gaps, kind="stable")].tolist():
                if len(chosen) == MOST_PASSES:
                    break
                other_pass = all(abs(self._way_m[earlier] - self._way_m[k]) > PASS_M for k in chosen)
                if other_pass and self._are_joined(int(self._scans[earlier]), int(self._scans[later])):
                    chosen.append(earlier)
            pairs += [(int(later), earlier) for earlier in chosen]
        return pairs

    def _joined(self, at: int, span_m: float) -> Points:
        """Return the hits of a look and those around it, in the frame of its base."""
        low, high = np.searchsorted(self._way_m, self._way_m[at] + np.array([-span_m, span_m]))
        T_at = between(self._track[at], self._track[low:high])
        x, y, yaw = np.repeat(T_at, np.diff(self._first[low : high + 1]), axis=0).T
        hits = self._hits_base[self._first[low] : self._first[high]].astype(float)
        cos, sin = np.cos(yaw), np.sin(yaw)
        return np.column_stack(
            [x + cos * hits[:, 0] - sin * hits[:, 1], y + sin * hits[:, 0] + cos * hits[:, 1]]
        )

    def _try(self, view: "_View", earlier: int, later: int, T_view_look: Pose) -> None:
        points = thinned(self._joined(later, LOOK_SPAN_M), THIN_M)
        found, info, used, residual_m = view.align(points, T_view_look, self._gate_m)
        shift = between(T_view_look, found)
        if (
            used >= LEAST_SHARE * len(points)
            and residual_m <= MOST_RESIDUAL_M
            and np.hypot(shift[0], shift[1]) <= MOST_SHIFT_M
        ):
            cos, sin = np.cos(found[2]), np.sin(found[2])
            turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
            variance = max(POINT_SIGMA_M, residual_m) ** 2 * CORRELATION
            covariance = sure_of(turn.T @ info @ turn / variance, weak_axis=WEAK_AXIS) + FLOOR
            scans = int(self._scans[earlier]), int(self._scans[later])
            self._found[earlier, later] = Overlay(*scans, found, covariance)


class _View:
    """What one pass saw around a spot, ready to be aligned with."""

    def __init__(self, hits: Points) -> None:
        hits = hits[np.abs(hits).max(axis=1) < VIEW_RADIUS_M]
        self._targets = averaged(hits, CELL_M)
        self._normals = lines.line_normals(self._targets, LINE_M)
        self._low_m = -VIEW_RADIUS_M - REACH_M
        cells = round(-2.0 * self._low_m / FIELD_M)
        in_cells = (self._targets - self._low_m) / FIELD_M
        self._index = fitting.nearest_index(in_cells, cells, cells, REACH_M / FIELD_M)

    def align(
        self, points: Points, T_view_look: Pose, gate_m: float
    ) -> tuple[Pose, NDArray[np.float64], int, float]:
        """Return the aligned pose, its information in the view's axes, hits used, and their residual."""
        low_m = self._low_m
        return fitting.align(
            points,
            self._targets,
            self._normals,
            self._index,
            low_m,
            low_m,
            FIELD_M,
            np.asarray(T_view_look),
            gate_m,
            SCALE_M,
            ROUNDS,
        )


def _every(way_m: NDArray[np.float64], step_m: float) -> NDArray[np.int64]:
    """Return the looks at which the way has grown by a step."""
    chosen, last_m = [], -np.inf
    for k, at_m in enumerate(way_m.tolist()):
        if at_m - last_m >= step_m:
            chosen.append(k)
            last_m = at_m
    return np.array(chosen, dtype=np.int64)
