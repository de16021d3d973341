"""Ways through a world on its ground-truth raster: for scripted tours only, the robot never sees them."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, sparse
from scipy.sparse import csgraph

from lemtomap.sim.errors import BadWorld
from lemtomap.sim.raster import clearance_m
from lemtomap.sim.world import Raster

CELL_M = 0.10  # planning step; finer rasters are thinned
KEEP_OFF_M = 0.27  # body radius 0.178 m and 9 cm to spare
LIKE_OFF_M = 0.60  # nearer than this costs more, so that tours keep to the middle
IN_SIGHT_M = (
    4.5  # further from everything than a URG-04LX sees well costs more: who maps keeps walls in sight
)
OUT_OF_SIGHT_COST = 1.0
PULLED_M = 20.0  # a grid's way has eight directions; over this length it is pulled straight
ROOF_REACH_M = 25.0
FIRST_LIMIT, MOST_COST = 2.0, 2000.0  # the search ends at twice the straight line, then goes on further


class FloorRoutePlanner:
    """Shortest comfortable ways between points of one world.

    in_sight: keep walls within the reach of a short laser, at the price of a longer way.
    """

    def __init__(self, raster: Raster, *, in_sight: bool = True) -> None:
        self._stride = max(1, round(CELL_M / raster.resolution_m))
        clearance = clearance_m(raster)[:: self._stride, :: self._stride]
        self.passable: NDArray[np.bool_] = clearance >= KEEP_OFF_M
        self._raster = raster
        self._step_m = raster.resolution_m * self._stride
        self._index = np.full(self.passable.shape, -1, dtype=np.int64)
        self._index[self.passable] = np.arange(int(self.passable.sum()))
        self._cells = np.argwhere(self.passable)
        self._cost = 1.0 + 4.0 * np.maximum(0.0, LIKE_OFF_M - clearance) / LIKE_OFF_M
        if in_sight:
            self._cost[clearance > IN_SIGHT_M] += OUT_OF_SIGHT_COST
        self._cost[~self.passable] = np.inf
        self._graph = self._build()

    def _build(self) -> sparse.csr_matrix:
        cost = self._cost
        rows, cols = self.passable.shape
        sources, targets, weights = [], [], []
        for dr, dc in ((0, 1), (1, 0), (1, 1), (1, -1)):
            here = np.s_[0 : rows - dr, max(0, -dc) : cols - max(0, dc)]
            there = np.s_[dr:rows, max(0, dc) : cols + min(0, dc)]
            both = self.passable[here] & self.passable[there]
            sources.append(self._index[here][both])
            targets.append(self._index[there][both])
            weights.append(np.hypot(dr, dc) * self._step_m * (cost[here][both] + cost[there][both]) / 2)
        count = len(self._cells)
        edges = (np.concatenate(weights), (np.concatenate(sources), np.concatenate(targets)))
        return sparse.csr_matrix(edges, shape=(count, count))

    def _nearest(self, point: tuple[float, float]) -> int:
        row, col = self._raster.cell(*point)
        if not len(self._cells):
            raise BadWorld("tour: the world has no passable cell")
        offsets = self._cells * self._stride - [row, col]
        best = int(np.argmin((offsets**2).sum(axis=1)))
        if np.hypot(*offsets[best]) * self._raster.resolution_m > 1.0:
            raise BadWorld(f"tour: nothing passable within 1 m of ({point[0]:g}, {point[1]:g})")
        return best

    def distances(
        self, start: tuple[float, float], limit: float = np.inf
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return cost to every passable cell and its predecessor, by cell number.

        inf: unreachable, or beyond the limit.
        """
        found = csgraph.dijkstra(
            self._graph,
            directed=False,
            indices=np.array([self._nearest(start)]),
            return_predecessors=True,
            limit=limit,
        )
        return np.asarray(found[0])[0], np.asarray(found[1])[0].astype(np.int64)

    def path(self, start: tuple[float, float], goal: tuple[float, float]) -> NDArray[np.float64]:
        """Return points, float64 (N, 2) metres, about a cell apart. Raises BadWorld when there is no way."""
        cell = self._nearest(goal)
        limit = FIRST_LIMIT * max(1.0, np.hypot(start[0] - goal[0], start[1] - goal[1]))
        cost, before = self.distances(start, limit)
        while not np.isfinite(cost[cell]) and limit < MOST_COST:  # a near goal pays for no large building
            limit *= FIRST_LIMIT
            cost, before = self.distances(start, limit if limit < MOST_COST else np.inf)
        if not np.isfinite(cost[cell]):
            raise BadWorld(f"tour: no way from {start} to {goal}")
        cells = [cell]
        while before[cells[-1]] >= 0:
            cells.append(int(before[cells[-1]]))
        way = np.array(cells[::-1])
        return _smooth(self._pulled(self._cells[way], cost[way]))

    def _pulled(self, cells: NDArray[np.int64], cost: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return points a step apart along a way of cells, straight where that costs no more: as people walk.

        cells: int64 (N, 2), cost: float64 (N,), from the way's start to each.
        """
        at, last, most = 0, len(cells) - 1, round(PULLED_M / self._step_m)
        parts = [cells[:1].astype(np.float64)]
        while at < last:
            to = next(
                (
                    to
                    for to in range(min(at + most, last), at + 1, -4)
                    if self._is_as_good(cells, cost, at, to)
                ),
                at + 1,
            )
            parts.append(_between(cells[at], cells[to])[1:])
            at = to
        row_cols = np.concatenate(parts) * self._stride
        return np.array([self._raster.point(row, col) for row, col in row_cols])

    def _is_as_good(self, cells: NDArray[np.int64], cost: NDArray[np.float64], at: int, to: int) -> bool:
        """Return True if the straight line costs no more than the way between two of its cells."""
        line = _between(cells[at], cells[to])
        rows, cols = np.rint(line).astype(np.int64).T
        step_m = float(np.hypot(*(cells[to] - cells[at]))) / (len(line) - 1) * self._step_m
        prices = self._cost[rows, cols]
        return bool(step_m * 0.5 * (prices[1:] + prices[:-1]).sum() <= cost[to] - cost[at] + 1e-9)

    def through(self, waypoints: Sequence[tuple[float, float]]) -> NDArray[np.float64]:
        """Return one path through all waypoints in order."""
        legs = [self.path(a, b) for a, b in pairwise(waypoints)]
        return np.concatenate(legs)

    def point(self, number: int) -> tuple[float, float]:
        """Return the centre of a passable cell, metres."""
        row, col = self._cells[number] * self._stride
        return self._raster.point(int(row), int(col))

    def places(self, start: tuple[float, float], spacing_m: float) -> list[tuple[float, float]]:
        """Return reachable points under a roof, at least spacing_m apart, those with most room first."""
        cost, _ = self.distances(start)
        room = clearance_m(self._raster)[:: self._stride, :: self._stride][self.passable]
        sheltered = under_roof(self._raster)[:: self._stride, :: self._stride][self.passable]
        good = np.flatnonzero(np.isfinite(cost) & sheltered & (room > KEEP_OFF_M + 0.1))
        order = good[np.lexsort((good, -np.round(np.minimum(room[good], 1.5), 1)))]
        points = np.array([self.point(int(number)) for number in order]).reshape(-1, 2)
        chosen: list[tuple[float, float]] = []
        open_ = np.ones(len(points), dtype=np.bool_)
        for index, (x, y) in enumerate(points):
            if open_[index]:
                chosen.append((float(x), float(y)))
                open_ &= np.hypot(points[:, 0] - x, points[:, 1] - y) >= spacing_m
        return chosen


def path_length_m(path: NDArray[np.float64]) -> float:
    """Return the length of a path, float64 (N, 2) metres."""
    return float(np.hypot(*np.diff(path, axis=0).T).sum())


def _between(a: NDArray[np.int64], b: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return cells from a to b on the straight line, about one apart, float64 (N, 2)."""
    return np.linspace(a, b, max(2, round(float(np.hypot(*(b - a)))) + 1))


def _smooth(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Round the grid's corners off: a running mean that keeps both ends."""
    if len(points) < 5:
        return points
    smooth = points.copy()
    for axis in (0, 1):
        smooth[:, axis] = ndimage.uniform_filter1d(points[:, axis], 5, mode="nearest")
    smooth[0], smooth[-1] = points[0], points[-1]
    return smooth


def under_roof(raster: Raster) -> NDArray[np.bool_]:
    """Return the free cells with a wall to the north, south, east and west of them."""
    reach = round(ROOF_REACH_M / raster.resolution_m)
    sheltered = raster.free.copy()
    for axis in (0, 1):
        for occupied, flip in ((raster.occupied, False), (np.flip(raster.occupied, axis), True)):
            number = np.arange(occupied.shape[axis]).reshape([-1, 1] if axis == 0 else [1, -1])
            last = np.maximum.accumulate(np.where(occupied, number, -reach - 1), axis=axis)
            near = number - last <= reach
            sheltered &= np.flip(near, axis) if flip else near
    return sheltered
