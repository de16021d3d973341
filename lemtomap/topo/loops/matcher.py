"""Where a stored place lies in the window: exact correlative search, then alignment to a fraction of a cell.

The window is the reference: its pyramid is built once and every candidate place is searched in it. The search
is branch and bound over translation and turn together, best block first, so the first pose found is the best
of the whole box, and going on gives the runner-up that tells how unique it is (Olson 2009, Hess et al. 2016).
"""

from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from lemtomap.se2 import (
    Pose,
    inverse,
    pose,
    transform,
    wrap_angle,
)
from lemtomap.topo.graph import sure_of
from lemtomap.topo.kernels import fitting, lines
from lemtomap.topo.kernels import search as kernels
from lemtomap.topo.loops.config import SearchConfig
from lemtomap.types import GridView

Points = NDArray[np.float64]
"""float64 (N, 2), metres, in the frame the name says."""
LEAST_SIGMA = np.array([0.2, 0.2, 0.05])  # no surprise within what a window itself may bend by


@dataclass(frozen=True, slots=True)
class SearchBox:
    """Which poses of a place's frame in the grid frame are searched: middle and half widths."""

    T_grid_place: Pose
    half_x_m: float
    half_y_m: float
    half_yaw_rad: float
    sigma: NDArray[np.float64] | None = None
    """float64 (3,): m, m, rad, how surely the place's pose is known, grid frame; None when nothing is."""
    T_grid_expected: Pose | None = None
    """Where the place should be; the middle unless told."""
    is_cut: bool = False
    """Whether the place may lie outside as well, so that the graph has little say."""

    @property
    def expected(self) -> Pose:
        """Where the place should be, T_grid_place."""
        return self.T_grid_place if self.T_grid_expected is None else self.T_grid_expected

    def off_m(self, T_grid_place: Pose) -> float:
        """Return how far a pose is from where the place should be."""
        return float(np.hypot(*(T_grid_place[:2] - self.expected[:2])))

    def is_known_within(self, sigma_m: float) -> bool:
        """Return True if the graph knows where the place is to so many metres, one sigma."""
        return not self.is_cut and self.sigma is not None and float(self.sigma[:2].max()) <= sigma_m

    def surprise(self, T_grid_place: Pose) -> float:
        """Return how many sigmas a pose is away from the expected one, on the axis where it is most."""
        if self.sigma is None:
            return 0.0
        off = np.abs(T_grid_place - self.expected)
        off[2] = abs(wrap_angle(off[2]))
        return float((off / np.maximum(self.sigma, LEAST_SIGMA)).max())


@dataclass(frozen=True, slots=True)
class SearchMatch:
    """A place found in the window."""

    T_grid_place: Pose
    covariance: NDArray[np.float64]
    """float64 (3, 3): m, m, rad, a small motion of the place in its own axes."""
    explained: float
    """Share of the place's points, of those in known space, that fall on an obstacle of the window."""
    contradicted: float
    """Share of the place's points, of those in known space, that fall into space seen free."""
    known: float
    """Share of the place's points in known space."""
    score: float
    """Correlation of the search, 1 for a perfect match."""
    rival: float
    """Best score of a clearly different pose in the box over this one's; 1 is fully ambiguous."""
    residual_m: float
    weakest: float
    """Smallest over largest information of translation: 0 in a featureless corridor."""


class Progress(StrEnum):
    """How far a sliced search is."""

    SEARCHING = "searching"
    RIVAL = "rival"
    DONE = "done"


class Reference:
    """The window as the fixed side of every match, made from one snapshot.

    points_grid: averaged hits, float (N, 2), metres, grid frame: finer than the cells, for the alignment.
    """

    def __init__(self, grid: GridView, points_grid: Points, config: SearchConfig) -> None:
        self.config = config
        self.grid = grid
        block = max(1, round(config.cell_m / grid.resolution_m))
        self.cell_m = block * grid.resolution_m
        coarse = kernels.pool(grid.occupancy, block, config.occupied_from)
        self.field = kernels.score_field(
            coarse,
            config.occupied_from,
            config.free_below,
            _falloff(config, self.cell_m),
            config.contradiction,
        )
        self.points_grid = np.ascontiguousarray(points_grid, dtype=np.float64)
        self._stack: NDArray[np.int16] | None = None
        self._lines: tuple[Points, NDArray[np.int32]] | None = None

    @property
    def lines(self) -> tuple[Points, NDArray[np.int32]]:
        """The normals of the hits' lines and the index of the hit nearest to each cell, made when needed."""
        if self._lines is None:
            config, grid = self.config, self.grid
            normals = lines.line_normals(self.points_grid, config.line_reach_m)
            in_cells = (self.points_grid - np.array(grid.origin_m)) / grid.resolution_m
            rows, cols = grid.occupancy.shape
            reach = config.nearest_m / grid.resolution_m
            self._lines = normals, fitting.nearest_index(in_cells, rows, cols, reach)
        return self._lines

    @property
    def stack(self) -> NDArray[np.int16]:
        """The score pyramid, built when first needed."""
        if self._stack is None:
            self._stack = kernels.pyramid(self.field, self.config.levels)
        return self._stack

    def found_in(self, points_place: Points, T_grid_place: Pose) -> float:
        """Return the share of the window's hits around a place that lie on the place's points."""
        near = transform(inverse(T_grid_place), self.points_grid)
        near = near[np.hypot(near[:, 0], near[:, 1]) <= self.config.around_m]
        return float(fitting.share_near(near, points_place, self.config.around_m, self.cell_m))

    def refine(
        self, points_place: Points, T_grid_place: Pose, *, score: float = 1.0, rival: float = 0.0
    ) -> SearchMatch:
        """Align a place from a pose that is right within a search cell or two, and measure the fit."""
        config, grid = self.config, self.grid
        origin_x, origin_y = grid.origin_m
        found, info, used, residual_m = fitting.align(
            points_place,
            self.points_grid,
            *self.lines,
            origin_x,
            origin_y,
            grid.resolution_m,
            np.asarray(T_grid_place),
            config.nearest_m,
            config.residual_m,
            config.rounds,
        )
        found[2] = wrap_angle(found[2])
        hit, against, unknown = fitting.tally(
            points_place, found, self.field, origin_x, origin_y, self.cell_m
        )
        known = max(1, hit + against)
        return SearchMatch(
            T_grid_place=found,
            covariance=_covariance(info, found[2], residual_m, config),
            explained=hit / known,
            contradicted=against / known,
            known=known / max(1, hit + against + unknown),
            score=score,
            rival=rival,
            residual_m=float(residual_m),
            weakest=_weakest(info) if used >= 6 else 0.0,
        )


@dataclass(slots=True)
class Search:
    """One place searched in one window, in slices: call `advance` until it is done."""

    reference: Reference
    points_place: Points
    box: SearchBox
    least_score: float = 0.0
    """Nothing below is looked for; at least what the settings say."""
    progress: Progress = Progress.SEARCHING
    match: SearchMatch | None = None
    work: int = 0
    rival: Pose | None = None
    """The best clearly different pose, to a search cell; None when nothing near as good was found."""
    _cells: Points = field(init=False)
    _range: NDArray[np.int64] = field(init=False)
    _away: NDArray[np.int64] = field(init=False)
    _angle_0_rad: float = field(init=False)
    _angle_step_rad: float = field(init=False)
    _keys: NDArray[np.int64] = field(init=False)
    _blocks: NDArray[np.int32] = field(init=False)
    _size: int = 0
    _planted: int = 0
    """Root block to go on with; -1 when all are planted."""
    _least: int = 0
    _found: tuple[Pose, int] | None = None

    def __post_init__(self) -> None:
        config, grid = self.reference.config, self.reference.grid
        cell_m = self.reference.cell_m
        self._cells = np.ascontiguousarray(self.points_place / cell_m)
        lever_m = max(config.angle_reach_m, float(np.hypot(*self.points_place.T).max(initial=0.0)))
        self._angle_step_rad = cell_m / lever_m
        angles = 2 * int(np.ceil(min(self.box.half_yaw_rad, np.pi) / self._angle_step_rad)) + 1
        self._angle_0_rad = float(self.box.T_grid_place[2]) - (angles // 2) * self._angle_step_rad
        middle = (self.box.T_grid_place[:2] - np.array(grid.origin_m)) / cell_m
        half = np.array([self.box.half_x_m, self.box.half_y_m]) / cell_m
        low, high = np.floor(middle - half), np.ceil(middle + half) + 1
        self._range = np.array([low[0], high[0], low[1], high[1], 0, angles], dtype=np.int64)
        self._away = np.zeros(6, dtype=np.int64)
        self._keys = np.empty(config.heap_blocks, dtype=np.int64)
        self._blocks = np.empty((config.heap_blocks, 4), dtype=np.int32)
        self._least = int(max(config.least_score, self.least_score) * 100 * max(1, len(self._cells)))

    def advance(self, budget: int) -> bool:
        """Do about `budget` bound evaluations more; return True when the search is over."""
        while budget > 0 and self.progress is not Progress.DONE:
            before = self.work
            self._slice(budget)
            budget -= max(1, self.work - before)
        return self.progress is Progress.DONE

    def _slice(self, budget: int) -> None:
        stack, config = self.reference.stack, self.reference.config
        if self._planted >= 0:
            self._size, work, self._planted = kernels.plant(
                stack,
                self._cells,
                config.levels - 2,
                self._range,
                self._angle_0_rad,
                self._angle_step_rad,
                self._least,
                self._keys,
                self._blocks,
                self._size,
                self._planted,
                budget,
            )
            self.work += work
            return
        state, self._size, key, col, row, angle, work = kernels.dig(
            stack,
            self._cells,
            self._range,
            self._away,
            self._angle_0_rad,
            self._angle_step_rad,
            self._least,
            self._keys,
            self._blocks,
            self._size,
            budget,
        )
        self.work += work
        if state == 2:
            return
        if self.progress is Progress.SEARCHING and state == 1:
            self._first(key, col, row, angle)
        else:
            self._finish(state, key)
            if self.match is not None and state == 1:
                self.rival = self._pose(col, row, angle)

    def _first(self, key: int, col: int, row: int, angle: int) -> None:
        config, cell_m = self.reference.config, self.reference.cell_m
        self._found = (self._pose(col, row, angle), key)
        near, turn = round(config.distinct_m / cell_m), round(config.distinct_rad / self._angle_step_rad)
        self._away = np.array(
            [col - near, col + near + 1, row - near, row + near + 1, angle - turn, angle + turn + 1],
            dtype=np.int64,
        )
        self._least = max(self._least, key // 2)
        self.progress = Progress.RIVAL

    def _pose(self, col: int, row: int, angle: int) -> Pose:
        cell_m, (x_m, y_m) = self.reference.cell_m, self.reference.grid.origin_m
        turn_rad = self._angle_0_rad + angle * self._angle_step_rad
        return pose(x_m + col * cell_m, y_m + row * cell_m, turn_rad)

    def _finish(self, state: int, key: int) -> None:
        self.progress = Progress.DONE
        if self._found is None:
            return
        T_grid_place, best = self._found
        rival = key / best if state == 1 else (1.0 if state == 3 else 0.0)
        score = best / (100.0 * len(self._cells))
        self.match = self.reference.refine(self.points_place, T_grid_place, score=score, rival=rival)


def _falloff(config: SearchConfig, cell_m: float) -> NDArray[np.int16]:
    half = max(1, int(np.ceil(1.5 * config.spread_m / cell_m)))
    offsets = np.arange(-half, half + 1) * cell_m
    squares = offsets[:, None] ** 2 + offsets[None, :] ** 2
    stamp = 100.0 * np.exp(-squares / (2.0 * config.spread_m**2))
    stamp[squares > (1.6 * config.spread_m) ** 2] = 0.0
    return np.asarray(np.round(stamp), dtype=np.int16)


def _covariance(
    info: NDArray[np.float64], yaw_rad: float, residual_m: float, config: SearchConfig
) -> NDArray[np.float64]:
    """Return the covariance in the place's own axes from the normal matrix in the grid's."""
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    variance = max(config.point_sigma_m, residual_m) ** 2 * config.correlation
    return sure_of(turn.T @ info @ turn / variance)


def _weakest(info: NDArray[np.float64]) -> float:
    low, high = np.linalg.eigvalsh(info[:2, :2])
    return float(low / high) if high > 0.0 else 0.0
