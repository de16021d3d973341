"""Local grid map transform (thesis, section 3-3-2): align a node's localisation data with the window.

In 2014 this came from ground truth. Here: a coarse search as wide as the graph's prediction is uncertain,
then point-to-line Gauss-Newton with the prediction as prior, so that what the boundary cannot tell (the way
along a corridor) follows the graph; then a gate on how much of what should be seen is seen.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lemtomap.se2 import (
    Pose,
    adjoint,
    between,
    wrap_angle,
)
from lemtomap.settings import within
from lemtomap.topo.graph import Covariance
from lemtomap.topo.kernels import align as kernels
from lemtomap.topo.kernels import lines
from lemtomap.topo.place import Boundary
from lemtomap.types import GridView


@dataclass(frozen=True, slots=True)
class AlignConfig:
    """What a match must show to be believed."""

    least_points: int = within(40, 3, 1000)  # boundary points the window must know about
    least_share: float = within(0.3, 0.01, 1.0)  # and the share of the place's points these must be
    least_score: float = within(0.6, 0.1, 1.0)  # share of them that has a hit within `near_m`
    near_m: float = within(0.12, 0.02, 0.4)  # two coding cells' half widths
    occupied_from: int = within(50, 1, 100)  # occupancy of GridView that counts as a wall
    gate_sigmas: float = within(4.0, 1.0, 20.0)  # from the prediction, Mahalanobis
    sigma_m: float = within(0.05, 0.005, 0.5)  # scatter of boundary points about hits: half a coding cell
    coarse_sigma_m: float = within(0.15, 0.01, 1.0)  # for the search: as wide as its step
    usual_fit: float = within(0.9, 0.1, 1.0)
    """Of what is seen, in the search; unseen ground speaks neither for a pose nor against."""
    bend_m: float = within(0.006, 1e-4, 0.1)
    """No match is surer, however many points: windows and places are a little bent."""
    bend_rad: float = within(0.007, 1e-4, 0.1)
    weak_axis: float = within(0.06, 0.0, 1.0)
    """A direction with less of the strongest one's information tells nothing."""
    points_per_look: float = within(8.0, 1.0, 100.0)
    """Neighbouring points err together; so many count as one."""
    apart_m: float = within(0.35, 0.05, 2.0)  # poses further apart than this are rivals in the search
    rival_share: float = within(0.93, 0.1, 1.0)
    """A rival with this share of the best fit makes the search undecided."""
    max_search_m: float = within(1.0, 0.05, 2.0)  # wider than this it is loop closing's business
    max_search_rad: float = within(0.25, 0.02, 1.6)


@dataclass(frozen=True, slots=True)
class PlaceMatch:
    """Where the place stands in the window, or why that is not known."""

    T_grid_node: Pose
    covariance: Covariance
    """float64 (3, 3), axes of the node, the prediction's information included."""
    score: float
    """Share of what the window knows of the place that fits, 0..1."""
    refused: str = ""
    """Why the match is not believed; empty when it is."""


FIELD_REACH_M = 2.0  # twice the widest search: what lies that far in front of a point still hides it
NEAR_REACH_M = 0.4  # a point further from all hits is matched to none
FIELD_CELL_M = 0.05
LINE_REACH_M = 0.2  # neighbourhood a wall's direction is taken from
ITERATIONS = 15


@dataclass(frozen=True, slots=True)
class _Field:
    targets: NDArray[np.float64]
    lines: NDArray[np.float64]
    """Of the wall each target lies on, float64 (T, 3): normal, and how straight it is."""
    nearest: NDArray[np.int32]
    seen: NDArray[np.int8]
    """1 where the window has seen anything, cell by cell of the field."""
    low: tuple[float, float]

    @property
    def plan(self) -> tuple[NDArray[np.float64], NDArray[np.int32], float, float, float]:
        return self.targets, self.nearest, self.low[0], self.low[1], FIELD_CELL_M

    @property
    def surface(
        self,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int32], float, float, float]:
        return self.targets, self.lines, self.nearest, self.low[0], self.low[1], FIELD_CELL_M

    @property
    def ground(self) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.int8], float, float, float]:
        return self.targets, self.nearest, self.seen, self.low[0], self.low[1], FIELD_CELL_M


def match_place(
    boundary: Boundary,
    hits_grid: NDArray[np.float64],
    grid: GridView,
    predicted: tuple[Pose, Covariance],
    config: AlignConfig,
) -> PlaceMatch:
    """Align a place with hits, float64 (N, 2), metres, grid frame; two more columns: whence each was seen.

    `predicted` is T_grid_node and its covariance, float64 (3, 3) in axes of the node. Holds: a refused match
    returns exactly the prediction.
    """
    start, covariance = predicted
    if len(boundary.points) < config.least_points or len(hits_grid) < config.least_points:
        return PlaceMatch(start, covariance, 0.0, "too little to match")
    field = _field(hits_grid, grid, start, boundary.radius_m + 1.0)
    coarse = _searched(boundary, field, start, covariance, config)
    T_grid_node, posterior = _refined(boundary, field, coarse, predicted, config)
    window = (grid.occupancy, grid.resolution_m, *grid.origin_m)
    known, near = kernels.explained(
        boundary.points, *field.plan, T_grid_node, config.near_m, *window, config.occupied_from
    )
    score = near / max(1, known)
    refused = _doubts(between(start, T_grid_node), covariance, known, score, len(boundary.points), config)
    if refused:
        return PlaceMatch(start, covariance, score, refused)
    return PlaceMatch(T_grid_node, posterior, score)


def _field(targets: NDArray[np.float64], grid: GridView, centre: Pose, half_m: float) -> _Field:
    faces = np.zeros((len(targets), 4))
    faces[:, : targets.shape[1]] = targets
    low = (float(centre[0] - half_m), float(centre[1] - half_m))
    size = round(2.0 * half_m / FIELD_CELL_M)
    nearest = kernels.nearest_field(faces, *low, FIELD_CELL_M, size, FIELD_REACH_M)
    window = (grid.occupancy, grid.resolution_m, *grid.origin_m)
    seen = kernels.seen_cells(*window, *low, FIELD_CELL_M, size)
    return _Field(faces, lines.line_normals(faces[:, :2], LINE_REACH_M), nearest, seen, low)


def _searched(
    boundary: Boundary, field: _Field, start: Pose, covariance: Covariance, config: AlignConfig
) -> Pose:
    """Return the best start for the refinement within the prediction's three sigmas.

    Where several places look alike (along a corridor) the prediction is the start.
    """
    half_m = min(3.0 * float(np.sqrt(np.linalg.eigvalsh(covariance[:2, :2])[-1])), config.max_search_m)
    half_rad = min(3.0 * float(np.sqrt(covariance[2, 2])), config.max_search_rad)
    step_m, step_rad = 0.1, 0.04  # a boundary point 5 m away moves 0.2 m: twice the step, within the field
    if half_m < step_m and half_rad < step_rad:
        return start
    extent = (half_m, step_m, half_rad, step_rad)
    best = kernels.search(
        boundary.points,
        boundary.fronts,
        boundary.normals,
        *field.ground,
        start,
        *extent,
        config.coarse_sigma_m,
        config.usual_fit,
        config.apart_m,
    )
    ambiguous = best[4] > config.rival_share * best[3]
    return start if ambiguous else np.array(best[:3])


def _refined(
    boundary: Boundary,
    field: _Field,
    start: Pose,
    predicted: tuple[Pose, Covariance],
    config: AlignConfig,
) -> tuple[Pose, Covariance]:
    """Return the pose of least error and its covariance in axes of the node."""
    prior_pose, prior_covariance = predicted
    turn = adjoint(np.array([0.0, 0.0, prior_pose[2]]))
    prior = np.linalg.inv(turn @ prior_covariance @ turn.T)
    pose = np.array(start, dtype=np.float64)
    stiff = np.diag([config.bend_m**-2.0, config.bend_m**-2.0, config.bend_rad**-2.0])
    for _ in range(ITERATIONS):
        seen, g, weight, error = kernels.refine_system(
            boundary.points,
            boundary.fronts,
            boundary.normals,
            boundary.straightness,
            *field.surface,
            pose=pose,
            sigma=config.sigma_m,
            reach=NEAR_REACH_M,
        )
        scatter_sq = max(error / max(weight, 1.0), (0.4 * config.sigma_m) ** 2) * config.points_per_look
        unseen, sees = _axes(seen, config.weak_axis)
        seen, g = sees.T @ seen @ sees / scatter_sq, sees.T @ g / scatter_sq
        bent = sees.T @ stiff @ sees @ np.linalg.inv(seen + sees.T @ stiff @ sees)
        off = pose - prior_pose
        off[2] = wrap_angle(off[2])
        H = bent @ seen + sees.T @ prior @ sees
        step = sees @ np.linalg.solve(H, bent @ g + sees.T @ prior @ (off - unseen @ (unseen.T @ off)))
        step += unseen @ (unseen.T @ off)
        pose = pose - step
        if float(np.max(np.abs(step))) < 1e-5:
            break
    turn = adjoint(np.array([0.0, 0.0, -pose[2]]))
    pose[2] = wrap_angle(pose[2])
    follows = unseen - sees @ np.linalg.solve(H, sees.T @ prior @ unseen)
    posterior = sees @ np.linalg.inv(H) @ sees.T
    posterior += follows @ (unseen.T @ np.linalg.inv(prior) @ unseen) @ follows.T
    return pose, np.asarray(turn @ posterior @ turn.T)


def _axes(information: Covariance, weak_axis: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return what the boundary does not tell, float64 (3, 0) or (3, 1): the way along a corridor; and the
    rest of the axes.

    Walls are never quite straight, so a corridor seems to say a little about the way along it; it does not
    (thesis, appendix D). The prediction stands there untouched: it is so much less sure along than across
    that else a centimetre across, with walls a degree askew, would slide the place decimetres along.
    """
    values, axes = np.linalg.eigh(information[:2, :2])
    turned = np.eye(3)
    turned[:2, :2] = axes
    unseen = 1 if values[0] < weak_axis * values[1] else 0
    return turned[:, :unseen], turned[:, unseen:]


def _doubts(
    moved: Pose, covariance: Covariance, known: int, score: float, points: int, config: AlignConfig
) -> str:
    if known < max(config.least_points, config.least_share * points):
        return "the window knows too little of the place"
    if score < config.least_score:
        return f"only {score:.0%} of the place is seen"
    if float(moved @ np.linalg.solve(covariance, moved)) > config.gate_sigmas**2:
        return "too far from where the graph expects it"
    return ""
