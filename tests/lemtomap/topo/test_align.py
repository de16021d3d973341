import numpy as np
import pytest

from lemtomap.se2 import between, compose, inverse, pose, transform
from lemtomap.topo.align import HitMap, MatchConfig, match_place
from lemtomap.topo.place import decode_place, encode_place
from lemtomap.types import GridView
from tests.lemtomap.topo.test_place import office

PRIOR = np.diag([0.15**2, 0.15**2, 0.06**2])


def window_of(points, size_m=20.0, cell=0.05):
    """A window that saw these points (grid frame) and everything between them."""
    cells = round(size_m / cell)
    occupancy = np.zeros((cells, cells), np.int8)
    rows = np.floor((points[:, 1] + size_m / 2) / cell).astype(int)
    cols = np.floor((points[:, 0] + size_m / 2) / cell).astype(int)
    inside = (rows >= 0) & (cols >= 0) & (rows < cells) & (cols < cells)
    occupancy[rows[inside], cols[inside]] = 100
    return GridView(0.0, occupancy, cell, (-size_m / 2, -size_m / 2))


def at_node(points):
    return decode_place(encode_place(points))


@pytest.mark.parametrize("seed", range(4))
def test_a_place_is_found_within_two_centimetres_where_the_prediction_was_off(seed):
    rng = np.random.default_rng(seed)
    T_grid_node = pose(0.7, -0.4, rng.uniform(-3, 3))
    hits = transform(T_grid_node, office(noise_m=0.01, seed=seed + 10))
    predicted = compose(T_grid_node, rng.normal(0, [0.12, 0.12, 0.05]))
    match = match_place(at_node(office(seed=seed)), hits, window_of(hits), (predicted, PRIOR), MatchConfig())
    error = between(T_grid_node, match.T_grid_node)
    assert match.refused == ""
    assert match.score > 0.95
    assert np.hypot(error[0], error[1]) < 0.02
    assert abs(error[2]) < np.deg2rad(0.5)
    assert error @ np.linalg.solve(match.covariance, error) < 16.0


def test_without_scan_points_the_window_alone_will_do():
    points = office(noise_m=0.01, seed=11)
    grid = window_of(points)
    hits = HitMap().around((0.0, 0.0), 6.0, grid, 50)
    match = match_place(at_node(office()), hits, grid, (pose(0.1, -0.12, 0.05), PRIOR), MatchConfig())
    assert match.refused == ""
    assert np.hypot(match.T_grid_node[0], match.T_grid_node[1]) < 0.04


def corridor(length_m=4.8):
    x = np.arange(-length_m, length_m, 0.02)
    return np.concatenate([np.c_[x, np.full_like(x, 1.0)], np.c_[x, np.full_like(x, -1.0)]])


def test_along_a_bare_corridor_the_prediction_stands_and_says_how_uncertain_it_is():
    hits = corridor(8.0)
    predicted = pose(0.2, 0.1, 0.03)
    match = match_place(at_node(corridor()), hits, window_of(hits), (predicted, PRIOR), MatchConfig())
    assert match.refused == ""
    assert abs(match.T_grid_node[1]) < 0.02
    assert match.T_grid_node[0] == pytest.approx(0.2, abs=0.15)
    along, across = match.covariance[0, 0], match.covariance[1, 1]
    assert along > 20 * across
    assert along == pytest.approx(PRIOR[0, 0], rel=0.5)


def test_another_place_is_refused_and_the_prediction_kept():
    hits = corridor(8.0)
    hits = transform(pose(0.0, 0.0, 0.6), hits)
    predicted = (pose(0.3, 0.2, 0.1), PRIOR)
    match = match_place(at_node(office()), hits, window_of(hits), predicted, MatchConfig())
    assert "is seen" in match.refused or "expects" in match.refused
    np.testing.assert_array_equal(match.T_grid_node, predicted[0])


def test_a_place_the_window_hardly_knows_is_refused():
    points = office()
    few = points[points[:, 0] > 2.9]
    unknown = window_of(few)
    unknown.occupancy[unknown.occupancy == 0] = -1
    match = match_place(at_node(points), few, unknown, (pose(0, 0, 0), PRIOR), MatchConfig())
    assert "too little" in match.refused


def test_the_hit_map_forgets_what_lies_a_map_size_behind():
    hits = HitMap(size_m=24.0)
    points = office()
    for k in range(3):
        hits.add(pose(0.2 * k, 0, 0), transform(inverse(pose(0.2 * k, 0, 0)), points))
    grid = window_of(points)
    assert len(hits.around((0.0, 0.0), 6.0, grid, 50)) > 300
    far = points + np.array([24.0, 0.0])
    for k in range(3):
        hits.add(pose(24.0 + 0.2 * k, 0, 0), transform(inverse(pose(24.0 + 0.2 * k, 0, 0)), far))
    assert len(hits.around((0.0, 0.0), 6.0, grid, 50)) == 0


def test_hits_the_window_no_longer_believes_are_left_out():
    hits = HitMap()
    points = office()
    for k in range(3):
        hits.add(pose(0.2 * k, 0, 0), transform(inverse(pose(0.2 * k, 0, 0)), points))
    grid = window_of(points[points[:, 0] < 1.0])
    assert hits.around((0.0, 0.0), 6.0, grid, 50)[:, 0].max() < 1.2


def seen_from(points, side):
    """The same points with the direction they were seen from: along the corridor, from in front or behind."""
    whence = np.tile([float(side), 0.0], (len(points), 1))
    whence[np.abs(points[:, 1]) > 0.98] = 0.0  # the corridor's walls at a glance
    return np.c_[points, whence]


def piers(x0_m, x1_m):
    """A corridor with piers standing out of its walls, only their faces at these ways along it."""
    y = np.r_[np.arange(0.4, 0.98, 0.02), np.arange(-0.98, -0.4, 0.02)]
    return np.concatenate([corridor(), np.c_[np.full_like(y, x0_m), y], np.c_[np.full_like(y, x1_m), y]])


@pytest.mark.parametrize(("side", "off_m"), [(1.0, 0.2), (-1.0, 0.0)])
def test_the_far_face_of_a_wall_is_not_taken_for_its_near_one(side, off_m):
    """Driving back the robot sees the piers' other faces, 0.2 m further on; the first time it saw these."""
    place = decode_place(encode_place(seen_from(piers(1.5, -2.5), -1.0)))
    hits = seen_from(piers(1.5 + off_m, -2.5 + off_m), side)
    predicted = pose(0.05, 0.02, 0.01)
    match = match_place(place, hits, window_of(hits), (predicted, PRIOR), MatchConfig())
    assert match.refused == ""
    assert abs(match.T_grid_node[0] - (0.05 if off_m else 0.0)) < 0.03
    assert abs(match.T_grid_node[1]) < 0.02
