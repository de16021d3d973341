import numpy as np
import pytest

from lemtomap.se2 import (
    between,
    compose,
    inverse,
    pose,
    transform,
)
from lemtomap.topo.kernels import gathering
from lemtomap.topo.place import decode_place, encode_place
from lemtomap.topo.place.align import AlignConfig, match_place
from lemtomap.topo.place.hits import HitMap
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
    match = match_place(at_node(office(seed=seed)), hits, window_of(hits), (predicted, PRIOR), AlignConfig())
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
    match = match_place(at_node(office()), hits, grid, (pose(0.1, -0.12, 0.05), PRIOR), AlignConfig())
    assert match.refused == ""
    assert np.hypot(match.T_grid_node[0], match.T_grid_node[1]) < 0.04


def corridor(length_m=4.8):
    x = np.arange(-length_m, length_m, 0.02)
    return np.concatenate([np.c_[x, np.full_like(x, 1.0)], np.c_[x, np.full_like(x, -1.0)]])


def test_along_a_bare_corridor_the_prediction_stands_and_says_how_uncertain_it_is():
    hits = corridor(8.0)
    predicted = pose(0.2, 0.1, 0.03)
    match = match_place(at_node(corridor()), hits, window_of(hits), (predicted, PRIOR), AlignConfig())
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
    match = match_place(at_node(office()), hits, window_of(hits), predicted, AlignConfig())
    assert "is seen" in match.refused or "expects" in match.refused
    np.testing.assert_array_equal(match.T_grid_node, predicted[0])


def test_a_place_the_window_hardly_knows_is_refused():
    points = office()
    few = points[points[:, 0] > 2.9]
    unknown = window_of(few)
    unknown.occupancy[unknown.occupancy == 0] = -1
    match = match_place(at_node(points), few, unknown, (pose(0, 0, 0), PRIOR), AlignConfig())
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


def test_cells_hit_too_long_ago_are_given_back_and_start_anew():
    """Never given back they were passed over one by one at every node, in time most of the ring."""
    owner, taken = np.full((480, 480, 2), np.iinfo(np.int32).min, np.int32), np.zeros((480, 480), np.int8)
    ring, wall, at = (owner, taken, np.zeros((480, 480, 6))), office(), pose(0, 0, 0)
    window = (window_of(wall).occupancy, 0.05, *window_of(wall).origin_m, 50)
    for now_m in (0.0, 0.2, 0.4):
        gathering.add_hits(wall, at, 0.05, *ring, now_m, 10.0)
    assert len(gathering.collect_hits(*ring, 0.05, 0.0, 0.0, 6.0, 2.0, 0.1, *window)) > 300
    assert taken.sum() > 300
    assert len(gathering.collect_hits(*ring, 0.05, 0.0, 0.0, 6.0, 2.0, 2.0, *window)) == 0
    assert taken.sum() == 0
    gathering.add_hits(wall[:1], at, 0.05, *ring, 12.0, 10.0)
    assert taken.sum() == 1
    assert ring[2][taken > 0][0, 2] == 1.0


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
    match = match_place(place, hits, window_of(hits), (predicted, PRIOR), AlignConfig())
    assert match.refused == ""
    assert abs(match.T_grid_node[0] - (0.05 if off_m else 0.0)) < 0.03
    assert abs(match.T_grid_node[1]) < 0.02


def half_seen(hits, low, high):
    """A window that knows nothing but what lies between two corners, float (2,), metres."""
    window = window_of(hits)
    rows, cols = np.indices(window.occupancy.shape)
    x, y = cols * 0.05 - 10.0, rows * 0.05 - 10.0
    inside = (x >= low[0]) & (y >= low[1]) & (x <= high[0]) & (y <= high[1])
    window.occupancy[~inside & (window.occupancy == 0)] = -1
    return window


def test_a_wall_that_goes_on_out_of_sight_is_not_pulled_into_view():
    """The window has seen the nearer part of the place's wall alone, nothing of the room at its end."""
    x, y, shelf = np.arange(-4.5, 2.5, 0.02), np.arange(0.6, 3.0, 0.02), np.arange(-4.5, -2.0, 0.05)
    thick = [np.c_[shelf, np.full_like(shelf, high)] for high in (0.65, 0.75)]
    place = np.concatenate([np.c_[x, np.full_like(x, 0.55)], *thick, np.c_[np.full_like(y, -2.0), y]])
    far = np.arange(-1.9, 8.0, 0.02)
    hits = np.c_[far, np.full_like(far, 0.555)]
    window = half_seen(hits, (-1.9, -1.0), (8.0, 0.6))
    predicted = pose(0.1, 0.0, 0.0)
    prior = np.diag([0.17**2, 0.01**2, 0.01**2])
    match = match_place(at_node(place), hits, window, (predicted, prior), AlignConfig())
    assert match.T_grid_node[0] == pytest.approx(0.1, abs=0.05)
    assert match.covariance[0, 0] > 0.1**2


@pytest.mark.parametrize("sigma_m", [0.2, 0.32])
def test_a_wall_across_a_corridor_is_found_however_far_the_search_goes(sigma_m):
    y = np.arange(-3.5, -0.6, 0.02)
    x = np.arange(-4.9, 4.9, 0.02)
    wall, far = np.c_[x, np.full_like(x, 1.8)], np.arange(2.0, 4.9, 0.02)
    across = np.c_[np.full_like(y, 2.0), y]
    place = np.concatenate([wall, across, np.c_[far, np.full_like(far, -0.6)]])
    hits = np.concatenate([wall[x < 3.0], across])
    window = half_seen(hits, (-6.0, -4.0), (2.05, 1.85))
    predicted = pose(0.26, 0.0, 0.0)
    prior = np.diag([sigma_m**2, 0.01**2, 0.01**2])
    match = match_place(at_node(place), hits, window, (predicted, prior), AlignConfig())
    assert match.refused == ""
    assert abs(match.T_grid_node[0]) < 0.03


def test_a_corridor_a_degree_askew_does_not_slide_the_place_along():
    hits = transform(pose(0.0, 0.02, 0.015), corridor(8.0))
    prior = np.diag([0.24**2, 0.007**2, 0.004**2])
    predicted = pose(0.0, 0.0, 0.0)
    match = match_place(at_node(corridor()), hits, window_of(hits), (predicted, prior), AlignConfig())
    assert match.refused == ""
    assert abs(match.T_grid_node[0]) < 0.01
    assert match.covariance[0, 0] == pytest.approx(0.24**2, rel=0.1)
    assert np.all(np.linalg.eigvalsh(match.covariance) > 0.0)


def test_no_match_claims_to_be_surer_than_windows_are_straight():
    hits = office(noise_m=0.0, seed=3)
    match = match_place(at_node(office()), hits, window_of(hits), (pose(0, 0, 0), PRIOR), AlignConfig())
    sigmas = np.sqrt(np.diag(match.covariance))
    assert np.all(sigmas[:2] > 0.9 * AlignConfig().bend_m)
    assert sigmas[2] > 0.9 * AlignConfig().bend_rad


def test_a_hit_is_believed_beside_an_occupied_cell_and_not_two_cells_off():
    """On any of its four sides: a hit that two cells part from the wall is a chair that was moved."""
    for row, col in ((0, 2), (0, -2), (2, 0), (-2, 0)):
        owner, taken = np.full((480, 480, 2), np.iinfo(np.int32).min, np.int32), np.zeros((480, 480), np.int8)
        ring = (owner, taken, np.zeros((480, 480, 6)))
        occupancy = np.zeros((40, 40), np.int8)
        occupancy[20 + row, 20 + col] = 100
        hits = np.full((4, 2), 0.525)
        gathering.add_hits(hits, pose(-0.5, -0.5, 0), 0.05, *ring, 0.0, 10.0)
        window = (occupancy, 0.05, -1.0, -1.0, 50)
        assert len(gathering.collect_hits(*ring, 0.05, 0.0, 0.0, 1.0, 1.0, -1.0, *window)) == 0
        occupancy[20 + row // 2, 20 + col // 2] = 100
        assert len(gathering.collect_hits(*ring, 0.05, 0.0, 0.0, 1.0, 1.0, -1.0, *window)) == 1


@pytest.mark.parametrize(("x_m", "y_m"), [(3.0, -2.0), (-2.5, 2.0)])
def test_a_place_fits_as_well_wherever_in_the_window_it_lies(x_m, y_m):
    T_grid_node = pose(x_m, y_m, 0.4)
    hits = transform(T_grid_node, office())
    predicted = compose(T_grid_node, (0.05, -0.05, 0.02))
    match = match_place(at_node(office()), hits, window_of(hits), (predicted, PRIOR), AlignConfig())
    assert match.refused == ""
    assert match.score > 0.95
    np.testing.assert_allclose(match.T_grid_node, T_grid_node, atol=0.02)
