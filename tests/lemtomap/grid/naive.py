"""Slow, obvious twins of the kernels: one thought per line, dictionaries of cells instead of ring buffers."""

import math
from itertools import pairwise

import numpy as np


def cells_of(window):
    """Return {(gx, gy): evidence} of every cell of a window that was ever seen."""
    n, (ox, oy) = window.cells, window.arrays.origin
    evidence = window.arrays.evidence
    return {
        (gx, gy): int(evidence[gy % n, gx % n])
        for gy in range(oy, oy + n)
        for gx in range(ox, ox + n)
        if evidence[gy % n, gx % n] != 0
    }


def cells_between(x0, y0, x1, y1, resolution):
    """Return the cells that a segment enters but its last: every crossing of a grid line, sorted."""
    crossings = [0.0]
    for start, end in ((x0, x1), (y0, y1)):
        if start != end:
            first, last = sorted((start, end))
            lines = range(math.ceil(first / resolution), math.floor(last / resolution) + 1)
            crossings += [(line * resolution - start) / (end - start) for line in lines]
    crossings = sorted([*crossings, 1.0])
    cells = []
    for a, b in pairwise(crossings):
        t = 0.5 * (a + b)
        x, y = x0 + t * (x1 - x0), y0 + t * (y1 - y0)
        cell = (math.floor(x / resolution), math.floor(y / resolution))
        if b > a and cell not in cells:
            cells.append(cell)
    end = (math.floor(x1 / resolution), math.floor(y1 / resolution))
    return [cell for cell in cells if cell != end]


def integrated(cells, beams, pose, config):
    """Return {(gx, gy): evidence} after one scan: a cell moves once, and a hit wins over a miss."""
    resolution = config.resolution_m
    c, s = math.cos(pose[2]), math.sin(pose[2])

    def to_grid(p):
        return pose[0] + c * float(p[0]) - s * float(p[1]), pose[1] + s * float(p[0]) + c * float(p[1])

    hits = {tuple(math.floor(v / resolution) for v in to_grid(p)) for p in beams.hits}
    laser = to_grid(beams.laser_base)
    misses = set()
    for p in [*beams.hits, *beams.cuts]:
        misses |= set(cells_between(*laser, *to_grid(p), resolution))
    after = dict(cells)
    for cell in hits:
        after[cell] = min(after.get(cell, 0) + config.evidence_hit, config.evidence_ceiling) or 1
    for cell in misses - hits:
        after[cell] = max((after.get(cell, 0) - config.evidence_miss) or -1, config.evidence_floor)
    return after


def nearest_distance(cells, cell, reach):
    """Return the distance in cells to the nearest occupied cell, or infinity beyond reach."""
    gaps = [math.dist(cell, other) for other, evidence in cells.items() if evidence > 0]
    best = min(gaps, default=math.inf)
    return best if best <= reach else math.inf


def closeness_score(points, pose, cells, reach_m, resolution):
    """Return the mean of exp(-d^2 / 2 reach^2), d from each point's cell to the nearest occupied cell."""
    total = 0.0
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for x, y in np.asarray(points, dtype=float):
        gx = math.floor((pose[0] + c * x - s * y) / resolution)
        gy = math.floor((pose[1] + s * x + c * y) / resolution)
        gap = nearest_distance(cells, (gx, gy), 8.9)
        total += math.exp(-0.5 * (gap * resolution / reach_m) ** 2)
    return total / len(points)


def surface_normals(hits):
    """Return the direction across the line through the nearest neighbours 0.1 m off to either side, NaN where
    they are missing, unlike in distance, or off the line.
    """
    normals = []
    for i, hit in enumerate(hits):
        arms = []
        for side in (range(i - 1, max(i - 65, -1), -1), range(i + 1, min(i + 65, len(hits)))):
            arms += [hits[j] - hit for j in side if math.dist(hits[j], hit) >= 0.1][:1]
        normals.append(_across(*arms) if len(arms) == 2 else math.nan)
    return np.array(normals)


def _across(left, right):
    short, long = sorted((math.hypot(*left), math.hypot(*right)))
    chord = right - left
    length = math.hypot(*chord)
    if long > 2.0 or long > 3.0 * short or length <= long:
        return math.nan
    off_m = abs(left[0] * right[1] - left[1] * right[0]) / length
    return math.nan if off_m > 0.03 else math.atan2(chord[1], chord[0]) + math.pi / 2


def normal_equations(beams, pose, window, normals, sigma_m, point_weight):
    """Return H (3, 3), b (3,) and the sum of weights of the point-to-line match, point by point."""
    n, size = window.cells, window.resolution_m
    arrays = window.arrays
    occupied = [cell for cell, evidence in cells_of(window).items() if evidence > 0]
    H, b, total = np.zeros((3, 3)), np.zeros(3), 0.0
    c, s = math.cos(pose[2]), math.sin(pose[2])
    laser = np.array([c * beams.laser_base[0], s * beams.laser_base[0]]) + pose[:2]
    laser += np.array([-s * beams.laser_base[1], c * beams.laser_base[1]])
    for (px, py), seen_rad in zip(np.asarray(beams.hits, dtype=float), beams.normals_rad, strict=True):
        arm = np.array([c * px - s * py, s * px + c * py])
        point = arm + pose[:2]
        here = tuple(math.floor(v / size) for v in point)
        gx, gy = min(occupied, key=lambda cell, here=here: _nearness(cell, here))
        if _nearness((gx, gy), here)[0] > 79:  # beyond the 254 nearest steps
            continue
        at = gy % n, gx % n
        error = (np.array([gx, gy]) + arrays.mean[at] / 65535.0) * size - point
        weight = math.exp(-0.5 * float(error @ error) / sigma_m**2)
        code = int(arrays.normal[at])
        if code != 255:
            axes, strength = [normals[code].astype(float)], weight
            error = error + arrays.lift[at] / 254.0 * size * axes[0]
        elif not math.isnan(seen_rad):
            angle = float(seen_rad) + pose[2]
            axes, strength = [np.array([math.cos(angle), math.sin(angle)])], weight
        else:
            axes, strength = [np.array([1.0, 0.0]), np.array([0.0, 1.0])], point_weight * weight
        if len(axes) == 1 and _other_face(axes[0], arrays.whence[at] / 127.0, laser - point):
            continue
        total += weight
        for axis in axes:
            row = np.array([axis[0], axis[1], axis @ np.array([-arm[1], arm[0]])])
            H += strength * np.outer(row, row)
            b += strength * row * float(axis @ error)
    return H, b, total


def _other_face(axis, whence, to_laser):
    """Return True if two looks at a surface are sure to come from its two sides."""
    then, now = float(axis @ whence), float(axis @ to_laser) / math.hypot(*to_laser)
    return then * now < 0.0 and min(abs(then), abs(now)) >= 0.1


def _nearness(cell, here):
    dx, dy = cell[0] - here[0], cell[1] - here[1]
    return dx * dx + dy * dy, abs(dx) + abs(dy), (dx, dy)


def gated(H, b, gate):
    """Return H and b with the weak axis of the surfaces weighed by 0 at the gate to 1 at twice the gate."""
    spread, axes = np.linalg.eigh(H[:2, :2])
    diversity = 2.0 * spread[0] / spread.sum()
    kept = min(max(diversity / gate - 1.0, 0.0), 1.0)
    weak = np.outer(axes[:, 0], axes[:, 0])
    P, Q = np.eye(3), np.eye(3)
    P[:2, :2] -= (1.0 - math.sqrt(kept)) * weak
    Q[:2, :2] -= (1.0 - kept) * weak
    return P @ H @ P, Q @ b, diversity
