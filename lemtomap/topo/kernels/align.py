"""Jitted matching of a place's boundary against the hits in the window."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Values = NDArray[np.float64]
Singles = NDArray[np.float32]
Indices = NDArray[np.int32]
Cells = NDArray[np.int8]

OTHER_FACE = -0.2  # cosine; a glancing look at a face that is not quite straight still sees its front


@njit(nogil=True, cache=True)
def nearest_field(
    targets: Values, low_x: float, low_y: float, cell: float, size: int, reach: float
) -> Indices:
    """Return for each cell (size, size) the index of a nearest target, -1 beyond `reach` metres.

    Two sweeps of vector propagation (Danielsson 1980): right to a fraction of a cell.
    """
    field = np.full((size, size), -1, np.int32)
    for k in range(targets.shape[0]):
        c = math.floor((targets[k, 0] - low_x) / cell)
        r = math.floor((targets[k, 1] - low_y) / cell)
        if 0 <= r < size and 0 <= c < size:
            field[r, c] = k
    # one swept row after the other; a cell whose neighbours on the swept side are empty has nothing to take
    reach_sq = reach * reach
    for sweep in range(2):
        dr = -1 if sweep == 0 else 1
        for step in range(size):
            r = step if sweep == 0 else size - 1 - step
            y = low_y + (r + 0.5) * cell
            beside = r + dr if 0 <= r + dr < size else -1
            for side in range(2):
                dc = -1 if side == 0 else 1
                behind = -1  # what the cell just swept holds
                for across in range(size):
                    c = across if side == 0 else size - 1 - across
                    best = field[r, c]
                    above = left = right = -1
                    if beside >= 0:
                        above = field[beside, c]
                        left = field[beside, c + dc] if 0 <= c + dc < size else -1
                        right = field[beside, c - dc] if 0 <= c - dc < size else -1
                    if above < 0 and behind < 0 and left < 0 and right < 0:
                        behind = best
                        continue
                    if best == above and best == behind and best == left and best == right:
                        behind = best
                        continue
                    x = low_x + (c + 0.5) * cell
                    best_sq = reach_sq
                    if best >= 0:
                        best_sq = (targets[best, 0] - x) ** 2 + (targets[best, 1] - y) ** 2
                    for k in (above, behind, left, right):
                        if k >= 0 and k != best:
                            sq = (targets[k, 0] - x) ** 2 + (targets[k, 1] - y) ** 2
                            if sq < best_sq:
                                best, best_sq = k, sq
                    field[r, c] = best
                    behind = best
    return field


@njit(nogil=True, cache=True)
def seen_cells(
    occupancy: Cells,
    resolution: float,
    origin_x: float,
    origin_y: float,
    low_x: float,
    low_y: float,
    cell: float,
    size: int,
) -> Cells:
    """Return for each cell of a field, int8 (size, size), 1 where the window knows its middle."""
    rows, cols = occupancy.shape
    seen = np.zeros((size, size), np.int8)
    for r in range(size):
        i = math.floor((low_y + (r + 0.5) * cell - origin_y) / resolution)
        for c in range(size):
            j = math.floor((low_x + (c + 0.5) * cell - origin_x) / resolution)
            if 0 <= i < rows and 0 <= j < cols and occupancy[i, j] >= 0:
                seen[r, c] = 1
    return seen


@njit(nogil=True, cache=True)
def same_face(nx: float, ny: float, targets: Values, t: int) -> bool:
    """Return True if a boundary whose front looks along (nx, ny) can be what was hit there.

    A wall has two faces: what shows its back to where the hit was seen from is the other one, as far away as
    the wall is thick. (0, 0) stands for a front that is not known.
    """
    return bool(nx * targets[t, 2] + ny * targets[t, 3] > OTHER_FACE)


@njit(nogil=True, cache=True)
def fit(
    points: Singles,
    fronts: Singles,
    normals: Singles,
    targets: Values,
    field: Indices,
    seen: Cells,
    low_x: float,
    low_y: float,
    cell: float,
    pose: Values,
    sigma: float,
    usual: float,
) -> float:
    """Return how well points fit at a pose, 0..1: mean of exp(-d^2 / 2 sigma^2) to the nearest targets.

    fronts, float32 (N, 2): which way each point's face looks, (0, 0) where that is not known. What falls
    where the window has seen nothing, and past the end of what it has seen rather than behind it, counts as
    `usual`: else the best pose would be the one that shifts the most of a wall back into sight.
    """
    size = field.shape[0]
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    total = 0.0
    for k in range(points.shape[0]):
        x = pose[0] + cos * points[k, 0] - sin * points[k, 1]
        y = pose[1] + sin * points[k, 0] + cos * points[k, 1]
        c, r = math.floor((x - low_x) / cell), math.floor((y - low_y) / cell)
        if not (0 <= r < size and 0 <= c < size):
            total += usual
            continue
        t = field[r, c]
        if t >= 0:
            fx = cos * fronts[k, 0] - sin * fronts[k, 1]
            fy = sin * fronts[k, 0] + cos * fronts[k, 1]
            if not same_face(fx, fy, targets, t):
                continue
            dx, dy = targets[t, 0] - x, targets[t, 1] - y
            nx = cos * normals[k, 0] - sin * normals[k, 1]
            ny = sin * normals[k, 0] + cos * normals[k, 1]
            across, along = abs(nx * dx + ny * dy), abs(nx * dy - ny * dx)
            if seen[r, c] or along <= max(across, 2.0 * cell):
                total += math.exp(-0.5 * (dx * dx + dy * dy) / (sigma * sigma))
                continue
        if not seen[r, c]:
            total += usual
    return float(total / max(1, points.shape[0]))


@njit(nogil=True, cache=True)
def search(
    points: Singles,
    fronts: Singles,
    normals: Singles,
    targets: Values,
    field: Indices,
    seen: Cells,
    low_x: float,
    low_y: float,
    cell: float,
    centre: Values,
    half_m: float,
    step_m: float,
    half_rad: float,
    step_rad: float,
    sigma: float,
    usual: float,
    apart_m: float,
) -> Values:
    """Return the best pose of a regular search around a centre, its fit, and the best fit elsewhere.

    float64 (5,). Elsewhere is further than `apart_m` from the best; -1 when the search goes no further.
    """
    shifts, turns = math.ceil(half_m / step_m), math.ceil(half_rad / step_rad)
    fits = np.empty((2 * shifts + 1, 2 * shifts + 1))
    out = np.array([centre[0], centre[1], centre[2], -1.0, -1.0])
    best_i, best_j = 0, 0
    pose = np.empty(3)
    for i in range(-shifts, shifts + 1):
        pose[0] = centre[0] + i * step_m
        for j in range(-shifts, shifts + 1):
            pose[1] = centre[1] + j * step_m
            fits[i + shifts, j + shifts] = -1.0
            for t in range(-turns, turns + 1):
                pose[2] = centre[2] + t * step_rad
                value = fit(
                    points, fronts, normals, targets, field, seen, low_x, low_y, cell, pose, sigma, usual
                )
                fits[i + shifts, j + shifts] = max(fits[i + shifts, j + shifts], value)
                if value > out[3]:
                    out[:3] = pose
                    out[3] = value
                    best_i, best_j = i, j
    for i in range(-shifts, shifts + 1):
        for j in range(-shifts, shifts + 1):
            if math.hypot(i - best_i, j - best_j) * step_m > apart_m:
                out[4] = max(out[4], fits[i + shifts, j + shifts])
    return out


@njit(nogil=True, cache=True)
def refine_system(
    points: Singles,
    fronts: Singles,
    normals: Singles,
    straightness: Singles,
    targets: Values,
    lines: Values,
    field: Indices,
    low_x: float,
    low_y: float,
    cell: float,
    pose: Values,
    sigma: float,
    reach: float,
) -> tuple[Values, Values, float, float]:
    """Return (H, g, sum of weights, weighted squared error) of one point-to-line Gauss-Newton step.

    Axes: x and y of the grid frame and the yaw of the place about its own origin. Where neither the boundary
    nor the hits (lines, float64 (T, 3): normal of each target and how straight) have a direction the point
    itself is matched. Cauchy weights at `sigma`; nothing is matched beyond `reach`.
    """
    size = field.shape[0]
    H, g = np.zeros((3, 3)), np.zeros(3)
    J = np.empty(3)
    total, error = 0.0, 0.0
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    for k in range(points.shape[0]):
        px, py = cos * points[k, 0] - sin * points[k, 1], sin * points[k, 0] + cos * points[k, 1]
        c = math.floor((pose[0] + px - low_x) / cell)
        r = math.floor((pose[1] + py - low_y) / cell)
        if not (0 <= r < size and 0 <= c < size) or field[r, c] < 0:
            continue
        t = field[r, c]
        fx = cos * fronts[k, 0] - sin * fronts[k, 1]
        fy = sin * fronts[k, 0] + cos * fronts[k, 1]
        if not same_face(fx, fy, targets, t):
            continue
        dx, dy = pose[0] + px - targets[t, 0], pose[1] + py - targets[t, 1]
        if dx * dx + dy * dy > reach * reach:
            continue
        nx, ny = (
            cos * normals[k, 0] - sin * normals[k, 1],
            sin * normals[k, 0] + cos * normals[k, 1],
        )
        for axis in range(2):
            strength = 1.0
            if axis == 1:
                nx, ny = -ny, nx
                strength = (1.0 - straightness[k]) * (1.0 - lines[t, 2])
                if strength < 0.3:
                    continue
            e = nx * dx + ny * dy
            weight = strength / (1.0 + (e / sigma) ** 2)
            J[0], J[1], J[2] = nx, ny, -nx * py + ny * px
            for p in range(3):
                g[p] += weight * J[p] * e
                for q in range(3):
                    H[p, q] += weight * J[p] * J[q]
            total += weight
            error += weight * e * e
    return H, g, total, error


@njit(nogil=True, cache=True)
def explained(
    points: Singles,
    targets: Values,
    field: Indices,
    low_x: float,
    low_y: float,
    cell: float,
    pose: Values,
    within: float,
    occupancy: Cells,
    resolution: float,
    origin_x: float,
    origin_y: float,
    occupied_from: int,
) -> tuple[int, int]:
    """Return (points the window knows about, those of them that are there).

    A point is there when a target or an occupied cell lies within `within` metres: what was seen once from
    afar has too few hits for a target. A point in a free cell with nothing near contradicts.
    """
    size = field.shape[0]
    rows, cols = occupancy.shape
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    known, near = 0, 0
    reach = math.floor(within / resolution)
    for k in range(points.shape[0]):
        x = pose[0] + cos * points[k, 0] - sin * points[k, 1]
        y = pose[1] + sin * points[k, 0] + cos * points[k, 1]
        i, j = math.floor((y - origin_y) / resolution), math.floor((x - origin_x) / resolution)
        c, r = math.floor((x - low_x) / cell), math.floor((y - low_y) / cell)
        if 0 <= r < size and 0 <= c < size and field[r, c] >= 0:
            t = field[r, c]
            if (targets[t, 0] - x) ** 2 + (targets[t, 1] - y) ** 2 <= within * within:
                known += 1
                near += 1
                continue
        if 0 <= i < rows and 0 <= j < cols and occupancy[i, j] >= 0:
            known += 1
            near += occupied_near(occupancy, i, j, reach, occupied_from)
    return known, near


@njit(nogil=True, cache=True)
def occupied_near(occupancy: Cells, row: int, col: int, reach: int, occupied_from: int) -> int:
    """Return 1 when an occupied cell lies within `reach` cells, else 0."""
    rows, cols = occupancy.shape
    for r in range(max(row - reach, 0), min(row + reach + 1, rows)):
        for c in range(max(col - reach, 0), min(col + reach + 1, cols)):
            if (r - row) ** 2 + (c - col) ** 2 <= reach * reach and occupancy[r, c] >= occupied_from:
                return 1
    return 0
