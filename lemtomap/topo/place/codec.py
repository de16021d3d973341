"""Obstacle boundary ⇄ bytes. Decimetre cells and, across the wall, offsets of a quarter cell.

A wall's place across itself is what a match needs; along itself a decimetre is enough. So each set cell
carries one small number: how far its points lie from the cell's middle along the boundary's normal, and the
normal follows from the cells around it, on both sides of the coding. And whether the wall was seen from in
front of that normal or from behind: a wall has two faces, and the other one stands where it does not.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from lemtomap.errors import BadMap
from lemtomap.topo.file.rows import MOST_PLACE_CELLS, PLACE_FORMAT
from lemtomap.topo.kernels import boundary as kernels

CELL_M = 0.1  # the file's
OFFSET_STEP_M = 0.025  # the file's: a quarter of a cell
NORMAL_REACH_CELLS = 2
SURE_SIDE = 0.2  # cosine of the mean look at a cell: glancing or from both sides, its front is not known
HEADER_BYTES = 2
MAX_RADIUS_M = MOST_PLACE_CELLS * CELL_M
DECODED_KEPT = 256  # boundaries, some 6 kB each: around the robot the same ones are asked for again
SHRINK = 0.95  # each try at the byte budget keeps at most this much of the radius


@dataclass(frozen=True, slots=True)
class Boundary:
    """A place's obstacle boundary in its node's frame."""

    points: NDArray[np.float32]
    """float32 (N, 2), metres."""
    normals: NDArray[np.float32]
    """float32 (N, 2), unit length, either of the two directions across the boundary."""
    fronts: NDArray[np.float32]
    """float32 (N, 2): the normal that points to where the boundary was seen from; (0, 0) where that is not
    known."""
    straightness: NDArray[np.float32]
    """float32 (N,): 1 where the normal is sure, 0 where the boundary has no direction (a corner, a leg)."""
    radius_m: float
    """Boundary further than this from the node (Chebyshev) is left out."""


def encode_place(
    points_node: NDArray[np.floating], radius_m: float = 5.0, byte_budget: int | None = None
) -> bytes:
    """Return the code of boundary points, float (N, 2), metres, node frame; NaN rows are left out.

    Two more columns say which way each was seen from (a vector of length up to 1).
    With a byte budget the radius shrinks until the code fits.
    """
    points = np.zeros((len(points_node), 4))
    points[:, : points_node.shape[1]] = points_node
    while True:
        cells = max(1, round(min(radius_m, MAX_RADIUS_M) / CELL_M))
        code = bytes([PLACE_FORMAT, cells]) + _encode(points, cells)
        if byte_budget is None or len(code) <= byte_budget or cells == 1:
            return code
        radius_m = min(SHRINK, (byte_budget / len(code)) ** 0.7) * cells * CELL_M


@lru_cache(DECODED_KEPT)
def decode_place(blob: bytes) -> Boundary:
    """Return the boundary of a code, to be read only. Raises BadMap for a code of another format."""
    if len(blob) < HEADER_BYTES or blob[0] != PLACE_FORMAT or blob[1] == 0:
        raise BadMap("localisation data of an unknown format")
    cells = blob[1]
    bitmap, levels, sides = _canvas(cells), _canvas(cells).astype(np.int8), _canvas(cells).astype(np.int8)
    data = np.frombuffer(blob, np.uint8, offset=HEADER_BYTES)
    kernels.decode(data, bitmap, levels, sides, NORMAL_REACH_CELLS)
    shape = kernels.cell_normals(bitmap, CELL_M, NORMAL_REACH_CELLS)
    offsets_m = levels[bitmap > 0].astype(np.float64) * OFFSET_STEP_M
    points = shape[:, :2] + offsets_m[:, None] * shape[:, 2:4]
    return Boundary(
        points.astype(np.float32),
        shape[:, 2:4].astype(np.float32),
        (shape[:, 2:4] * sides[bitmap > 0][:, None]).astype(np.float32),
        shape[:, 4].astype(np.float32),
        cells * CELL_M,
    )


def _encode(points: NDArray[np.float64], cells: int) -> bytes:
    bitmap = _canvas(cells)
    means = np.zeros((*bitmap.shape, 4))
    kernels.fill_bitmap(points, CELL_M, bitmap, means)
    shape = kernels.cell_normals(bitmap, CELL_M, NORMAL_REACH_CELLS)
    mean = means[bitmap > 0]
    across_m = np.sum((mean[:, :2] - shape[:, :2]) * shape[:, 2:4], axis=1)
    towards = np.sum(mean[:, 2:] * shape[:, 2:4], axis=1)
    limit = kernels.LEVELS // 2
    levels = _canvas(cells).astype(np.int8)
    steps = np.clip(np.rint(across_m / OFFSET_STEP_M), -limit, limit)
    levels[bitmap > 0] = np.where(shape[:, 4] < kernels.STRAIGHT, 0, steps)
    sides = _canvas(cells).astype(np.int8)
    is_sure = (shape[:, 4] >= kernels.STRAIGHT) & (np.abs(towards) >= SURE_SIDE)
    sides[bitmap > 0] = np.where(is_sure, np.sign(towards), 0)
    return bytes(kernels.encode(bitmap, levels, sides, NORMAL_REACH_CELLS))


def _canvas(cells: int) -> NDArray[np.uint8]:
    return np.zeros((2 * cells + 4, 2 * cells + 4), np.uint8)
