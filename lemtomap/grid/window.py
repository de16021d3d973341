"""The rolling window: a ring buffer of cells around the robot, and its shifts (thesis 3-4)."""

import math
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lemtomap.grid.beams import Beams
from lemtomap.grid.config import SlamConfig
from lemtomap.grid.kernels import planes
from lemtomap.grid.kernels import scan as scan_kernels
from lemtomap.grid.kernels import window as kernels
from lemtomap.se2 import Pose, transform
from lemtomap.types import GridView

UNKNOWN_PERCENT = -1
OFF_CENTRE_SHARE = 0.5  # of half the window, that the robot may be off its middle
LOG_ODDS_PER_EVIDENCE = 0.5  # evidence 12 of 12 shows as 100 %, -5 as 8 %


class WindowArrays(NamedTuple):
    """The cells as kernels take them; lemtomap.grid.kernels.window says what each array holds."""

    evidence: NDArray[np.int8]
    averaged: NDArray[np.uint8]
    mean: NDArray[np.uint16]
    whence: NDArray[np.int8]
    lift: NDArray[np.int8]
    nearest: NDArray[np.uint8]
    normal: NDArray[np.uint8]
    origin: NDArray[np.int64]


class LookUp(NamedTuple):
    """Tables that all windows share."""

    offsets: NDArray[np.int64]
    """(254, 2) cell steps, nearest first."""
    closeness: NDArray[np.float64]
    """(256,) by index into offsets: 1 at the same cell, falling to 0; 0 for none."""
    normals: NDArray[np.float32]
    """(256, 2) unit vectors by quantised surface normal."""


def look_up(resolution_m: float, reach_m: float = 0.1) -> LookUp:
    """Return the tables; reach_m is the standard deviation of the closeness that the hill climb sees."""
    steps = sorted(
        ((x, y) for x in range(-9, 10) for y in range(-9, 10)),
        key=lambda step: (step[0] ** 2 + step[1] ** 2, abs(step[0]) + abs(step[1]), step),
    )[: kernels.NONE - 1]
    offsets = np.array(steps, dtype=np.int64)
    closeness = np.zeros(256)
    closeness[: len(offsets)] = np.exp(-0.5 * (np.hypot(*offsets.T) * resolution_m / reach_m) ** 2)
    angles = np.arange(256) * math.pi / 255.0
    normals = np.stack([np.cos(angles), np.sin(angles)], axis=1).astype(np.float32)
    return LookUp(offsets, closeness, normals)


class Scratch:
    """Working memory that all windows of one mapper share."""

    def __init__(self, cells: int) -> None:
        self.mark = np.zeros((cells, cells), dtype=np.int32)
        self.tag = 0
        self.lists = np.zeros((3, cells * cells, 2), dtype=np.int32)


class Window:
    """n x n cells of evidence with the look-ups that matching needs, kept right at every change."""

    def __init__(self, config: SlamConfig, tables: LookUp, scratch: Scratch) -> None:
        n = config.cells
        self.resolution_m = config.resolution_m
        self.arrays = WindowArrays(
            evidence=np.zeros((n, n), dtype=np.int8),
            averaged=np.zeros((n, n), dtype=np.uint8),
            mean=np.zeros((n, n, 2), dtype=np.uint16),
            whence=np.zeros((n, n, 2), dtype=np.int8),
            lift=np.zeros((n, n), dtype=np.int8),
            nearest=np.full((n, n), kernels.NONE, dtype=np.uint8),
            normal=np.full((n, n), kernels.NONE, dtype=np.uint8),
            origin=np.array([-(n // 2), -(n // 2)], dtype=np.int64),
        )
        self._tables, self._scratch = tables, scratch
        self._rules = np.array(
            [
                config.evidence_hit,
                config.evidence_miss,
                config.evidence_floor,
                config.evidence_ceiling,
                config.hits_averaged,
            ],
            dtype=np.int64,
        )

    @property
    def cells(self) -> int:
        """Return the number of cells along one side."""
        return int(self.arrays.evidence.shape[0])

    @property
    def nbytes(self) -> int:
        """Return the memory of the cells."""
        return sum(array.nbytes for array in self.arrays)

    def copy_from(self, other: "Window") -> None:
        """Become equal to another window of the same size."""
        for name in WindowArrays._fields:
            getattr(self.arrays, name)[...] = getattr(other.arrays, name)

    def holds(self, beams: Beams, T_grid_base: Pose) -> bool:
        """Return True if every hit falls inside and the robot is not far from the middle.

        Beams that saw nothing may reach beyond: what they prove is worth less than what a shift would forget.
        """
        half_m = 0.5 * self.resolution_m * self.cells
        off_x, off_y = T_grid_base[:2] - self.resolution_m * self.arrays.origin - half_m
        if max(abs(off_x), abs(off_y)) > OFF_CENTRE_SHARE * half_m:
            return False
        return not scan_kernels.outside(
            beams.hits, T_grid_base, self.arrays.origin, self.cells, self.resolution_m
        )

    def known_share(self, beams: Beams, T_grid_base: Pose) -> float:
        """Return the share of hits, 0..1, in cells that the window knows anything of; 0 without hits.

        It is small on new ground, where there is nothing to match, and large where odometry is wrong. A wall
        seen only from its other side is new ground.
        """
        if len(beams.hits) == 0:
            return 0.0
        n, origin, arrays = self.cells, self.arrays.origin, self.arrays
        points = transform(T_grid_base, beams.hits)
        cells = np.floor(points / self.resolution_m).astype(np.int64)
        inside = ((cells >= origin) & (cells < origin + n)).all(axis=1)
        col, row = cells[inside].T % n
        to_laser = transform(T_grid_base, beams.laser_base[:2]) - points[inside]
        normals = self._tables.normals[arrays.normal[row, col]]
        now = np.sum(normals * to_laser, axis=1) / np.hypot(*to_laser.T)
        then = np.sum(normals * arrays.whence[row, col], axis=1) / planes.FAR
        has_face = (arrays.evidence[row, col] > 0) & (arrays.normal[row, col] != kernels.NONE)
        behind = has_face & (now * then < 0.0) & (np.minimum(abs(now), abs(then)) >= planes.GLANCE)
        known = np.count_nonzero((arrays.evidence[row, col] != 0) & ~behind)
        return known / len(beams.hits)

    def centred_origin(self, T_grid_base: Pose) -> tuple[int, int]:
        """Return the origin, cells, that puts the robot in the middle."""
        half = self.cells // 2
        return (
            math.floor(T_grid_base[0] / self.resolution_m) - half,
            math.floor(T_grid_base[1] / self.resolution_m) - half,
        )

    def shift_to(self, origin: tuple[int, int]) -> None:
        """Move by whole cells: what leaves is forgotten, what enters is unknown, the rest is not touched."""
        kernels.shift(self.arrays, self._tables.offsets, origin[0], origin[1])

    def integrate(self, beams: Beams, T_grid_base: Pose) -> None:
        """Add one scan seen from a pose."""
        self._scratch.tag += 1
        kernels.integrate(
            self.arrays,
            self._tables.offsets,
            self._scratch.mark,
            self._scratch.tag,
            beams.hits,
            beams.normals_rad,
            beams.cuts,
            T_grid_base,
            beams.laser_base,
            self._rules,
            self.resolution_m,
            self._scratch.lists,
        )

    def occupied_points(self) -> NDArray[np.float32]:
        """Return the averaged hit point of each occupied cell: float32 (M, 2), metres, grid frame."""
        evidence = self.arrays.evidence
        out = np.empty((int(np.count_nonzero(evidence > 0)), 2), dtype=np.float32)
        kernels.occupied_points(evidence, self.arrays.mean, self.arrays.origin, self.resolution_m, out)
        return out

    def view(self, stamp_s: float) -> GridView:
        """Return an immutable snapshot."""
        evidence, origin = self.arrays.evidence, self.arrays.origin
        shown = np.empty(evidence.shape, dtype=np.int8)
        kernels.occupancy(evidence, percent_table(), shown)
        out = _unrolled(shown, int(origin[1]) % self.cells, int(origin[0]) % self.cells)
        out.setflags(write=False)
        corner = (float(origin[0]) * self.resolution_m, float(origin[1]) * self.resolution_m)
        return GridView(stamp_s, out, self.resolution_m, corner)


def _unrolled(ring: NDArray[np.int8], row: int, col: int) -> NDArray[np.int8]:
    """Return a ring of cells with cell (row, col) first: four blocks to copy."""
    n = len(ring)
    out = np.empty_like(ring)
    out[: n - row, : n - col], out[: n - row, n - col :] = ring[row:, col:], ring[row:, :col]
    out[n - row :, : n - col], out[n - row :, n - col :] = ring[:row, col:], ring[:row, :col]
    return out


@cache
def percent_table() -> NDArray[np.int8]:
    """Return int8 (256,): what evidence - 128 shows as, -1 unknown, else 0..100."""
    evidence = np.arange(-128, 128)
    percent = np.rint(100.0 / (1.0 + np.exp(-LOG_ODDS_PER_EVIDENCE * evidence))).astype(np.int8)
    percent[evidence == 0] = UNKNOWN_PERCENT
    percent.setflags(write=False)
    return np.asarray(percent)
