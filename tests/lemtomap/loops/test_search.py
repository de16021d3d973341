"""The correlative search against a slow twin, and what a match says."""

import numpy as np
import pytest

from lemtomap.se2 import (
    between,
    compose,
    inverse,
    transform,
)
from lemtomap.topo.kernels import fitting
from lemtomap.topo.kernels import search as kernels
from lemtomap.topo.loops.config import SearchConfig
from lemtomap.topo.loops.matcher import Reference, Search, SearchBox
from lemtomap.types import GridView

RESOLUTION_M = 0.05


def wall(x0, y0, x1, y1):
    n = int(np.hypot(x1 - x0, y1 - y0) / 0.05)
    return np.linspace((x0, y0), (x1, y1), n)


def room():
    """A room of 8 x 6 m without symmetry: one alcove, one pillar."""
    return np.concatenate(
        [
            wall(-4, -3, 4, -3),
            wall(4, -3, 4, 3),
            wall(4, 3, -1, 3),
            wall(-1, 3, -1, 2),
            wall(-1, 2, -4, 2),
            wall(-4, 2, -4, -3),
            wall(1.5, -1.0, 2.1, -1.0),
            wall(1.5, -1.0, 1.5, -0.4),
        ]
    )


def view_of(points_grid, size_m=14.0):
    cells = int(size_m / RESOLUTION_M)
    occupancy = np.full((cells, cells), 0, np.int8)
    index = np.floor((points_grid + size_m / 2) / RESOLUTION_M).astype(int)
    inside = ((index >= 0) & (index < cells)).all(axis=1)
    occupancy[index[inside, 1], index[inside, 0]] = 100
    return GridView(0.0, occupancy, RESOLUTION_M, (-size_m / 2, -size_m / 2))


def slow_score(field, points_cells, col, row, angle):
    cos, sin = np.cos(angle), np.sin(angle)
    c = np.floor(cos * points_cells[:, 0] - sin * points_cells[:, 1]).astype(int) + col
    r = np.floor(sin * points_cells[:, 0] + cos * points_cells[:, 1]).astype(int) + row
    inside = (c >= 0) & (c < field.shape[1]) & (r >= 0) & (r < field.shape[0])
    return int(field[r[inside], c[inside]].sum())


def test_four_blocks_summed_at_once_are_those_summed_one_by_one_unless_none_can_reach_the_least():
    rng = np.random.default_rng(5)
    layer = rng.integers(-40, 101, (40, 50)).astype(np.int16)
    cells = rng.integers(-6, 46, (100, 2)).astype(np.int32)
    keys = np.empty((2, 2), np.int64)
    for least in (-10_000, 1_500, 9_000):
        for col, row, side in ((0, 0, 1), (-5, 3, 4), (30, -20, 8), (3, 2, 2)):
            kernels.totals(layer, cells, col, row, side, least, keys)
            each = [
                [kernels.total(layer, cells, col + j * side, row + i * side) for j in (0, 1)] for i in (0, 1)
            ]
            assert keys.tolist() == each or (np.max(each) < least and keys.max() < least)


def test_a_blocks_bound_is_never_below_any_pose_in_it():
    rng = np.random.default_rng(3)
    field = rng.integers(-40, 101, (40, 50)).astype(np.int16)
    stack = kernels.pyramid(field, 5)
    points = rng.uniform(-12.0, 12.0, (25, 2))
    step = 1.0 / np.hypot(*points.T).max()
    for level in (1, 2, 3):
        side = 1 << level
        col, row, first = 17, 9, -4
        slack = 0.5 * (side - 1)
        limit = kernels.bound(stack, points, level, col, row, (first + slack) * step, slack)
        best = max(
            slow_score(field, points, col + i, row + j, (first + k) * step)
            for i in range(side)
            for j in range(side)
            for k in range(side)
        )
        assert limit >= best


def test_the_search_finds_the_best_pose_of_the_whole_box():
    rng = np.random.default_rng(5)
    points_place = room()[::7] + rng.normal(0.0, 0.02, room()[::7].shape)
    T_grid_place = np.array([0.43, -0.31, 0.2])
    config = SearchConfig(levels=4, least_score=0.2)
    reference = Reference(view_of(transform(T_grid_place, room())), transform(T_grid_place, room()), config)
    search = Search(reference, points_place, SearchBox(np.array([0.2, 0.0, 0.1]), 0.8, 0.8, 0.25))
    assert search.advance(10**9)
    cells = points_place / reference.cell_m
    step = search._angle_step_rad
    low, high = search._range[0::2], search._range[1::2]
    best = max(
        slow_score(reference.field, cells, col, row, search._angle_0_rad + k * step)
        for col in range(low[0], high[0])
        for row in range(low[1], high[1])
        for k in range(low[2], high[2])
    )
    assert search.match is not None
    assert round(search.match.score * 100 * len(cells)) == best


@pytest.mark.parametrize("budget", [50, 100_000])
def test_a_place_turned_half_round_is_found_to_the_centimetre_in_slices_of_any_size(budget):
    T_grid_place = np.array([0.83, -0.52, 3.0])
    points_grid = transform(T_grid_place, room())
    reference = Reference(view_of(points_grid), points_grid, SearchConfig())
    search = Search(reference, room()[::2], SearchBox(np.zeros(3), 2.0, 2.0, np.pi))
    slices, done, works = 1, False, [0]
    while not done:
        done = search.advance(budget)
        slices += not done
        works.append(search.work)
    assert np.diff(works).max() <= budget + 8  # what one block opens is done whole
    assert (slices > 1) == (budget == 50)
    off = between(T_grid_place, search.match.T_grid_place)
    assert np.hypot(off[0], off[1]) < 0.01
    assert abs(off[2]) < 0.003
    assert search.match.explained > 0.98
    assert search.match.rival < 0.8


def test_a_corridor_is_its_own_rival_and_says_that_it_holds_no_length():
    corridor = np.concatenate([wall(-9, -1, 9, -1), wall(-9, 1, 9, 1)])
    reference = Reference(view_of(corridor), corridor, SearchConfig())
    piece = corridor[np.abs(corridor[:, 0]) < 4.0]
    search = Search(reference, piece, SearchBox(np.zeros(3), 2.0, 1.0, 0.3))
    search.advance(10**9)
    assert search.match.rival > 0.97
    assert search.match.weakest < 0.02
    assert search.match.covariance[0, 0] > 25 * search.match.covariance[1, 1]


def test_free_space_contradicts_a_place_that_is_not_here():
    points = room()
    elsewhere = transform(np.array([0.0, 0.0, 0.7]), points * 0.8)
    reference = Reference(view_of(elsewhere), elsewhere, SearchConfig(least_score=0.05))
    match = reference.refine(points, np.zeros(3))
    assert match.contradicted > 0.4
    assert match.explained < 0.6


def test_tally_counts_as_its_slow_twin_does():
    rng = np.random.default_rng(1)
    field = rng.integers(-1, 2, (30, 30)).astype(np.int16) * 50
    points = rng.uniform(-2.0, 2.0, (200, 2))
    T = np.array([1.4, 1.6, 0.8])
    values = []
    for x, y in transform(T, points):
        r, c = int(np.floor(y / 0.1)), int(np.floor(x / 0.1))
        values.append(field[r, c] if 0 <= r < 30 and 0 <= c < 30 else 0)
    values = np.array(values)
    expected = ((values > 0).sum(), (values < 0).sum(), (values == 0).sum())
    assert fitting.tally(points, T, field, 0.0, 0.0, 0.1) == expected


def test_covariance_is_in_the_places_own_axes():
    T_grid_place = np.array([0.1, 0.2, np.pi / 2])
    corridor = np.concatenate([wall(-6, -1, 6, -1), wall(-6, 1, 6, 1)])
    reference = Reference(view_of(corridor), corridor, SearchConfig())
    own = transform(inverse(T_grid_place), corridor)
    match = reference.refine(own, compose(T_grid_place, np.array([0.0, 0.02, 0.0])))
    assert match.covariance[1, 1] > 25 * match.covariance[0, 0]


def test_a_search_with_too_little_room_for_its_blocks_ends_and_says_so():
    """Eight children at most come of one block: with fewer places left the search is given up, unharmed."""
    reference = Reference(view_of(room()), room(), SearchConfig())
    cells = np.ascontiguousarray(room() / reference.cell_m)
    box = np.array([90, 190, 90, 190, 0, 60], np.int64)
    keys, blocks = np.full(64, -1, np.int64), np.zeros((64, 4), np.int32)
    shared = (0.0, np.pi / 30, 1)
    lists = (keys[:24], blocks[:24])
    size, _, planted = kernels.plant(
        reference.stack, cells, SearchConfig().levels - 2, box, *shared, *lists, 0, 0, 10**6
    )
    assert (size, planted) == (24, -1)
    state, size, *_ = kernels.dig(
        reference.stack, cells, box, np.zeros(6, np.int64), *shared, *lists, size, 10**9
    )
    assert state == 3
    assert size <= 24
    assert (keys[24:] == -1).all()
