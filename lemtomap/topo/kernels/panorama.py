"""Flat loops of panoramas: the range to the nearest obstacle in each bearing, and how unlike two are.

Ranges are uint8 steps of RANGE_M, BEARINGS of them a full turn: OPEN where nothing stands within reach,
UNSEEN where nobody has looked.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Ranges = NDArray[np.uint8]
Values = NDArray[np.float64]

BEARINGS = 72
RANGE_M = 0.02  # of one step: a byte reaches five metres
OPEN = 250  # five metres: localisation data reach as far
UNSEEN = 255
MOST_UNLIKE = 50  # one metre: a chair moved, or a door shut, counts no more than that
AT_POINT_M = 0.1  # what is nearer stands where the robot would stand


@njit(nogil=True, cache=True)
def _look_round(points_m: Values, x_m: float, y_m: float, nothing: int, ranges: Ranges) -> None:
    ranges[:] = nothing
    for i in range(points_m.shape[0]):
        dx, dy = points_m[i, 0] - x_m, points_m[i, 1] - y_m
        range_m = np.hypot(dx, dy)
        if range_m < AT_POINT_M:
            continue
        bearing = int((np.arctan2(dy, dx) / (2.0 * np.pi) + 1.0) * BEARINGS) % BEARINGS
        steps = min(float(OPEN), range_m / RANGE_M)
        if ranges[bearing] == nothing or steps < ranges[bearing]:
            ranges[bearing] = int(steps)


@njit(nogil=True, cache=True)
def seen(points_base: Values) -> Ranges:
    """Return uint8 (BEARINGS,): what obstacle points, float64 (N, 2), look like from their origin."""
    ranges = np.empty(BEARINGS, dtype=np.uint8)
    _look_round(points_base, 0.0, 0.0, UNSEEN, ranges)
    return ranges


@njit(nogil=True, cache=True)
def stored(points_node: Values, standpoints_m: Values) -> Ranges:
    """Return uint8 (K, BEARINGS): what a place looks like from K points, float64 (K, 2)."""
    ranges = np.empty((standpoints_m.shape[0], BEARINGS), dtype=np.uint8)
    for k in range(standpoints_m.shape[0]):
        _look_round(points_node, standpoints_m[k, 0], standpoints_m[k, 1], OPEN, ranges[k])
    return ranges


@njit(nogil=True, cache=True)
def unlikeness(view: Ranges, places: Ranges) -> float:
    """Return how unlike a view, uint8 (BEARINGS,), is to the most alike of K panoramas at its best turn.

    0 to 1: the mean difference of range over the bearings seen, each at most MOST_UNLIKE; 1 when none is.
    """
    ahead = view.astype(np.int16)
    counts = np.zeros(BEARINGS, dtype=np.int16)
    looked = 0
    for b in range(BEARINGS):
        if view[b] != UNSEEN:
            counts[b] = 1
            looked += 1
    twice = np.empty(2 * BEARINGS, dtype=np.int16)
    least = MOST_UNLIKE * looked
    for k in range(places.shape[0]):
        twice[:BEARINGS] = places[k]
        twice[BEARINGS:] = places[k]
        for turn in range(BEARINGS):
            total = 0
            for b in range(BEARINGS):
                total += min(abs(ahead[b] - twice[turn + b]), MOST_UNLIKE) * counts[b]
            least = min(least, total)
    return least / (MOST_UNLIKE * looked) if looked else 1.0
