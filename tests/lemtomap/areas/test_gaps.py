"""What is a gap between walls, and what only looks like one."""

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from lemtomap.areas.config import AreaConfig
from lemtomap.areas.gaps import gaps_around
from lemtomap.areas.kernels.clearance import nearest_obstacles
from tests.lemtomap.areas.rooms import STEP_M, view, window

CONFIG = AreaConfig()
HERE = np.array([-1.0, 0.0, 0.0])


def gaps(grid, at=HERE):
    return gaps_around(grid, at, 50, CONFIG)


def floor_with(*walls):
    """A floor of 11 m x 11 m with walls, each (x0, y0, x1, y1) in metres from the middle."""
    cells = np.zeros((240, 240), dtype=np.int8)
    cells[:10] = cells[-10:] = cells[:, :10] = cells[:, -10:] = 100
    for x0, y0, x1, y1 in walls:
        a, b, c, d = (round(v / STEP_M) + 120 for v in (y0, y1, x0, x1))
        cells[a:b, c:d] = 100
    return view(cells)


@pytest.mark.parametrize("width_m", [0.7, 0.9, 1.2, 1.5])
def test_a_gap_in_a_wall_is_a_door_of_its_width_and_place(width_m):
    (gap,) = gaps(window(gap_m=width_m))
    assert gap.is_door(CONFIG)
    assert gap.width_m == pytest.approx(width_m, abs=0.06)
    x, y, yaw = gap.T_grid_gap
    assert (x, y) == pytest.approx((0.0, 0.0), abs=0.08)
    assert abs(np.cos(yaw)) == pytest.approx(1.0, abs=0.02)


def test_the_beam_of_a_gap_may_stand_at_any_angle():
    turned = np.zeros((240, 240), dtype=np.int8)
    rows, cols = np.mgrid[:240, :240] - 120
    along, across = (cols - rows) / np.sqrt(2), (cols + rows) / np.sqrt(2)
    turned[(abs(across) < 2.0) & (abs(along) > 9)] = 100
    (gap,) = gaps(view(turned))
    assert gap.width_m == pytest.approx(0.9, abs=0.12)
    assert abs(np.sin(gap.T_grid_gap[2] - np.pi / 4)) < 0.1


@pytest.mark.parametrize("width_m", [0.4, 4.5])
def test_what_is_too_narrow_or_too_wide_parts_nothing(width_m):
    assert gaps(window(gap_m=width_m, half_width_m=3.0)) == []


def test_a_wide_opening_between_two_halls_parts_them_but_is_no_door():
    (gap,) = gaps(window(gap_m=2.4, half_width_m=4.5))
    assert not gap.is_door(CONFIG)
    assert gap.width_m == pytest.approx(2.4, abs=0.1)


def test_a_corridor_has_no_gap_however_narrow():
    assert gaps(floor_with((-5.5, 0.5, 5.5, 5.5), (-5.5, -5.5, 5.5, -0.5)), np.zeros(3)) == []


def test_a_pillar_between_two_doorways_makes_no_gap_across_the_corridor():
    walls = [(-5.5, -5.5, 5.5, -0.6)]
    walls += [(x, 0.6, x + 0.8, 0.8) for x in (-3.4, -1.7, 0.0, 1.7)]  # doorways of 0.9 m between them
    found = gaps(floor_with(*walls), np.zeros(3))
    assert all(abs(np.sin(gap.T_grid_gap[2])) > 0.9 for gap in found)  # each leads out of it, not along it


def test_the_legs_of_a_table_are_no_wall_ends():
    legs = [(x, y, x + 0.1, y + 0.1) for x in (-0.5, 0.5) for y in (-0.5, 0.5)]
    assert gaps(floor_with(*legs)) == []


def test_floor_that_nobody_has_seen_is_no_other_side():
    cells = np.array(window().occupancy)
    cells[:, 121:] = -1
    assert gaps(view(cells)) == []


def test_clearance_is_that_of_an_exact_distance_transform():
    rng = np.random.default_rng(3)
    cells = np.where(rng.random((60, 80)) < 0.02, 100, 0).astype(np.int8)
    rows, cols, length = nearest_obstacles(cells, 50)
    right = distance_transform_edt(cells < 50)
    assert abs(length - right).max() < 0.3  # two sweeps are exact but for parts of a cell
    at = np.mgrid[:60, :80]
    assert (cells[at[0] + rows, at[1] + cols] == 100).all()
    assert np.hypot(rows, cols) == pytest.approx(length, abs=1e-4)


def test_without_obstacles_there_are_no_gaps():
    assert gaps(view(np.zeros((240, 240), dtype=np.int8))) == []


def test_a_gap_between_a_wall_and_a_table_that_stands_free_is_no_door():
    table = (-0.6, -4.2, 0.6, -2.7)  # 0.8 m off the wall below it
    assert gaps(floor_with(table), np.array([-1.0, -4.0, 0.0])) == []


def test_a_wall_that_stands_free_between_two_doors_is_a_wall():
    piece, rest = (-0.1, -0.8, 0.1, 0.8), [(-0.1, 1.7, 0.1, 5.5), (-0.1, -5.5, 0.1, -1.7)]
    found = gaps(floor_with(piece, *rest), np.array([-1.0, 0.0, 0.0]))
    assert sorted(round(gap.T_grid_gap[1], 1) for gap in found) == pytest.approx([-1.2, 1.2], abs=0.11)
