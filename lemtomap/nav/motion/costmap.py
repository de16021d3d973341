"""The layered costmap over the rolling window: grid, live obstacles, hazards, inflation (thesis, 2-4-1).

Everything lives in the grid frame on the window's own cells and moves along when the window rolls.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lemtomap import se2
from lemtomap.kernels.lines import first_on_line
from lemtomap.nav.config import BodyLimits, CostmapConfig
from lemtomap.nav.kernels import fields as kernels
from lemtomap.nav.kernels import shapes
from lemtomap.nav.types import CostmapView, ObstacleSighting, Points
from lemtomap.se2 import Pose
from lemtomap.types import GridView


@dataclass(frozen=True, slots=True)
class Costs:
    """One moment's costmap. Arrays are (rows, cols), [0, 0] at the corner of least x and y."""

    stamp_s: float
    resolution_m: float
    origin_m: tuple[float, float]
    state: NDArray[np.uint8]
    """kernels.FREE, UNKNOWN or LETHAL."""
    clearance: NDArray[np.float32]
    """Cells to the nearest obstacle's centre, capped."""
    cost: NDArray[np.float32]
    """Price of a cell of way; inf where the body does not fit."""

    def cell(self, p_grid: ArrayLike) -> tuple[float, float]:
        """Return (row, col) as real numbers of a point in the grid frame."""
        x, y = np.asarray(p_grid, dtype=np.float64)[:2]
        return (y - self.origin_m[1]) / self.resolution_m, (x - self.origin_m[0]) / self.resolution_m

    def holds(self, p_grid: ArrayLike, margin_m: float = 0.0) -> bool:
        """Return True if a point lies inside the window, at least margin_m from its border."""
        row, col = self.cell(p_grid)
        margin = margin_m / self.resolution_m
        rows, cols = self.state.shape
        return bool(margin <= row < rows - margin and margin <= col < cols - margin)

    def fits_between(self, p_grid: ArrayLike, q_grid: ArrayLike) -> bool:
        """Return True if the body fits all along the straight line between two places in the window."""
        line = (*self.cell(p_grid), *self.cell(q_grid))
        return bool(np.isinf(first_on_line(self.cost, *line, np.inf, np.inf)))

    def to_grid(self, rows_cols: NDArray[np.float64]) -> Points:
        """Return points (N, 2) in the grid frame of [row, col] pairs (N, 2)."""
        return np.asarray(rows_cols[:, ::-1] * self.resolution_m + np.array(self.origin_m))

    def over_seen_floor(self, p_robot_grid: ArrayLike) -> "Costs":
        """Return the same costs with unseen floor closed, but not where the robot stands."""
        cost = np.where(self.state == kernels.UNKNOWN, np.float32(np.inf), self.cost)
        if self.holds(p_robot_grid):
            row, col = (int(index) for index in self.cell(p_robot_grid))
            cost[row, col] = self.cost[row, col]
        return replace(self, cost=cost)

    def without_spokes(self, thick_m: float) -> "Costs":
        """Return the same costs with floor unseen where only single beams crossed it.

        thick_m: seen ground keeps what squares of this side fit into.
        """
        side = max(1, round(thick_m / self.resolution_m))
        solid = shapes.opened(self.state != kernels.UNKNOWN, side)
        spokes = (self.state == kernels.FREE) & ~solid
        return replace(self, state=np.where(spokes, np.uint8(kernels.UNKNOWN), self.state))

    def part(self, inner: tuple[slice, slice], outer: tuple[slice, slice]) -> "Costs":
        """Return the costs of a part of the window; outer is the part of the window this is of."""
        row, col = inner[0].start - outer[0].start, inner[1].start - outer[1].start
        cut = (
            slice(row, row + inner[0].stop - inner[0].start),
            slice(col, col + inner[1].stop - inner[1].start),
        )
        origin_m = self.origin_m[0] + col * self.resolution_m, self.origin_m[1] + row * self.resolution_m
        return Costs(
            self.stamp_s,
            self.resolution_m,
            origin_m,
            np.ascontiguousarray(self.state[cut]),
            np.ascontiguousarray(self.clearance[cut]),
            np.ascontiguousarray(self.cost[cut]),
        )

    def view(self) -> CostmapView:
        """Return the picture viewers show, painted when it is looked at."""
        return CostmapView(self.stamp_s, self.resolution_m, self.origin_m, self._paint)

    def _paint(self) -> NDArray[np.uint8]:
        picture = np.where(np.isinf(self.cost), 253.0, np.clip((self.cost - 1.0) * 50.0, 0.0, 252.0))
        picture[self.state == kernels.UNKNOWN] = 255
        picture[self.state == kernels.LETHAL] = 254
        return picture.astype(np.uint8)


@dataclass(frozen=True, slots=True)
class Felt:
    """What was met by touch; float64 (N, 2), metres, grid frame."""

    shut_grid: Points = field(default_factory=lambda: np.empty((0, 2)))
    """No way there."""
    dear_grid: Points = field(default_factory=lambda: np.empty((0, 2)))
    """Around these a wide berth is better, but none is not forbidden."""


BESIDE = 2  # cells, 0.1 m: a leg is no wider at the camera's height than at the laser's


class LiveLayer:
    """Obstacles one sensor saw lately, with the time each was last seen."""

    def __init__(self, shape: tuple[int, ...], decay_s: float, *, sees_near: bool) -> None:
        self.decay_s, self.sees_near = decay_s, sees_near
        self.last_hit_s = np.full(shape, -np.inf)
        self.hits = np.zeros(shape, dtype=np.uint8)

    def roll(self, rows: int, cols: int) -> None:
        """Follow the window by whole cells."""
        self.last_hit_s = kernels.shift_cells(self.last_hit_s, rows, cols, -np.inf)
        self.hits = kernels.shift_cells(self.hits, rows, cols, 0)


class Costmap:
    """Keeps the layers; `build` melts them into one `Costs`."""

    def __init__(self, config: CostmapConfig, body: BodyLimits) -> None:
        self._config = config
        self._body = body
        self._live: dict[str, LiveLayer] = {}
        self._grid: GridView | None = None

    def follow_window(self, grid: GridView) -> None:
        """Take the newest window; live layers move along with it."""
        old, self._grid = self._grid, grid
        if old is None or old is grid:
            return
        same = old.resolution_m == grid.resolution_m and old.occupancy.shape == grid.occupancy.shape
        cols, rows = (np.array(grid.origin_m) - np.array(old.origin_m)) / grid.resolution_m
        if not same:
            self._live.clear()
        elif round(rows) != 0 or round(cols) != 0:
            for layer in self._live.values():
                layer.roll(round(rows), round(cols))

    def see(self, sighting: ObstacleSighting, T_grid_odom: Pose) -> None:
        """Clear along the rays of one sighting, those without return too, and mark what they met."""
        grid = self._grid
        if grid is None:
            return
        layer = self._layer(sighting, grid)
        T_grid_base = se2.compose(T_grid_odom, sighting.T_odom_base)
        origin = np.asarray(sighting.origin_base)
        rays = np.concatenate([sighting.hits_base, sighting.misses_base]) - origin
        length = np.hypot(rays[:, 0], rays[:, 1])
        reach = self._config.live_range_m
        near = length <= reach
        scale = np.where(near, 1.0, reach / np.maximum(length, 1e-9))
        ends = self._cells(se2.transform(T_grid_base, origin + rays * scale[:, None]))
        start = self._cells(se2.transform(T_grid_base, origin[None, :]))[0]
        if sighting.floor_base is None and len(rays):
            kernels.clear_rays(layer.last_hit_s, layer.hits, start[0], start[1], ends[:, 0], ends[:, 1], 1.5)
        marks, stamp_s = ends[: len(sighting.hits_base)][near[: len(sighting.hits_base)]], sighting.stamp_s
        if sighting.floor_base is not None:
            marks = marks[~self._scanned(marks, stamp_s)]
        kernels.mark_hits(layer.last_hit_s, layer.hits, marks[:, 0], marks[:, 1], stamp_s)
        if sighting.floor_base is not None:
            floor = self._cells(se2.transform(T_grid_base, sighting.floor_base))
            cells = np.unique(np.floor(floor).astype(np.int64), axis=0)
            kernels.clear_cells(layer.last_hit_s, layer.hits, cells, stamp_s)

    def _scanned(self, cells: NDArray[np.float64], now_s: float) -> NDArray[np.bool_]:
        """Return which cells, float64 (N, 2), the laser has something in or beside, bool (N,).

        It then watches them: what a camera keeps for long is only what the laser overlooks. A person whom
        both saw is gone when the laser looks through where he stood.
        """
        scanned = np.zeros(len(cells), dtype=np.bool_)
        rows, cols = np.floor(cells).astype(np.int64).T
        for layer in self._live.values():
            if not layer.sees_near:
                continue
            height, width = layer.hits.shape
            for r, c in ((r, c) for r in range(-BESIDE, BESIDE + 1) for c in range(-BESIDE, BESIDE + 1)):
                at = np.clip(rows + r, 0, height - 1), np.clip(cols + c, 0, width - 1)
                scanned |= (layer.hits[at] >= self._config.live_hits) & (
                    now_s - layer.last_hit_s[at] <= self._config.agree_s
                )
        return scanned

    def _layer(self, sighting: ObstacleSighting, grid: GridView) -> LiveLayer:
        layer = self._live.get(sighting.source)
        flat = sighting.floor_base is None
        decay_s = self._config.live_decay_s if flat else self._config.depth_decay_s
        if layer is None:
            layer = self._live[sighting.source] = LiveLayer(grid.occupancy.shape, decay_s, sees_near=flat)
        return layer

    def hold(self, p_grid: ArrayLike, radius_m: float, until_s: float) -> None:
        """Let live obstacles within a radius be believed until then, unless rays clear them before."""
        row, col = self._cells(np.asarray(p_grid, dtype=np.float64)[None, :2])[0]
        for layer in self._live.values():
            rows, cols = np.nonzero(layer.hits)
            away = np.hypot(rows + 0.5 - row, cols + 0.5 - col) * self._resolution_m
            close = away <= radius_m
            layer.last_hit_s[rows[close], cols[close]] = until_s - layer.decay_s

    def forget_live(self) -> None:
        """Drop the live obstacles that the next scans tell anew; a camera does not see what is below it."""
        self._live = {source: layer for source, layer in self._live.items() if not layer.sees_near}

    def build(
        self,
        now_s: float,
        p_robot_grid: ArrayLike,
        felt: Felt | None = None,
        *,
        tight: bool = False,
        half_m: float | None = None,
    ) -> Costs:
        """Return the costmap of this moment.

        felt: what was met by touch; None: nothing.
        tight: without the margin, for a place that a few noisy cells make too narrow.
        half_m: only the square of twice this side around the robot; what stands outside it near its border is
        felt as well.
        """
        grid, config, felt = self._grid, self._config, felt or Felt()
        if grid is None:
            raise RuntimeError("build before follow_window")
        res, felt_m = grid.resolution_m, config.inflation_m + self._body.radius_m
        part = _square(grid, p_robot_grid, None if half_m is None else half_m + felt_m)
        origin_m = grid.origin_m[0] + part[1].start * res, grid.origin_m[1] + part[0].start * res
        state = self._state(grid, part, now_s)
        for x, y in felt.shut_grid:
            row, col = (y - origin_m[1]) / res, (x - origin_m[0]) / res
            kernels.stamp_disc(state, row, col, config.contact_radius_m / res, kernels.LETHAL)
        clearance = kernels.clearance_transform(state, felt_m / res)
        body = (self._body.radius_m + (0.0 if tight else config.margin_m)) / res
        cost = kernels.traversal_cost(
            state, clearance, body, config.near_wall_cost, config.falloff_m / res, config.unknown_factor
        )
        for x, y in felt.dear_grid:
            row, col = (y - origin_m[1]) / res, (x - origin_m[0]) / res
            flat = (self._body.radius_m + config.contact_wide_m) / res
            kernels.raise_cost(cost, row, col, flat, flat + config.contact_edge_m / res, config.contact_price)
        costs = Costs(now_s, res, origin_m, state, clearance, cost)
        row, col = costs.cell(p_robot_grid)
        if costs.holds(p_robot_grid) and np.isinf(cost[int(row), int(col)]):
            kernels.open_start(cost, clearance, row, col, 0.30 / res, config.tight_price)
        return costs if half_m is None else costs.part(_square(grid, p_robot_grid, half_m), part)

    def _state(self, grid: GridView, part: tuple[slice, slice], now_s: float) -> NDArray[np.uint8]:
        """Return FREE, UNKNOWN or LETHAL of the window and the live layers, in this part of it."""
        occupancy = np.ascontiguousarray(grid.occupancy[part])
        state = np.empty(occupancy.shape, dtype=np.uint8)
        kernels.classify(occupancy, self._config.occupied_percent, state)
        for layer in self._live.values():
            last_hit_s = np.ascontiguousarray(layer.last_hit_s[part])
            hits = np.ascontiguousarray(layer.hits[part])
            grow = 0 if layer.sees_near else self._config.depth_grow_cells
            kernels.add_live(state, last_hit_s, hits, now_s, layer.decay_s, self._config.live_hits, grow)
        return state

    @property
    def _resolution_m(self) -> float:
        return 1.0 if self._grid is None else self._grid.resolution_m

    def _cells(self, p_grid: Points) -> NDArray[np.float64]:
        """Return [row, col] real numbers (N, 2)."""
        grid = self._grid
        if grid is None:
            raise RuntimeError("no window yet")
        return np.asarray((p_grid - np.array(grid.origin_m))[:, ::-1] / grid.resolution_m)


def _square(grid: GridView, p_grid: ArrayLike, half_m: float | None) -> tuple[slice, slice]:
    """Return the rows and columns of a square around a point, as far as the window has them."""
    rows, cols = grid.occupancy.shape
    if half_m is None:
        return slice(0, rows), slice(0, cols)
    middle = (np.asarray(p_grid, dtype=np.float64)[:2] - np.array(grid.origin_m)) / grid.resolution_m
    half = round(half_m / grid.resolution_m)
    col, row = (int(v) for v in np.clip(np.floor(middle), 0, (cols - 1, rows - 1)))
    return (
        slice(max(0, row - half), min(rows, row + half + 1)),
        slice(max(0, col - half), min(cols, col + half + 1)),
    )
