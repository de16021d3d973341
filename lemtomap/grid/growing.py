"""The baseline: GMapping on a grid that grows and forgets nothing (one algorithm, two map policies).

What leaves a window goes into the particle's archive of tiles, what enters comes back from it. Archived
tiles never change, so particles share them after resampling; memory grows with the building and with how
much particles differ.
"""

import math
import zlib
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lemtomap.grid.beams import Beams
from lemtomap.grid.config import SlamConfig
from lemtomap.grid.gmapping import RollingGmapping, Visit
from lemtomap.grid.kernels import window as kernels
from lemtomap.grid.matching import ScanMatch
from lemtomap.grid.window import (
    LookUp,
    Scratch,
    Window,
    percent_table,
)
from lemtomap.se2 import Pose, between, compose
from lemtomap.types import (
    GridView,
    Odometry,
    Scan,
    SlamUpdate,
)

TILE = 20  # cells; windows move by whole tiles
PACK_LEVEL = 1  # of zlib: most cells of a tile are alike
OCCUPIED = np.dtype(
    [("averaged", "u1"), ("mean", "u2", 2), ("whence", "i1", 2), ("lift", "i1"), ("normal", "u1")]
)


class ArchivedWindow(Window):
    """A window that remembers what left it."""

    def __init__(self, config: SlamConfig, tables: LookUp, scratch: Scratch) -> None:
        super().__init__(config, tables, scratch)
        self.archive: dict[tuple[int, int], bytes] = {}

    def copy_from(self, other: Window) -> None:
        """Become equal to another window; archived tiles are shared."""
        super().copy_from(other)
        if isinstance(other, ArchivedWindow):
            self.archive = dict(other.archive)

    def centred_origin(self, T_grid_base: Pose) -> tuple[int, int]:
        """Return the origin nearest to centring the robot that lies on tiles."""
        x, y = super().centred_origin(T_grid_base)
        return round(x / TILE) * TILE, round(y / TILE) * TILE

    def shift_to(self, origin: tuple[int, int]) -> None:
        """Move by whole tiles: what leaves is archived, what enters is fetched."""
        before = self._tiles()
        for key in before - self._tiles(origin):
            tile = self._cut(key)
            if tile is not None:
                self.archive[key] = tile
        super().shift_to(origin)
        for key in self._tiles() - before:
            if key in self.archive:
                self._paste(key, self.archive.pop(key))

    def _tiles(self, origin: tuple[int, int] | None = None) -> set[tuple[int, int]]:
        x, y = origin if origin is not None else (int(self.arrays.origin[0]), int(self.arrays.origin[1]))
        count = self.arrays.evidence.shape[0] // TILE
        return {(x // TILE + i, y // TILE + j) for i in range(count) for j in range(count)}

    def _slices(self, key: tuple[int, int]) -> tuple[slice, slice]:
        n = self.arrays.evidence.shape[0]
        row, col = key[1] * TILE % n, key[0] * TILE % n
        return slice(row, row + TILE), slice(col, col + TILE)

    def _cut(self, key: tuple[int, int]) -> bytes | None:
        """Return a tile packed, a few hundred bytes: evidence of every cell, the rest only of occupied ones.
        None when nothing was seen there.
        """
        at = self._slices(key)
        evidence = self.arrays.evidence[at]
        if not evidence.any():
            return None
        occupied = evidence > 0
        rest = np.empty(int(np.count_nonzero(occupied)), dtype=OCCUPIED)
        for name in OCCUPIED.names or ():
            rest[name] = getattr(self.arrays, name)[at][occupied]
        return zlib.compress(evidence.tobytes() + rest.tobytes(), PACK_LEVEL)

    def _paste(self, key: tuple[int, int], tile: bytes) -> None:
        data = zlib.decompress(tile)
        evidence = np.frombuffer(data, dtype=np.int8, count=TILE * TILE).reshape(TILE, TILE)
        cells = np.zeros((TILE, TILE), dtype=OCCUPIED)
        cells["normal"] = kernels.NONE
        cells[evidence > 0] = np.frombuffer(data, dtype=OCCUPIED, offset=TILE * TILE)
        rest = (np.ascontiguousarray(cells[name]) for name in OCCUPIED.names or ())
        kernels.paste(self.arrays, self._tables.offsets, key[0] * TILE, key[1] * TILE, evidence, *rest)

    def tiles(self) -> dict[tuple[int, int], NDArray[np.int8]]:
        """Return the evidence of everything ever seen, by tile."""
        seen = {
            key: np.frombuffer(zlib.decompress(tile), dtype=np.int8, count=TILE * TILE).reshape(TILE, TILE)
            for key, tile in self.archive.items()
        }
        seen.update({key: self.arrays.evidence[self._slices(key)] for key in self._tiles()})
        return seen


class GrowingGmapping(RollingGmapping):
    """N particles on growing maps; the window is only the part at hand."""

    def __init__(self, config: SlamConfig, seed: int = 0) -> None:
        tile_m = TILE * config.resolution_m
        whole = replace(config, window_m=math.ceil(config.window_m / tile_m + 1.0 - 1e-9) * tile_m)
        super().__init__(replace(whole, max_range_m=config.usable_range_m(config.window_m)), seed)
        self._sample_share = config.grown_sample_share
        self._visits = 0
        self._since: list[tuple[int, Pose]] = []  # per scan: visits so far, and the motion since the last

    def update(self, scan: Scan, odometry: Odometry) -> SlamUpdate:
        """Use one scan; see GridSlam.update."""
        update = super().update(scan, odometry)
        past = self._particles[self._best].past
        assert past is not None  # noqa: S101
        self._since.append((self._visits, between(past.T_grid_base, update.T_grid_base)))
        return update

    def path(self) -> NDArray[np.float64]:
        """Return where the best particle believes each scan was taken, float64 (scans, 3), grid frame.

        A particle is a whole path: when a loop closes, the one that drifted least wins with all of its past.
        """
        poses: list[Pose] = []
        visit = self._particles[self._best].past
        while visit is not None:
            poses.append(visit.T_grid_base)
            visit = visit.before
        return np.array([compose(poses[-visits], since) for visits, since in self._since]).reshape(-1, 3)

    def _integrate(self, beams: Beams, match: ScanMatch | None) -> Pose:
        T_grid_base = super()._integrate(beams, match)
        for particle in self._particles:
            particle.past = Visit(particle.T_grid_base, particle.past)
        self._visits += 1
        return T_grid_base

    def view(self) -> GridView:
        """Return the best particle's whole map."""
        window = self._window()
        assert isinstance(window, ArchivedWindow)  # noqa: S101
        tiles = {key: tile for key, tile in window.tiles().items() if tile.any()}
        if not tiles:
            return super().view()
        keys = np.array(list(tiles))
        least, most = keys.min(axis=0), keys.max(axis=0)
        columns, rows = (most - least + 1) * TILE
        percent = np.full((rows, columns), -1, dtype=np.int8)
        table = percent_table()
        for (x, y), tile in tiles.items():
            row, col = (y - least[1]) * TILE, (x - least[0]) * TILE
            percent[row : row + TILE, col : col + TILE] = table[tile.astype(np.int64) + 128]
        percent.setflags(write=False)
        corner = least * TILE * self.config.resolution_m
        return GridView(
            self._stamp_s, percent, self.config.resolution_m, (float(corner[0]), float(corner[1]))
        )

    def _new_window(self) -> Window:
        return ArchivedWindow(self.config, self._tables, self._scratch)
