"""What there is to see on a building's true floor, what a laser has seen of it, and a greedy explorer's way.

Everything is an array over the cells of the world's raster, [row, col], row growing with y.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from lemtomap.nav.kernels import fields as kernels
from lemtomap.sim.hokuyo import FIRST_STEP, LAST_STEP
from lemtomap.sim.raster import clearance_m
from lemtomap.sim.urg import ANGLES_RAD
from lemtomap.sim.world import Raster

Mask = NDArray[np.bool_]
Cell = tuple[int, int]

BODY_M = 0.20  # Kobuki's 0.178 m and the half cell that a map cannot tell
SILENT_FREE_M = 2.0  # what a beam without an answer proves free (lemtomap.robot.devices.bridge)
TYPICAL_REACH_M = 4.5  # of a URG-04LX on indoor walls: 5.2 m on white ones met square, less on all others
LOOK_EVERY_M = 0.5
CRUMB_M2 = 0.10  # a perfect explorer need not look behind each table's leg


@dataclass(frozen=True, slots=True)
class Floor:
    """The part of a raster that counts."""

    raster: Raster
    standing: Mask
    """Where the middle of the robot can come to from its start."""
    floor: Mask
    """What its body can cover from there: the floor that exploration has to see."""

    @property
    def cell_m(self) -> float:
        """Side of a cell."""
        return self.raster.resolution_m

    def share(self, seen: Mask) -> float:
        """Return how much of the floor has been seen, 0 to 1."""
        return float(np.count_nonzero(seen & self.floor)) / float(np.count_nonzero(self.floor))


def reachable_floor(raster: Raster, start_m: tuple[float, float]) -> Floor:
    """Return the floor that a robot set down at a point can reach."""
    roomy = clearance_m(raster) >= BODY_M
    labels, _ = ndimage.label(roomy)
    label = labels[raster.cell(*start_m)]
    if label == 0:
        raise SystemExit(f"no room for the robot at {start_m}")
    standing = np.asarray(labels == label)
    away = ndimage.distance_transform_edt(~standing) * raster.resolution_m
    return Floor(raster, standing, np.asarray((away <= BODY_M) & raster.free))


def random_start(
    raster: Raster, rng: np.random.Generator, room_m: float = 0.45
) -> tuple[float, float, float]:
    """Return a pose with room around it in the largest part of the building."""
    labels, _ = ndimage.label(clearance_m(raster) >= BODY_M)
    largest = int(np.argmax(np.bincount(labels.ravel())[1:])) + 1
    cells = np.argwhere((labels == largest) & (clearance_m(raster) >= room_m))
    row, col = (int(index) for index in rng.choice(cells))
    return (*raster.point(row, col), float(rng.uniform(-math.pi, math.pi)))


def see(
    seen: Mask,
    raster: Raster,
    start_m: NDArray[np.float64],
    yaw: NDArray[np.float64],
    free_m: NDArray[np.float64],
) -> None:
    """Mark the cells along beams from one point: yaw float64 (N,), rad; free_m float64 (N,), how far."""
    step_m = raster.resolution_m
    reach = np.arange(0.0, float(free_m.max(initial=0.0)) + step_m, 0.7 * step_m)
    along = reach[None, :] <= free_m[:, None]
    x = start_m[0] + np.cos(yaw)[:, None] * reach
    y = start_m[1] + np.sin(yaw)[:, None] * reach
    rows, cols = _cells(raster, x[along], y[along])
    seen[rows, cols] = True


def see_scan(
    seen: Mask, raster: Raster, T_world_laser: NDArray[np.float64], ranges_mm: NDArray[np.int64]
) -> None:
    """Mark what one turn of the real sensor saw; ranges int64 (769,), mm or error codes."""
    values = ranges_mm[FIRST_STEP : LAST_STEP + 1]
    free_m = np.where(values >= 20, values * 1e-3, np.where(values == 0, SILENT_FREE_M, 0.0))
    see(seen, raster, T_world_laser[:2], T_world_laser[2] + ANGLES_RAD, free_m)


def see_round(seen: Mask, raster: Raster, p_world: tuple[float, float]) -> None:
    """Mark what a perfect sensor of the same reach sees all round from a point."""
    yaw = np.arange(0.0, 2.0 * math.pi, 0.6 * raster.resolution_m / TYPICAL_REACH_M * 2.0)
    reach = np.arange(0.0, TYPICAL_REACH_M, 0.7 * raster.resolution_m)
    x = p_world[0] + np.cos(yaw)[:, None] * reach
    y = p_world[1] + np.sin(yaw)[:, None] * reach
    rows, cols = _cells(raster, x, y)
    wall = raster.occupied[rows, cols]
    met = wall.any(axis=1)
    free_m = np.where(met, reach[np.argmax(wall, axis=1)], SILENT_FREE_M)
    see(seen, raster, np.array(p_world), yaw, free_m)


def _cells(
    raster: Raster, x: NDArray[np.float64], y: NDArray[np.float64]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    (x0, y0), step_m, (rows, cols) = raster.origin_m, raster.resolution_m, raster.free.shape
    row = np.clip(np.floor((y - y0) / step_m).astype(np.intp), 0, rows - 1)
    col = np.clip(np.floor((x - x0) / step_m).astype(np.intp), 0, cols - 1)
    return row, col


class GreedyExplorer:
    """Knows the whole plan and what of it has not been seen; always goes to the nearest of that."""

    def __init__(self, floor: Floor, start_m: tuple[float, float]) -> None:
        self._floor = floor
        self._cost = np.where(floor.standing, np.float32(1.0), np.float32(np.inf))
        self.seen: Mask = np.zeros(floor.floor.shape, dtype=np.bool_)
        self._around = round(BODY_M / floor.cell_m) + 1
        self.track = [start_m]
        self.path_m = 0.0
        see_round(self.seen, floor.raster, start_m)

    def explore(self, share: float) -> float:
        """Drive until so much of the floor has been seen; return the length of the way."""
        while self._floor.share(self.seen) < share and self._advance():
            pass
        return self.path_m

    def _advance(self) -> bool:
        """Go a step towards the nearest unseen patch; False when there is none."""
        raster = self._floor.raster
        dark = self._dark()
        if not dark.any():
            return False
        row, col = raster.cell(*self.track[-1])
        cols = self._cost.shape[1]
        seeds = np.flatnonzero(dark & self._floor.standing)
        if seeds.size == 0:
            return False
        field = kernels.march(self._cost, seeds, np.zeros(seeds.size), row * cols + col, 2.0, 1.0)
        path = kernels.descend(field, row + 0.5, col + 0.5, 1.0, round(LOOK_EVERY_M / raster.resolution_m))
        x0, y0 = raster.origin_m
        for r, c in path[1:]:
            here = (x0 + c * raster.resolution_m, y0 + r * raster.resolution_m)
            self.path_m += math.dist(here, self.track[-1])
            self.track.append(here)
        see_round(self.seen, raster, self.track[-1])
        if len(path) < 2:  # it stands on the patch: what it cannot see from here it never will
            near = self._around + 1
            self.seen[max(row - near, 0) : row + near + 1, max(col - near, 0) : col + near + 1] = True
        return True

    def _dark(self) -> Mask:
        """Return the unseen floor, and where to stand near it, without crumbs."""
        labels, _ = ndimage.label(self._floor.floor & ~self.seen)
        sizes = np.bincount(labels.ravel())
        sizes[0] = 0
        large = (sizes * self._floor.cell_m**2 >= CRUMB_M2)[labels]
        return np.asarray(ndimage.binary_dilation(large, iterations=self._around))
