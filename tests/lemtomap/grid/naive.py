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
        for side in (range(i - 1, max(i - 13, -1), -1), range(i + 1, min(i + 13, len(hits)))):
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
