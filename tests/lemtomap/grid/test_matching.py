import math

import numpy as np
import pytest

from lemtomap.grid import SlamConfig
from lemtomap.grid.beams import ScanPreparer
from lemtomap.grid.kernels import matching
from lemtomap.grid.matching import Matcher
from lemtomap.grid.motion import Uncertainty
from lemtomap.grid.window import Scratch, Window, look_up
from lemtomap.types import Odometry
from tests.lemtomap.grid import naive
from tests.lemtomap.grid.rooms import box, scan_at

CONFIG = SlamConfig(window_m=4.0, max_range_m=2.0)
TABLES = look_up(CONFIG.resolution_m)
ROOM = [*box(-1.53, -1.27, 1.61, 1.18), *box(0.4, 0.3, 0.7, 0.52)]


def beams_at(pose, beams=60, walls=ROOM):
    return ScanPreparer()(scan_at(pose, walls, beams=beams, range_max_m=2.0), Odometry(0.0, np.zeros(3)), 2.0)


def filled(beams=60, walls=ROOM, poses=((0.0, 0.0, 0.1), (0.21, -0.13, 1.0), (-0.4, 0.33, -2.0))):
    window = Window(CONFIG, TABLES, Scratch(CONFIG.cells))
    for pose in poses:
        window.integrate(beams_at(pose, beams, walls), np.array(pose))
    return window


@pytest.mark.parametrize("beams", [25, 120])  # few beams: many cells have no plane of their own
def test_the_normal_equations_are_the_twin_s(beams):
    window, pose = filled(beams), np.array([0.05, -0.04, 0.32])
    seen = beams_at((0.07, -0.02, 0.3), beams)
    rules = Matcher(CONFIG, TABLES)._rules
    H, b = np.empty((3, 3)), np.empty(4)
    total = matching._linearise(
        seen.hits,
        seen.normals_rad,
        seen.laser_base,
        pose,
        window.arrays,
        TABLES,
        rules,
        CONFIG.match_sigma_m,
        H,
        b,
    )
    wanted = naive.normal_equations(
        seen, pose, window, TABLES.normals, CONFIG.match_sigma_m, CONFIG.point_weight
    )
    assert wanted[2] > 0.3 * len(seen.hits)
    assert pytest.approx(wanted[0], rel=1e-4, abs=1e-3) == H
    assert pytest.approx(wanted[1], rel=1e-3, abs=1e-4) == b[:3]
    assert total == pytest.approx(wanted[2], rel=1e-4)


@pytest.mark.parametrize("across", [0.5, 4.0, 6.0, 30.0])
def test_the_gate_weighs_only_the_weak_axis_and_does_so_bit_by_bit(across):
    c, s = math.cos(0.4), math.sin(0.4)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    H = turn @ np.array([[100.0, 0.0, 7.0], [0.0, across, 2.0], [7.0, 2.0, 50.0]]) @ turn.T
    b = np.array([0.3, -0.7, 0.2])
    H_wanted, b_wanted, diversity = naive.gated(H, b, 0.08)
    assert matching._gate(H, b, 0.08) == pytest.approx(diversity)
    assert pytest.approx(H_wanted, abs=1e-9) == H
    assert pytest.approx(b_wanted, abs=1e-9) == b


def test_a_scan_says_little_of_what_the_window_explains_badly():
    """Returns of a hedge lie anywhere: as heavy as a wall's, and without a slope."""
    rng, sigma = np.random.default_rng(0), 0.05

    def variance(off_m):
        w = np.exp(-0.5 * (off_m / sigma) ** 2)
        bend = (w * (1.0 - (off_m / sigma) ** 2)).sum()
        return matching.variance(w.sum(), bend, ((w * off_m) ** 2).sum(), 0.01)

    wall, hedge = variance(0.01 * rng.standard_normal(5000)), variance(rng.uniform(-0.12, 0.12, 5000))
    assert wall == pytest.approx(matching.CORRELATED * 0.01**2, rel=0.2)
    assert hedge > 20.0 * wall
    assert variance(np.full(10, 0.1)) == pytest.approx(matching.VAGUE * 0.01**2)
    assert variance(np.zeros(10)) == pytest.approx(0.01**2)


THIN = box(-1.5, -0.06, 1.5, 0.06)
BELOW, ABOVE = (0.0, -0.8, math.pi / 2), (0.0, 0.8, -math.pi / 2)


def test_a_wall_seen_only_from_behind_pulls_no_scan_of_its_front():
    window, seen = filled(240, THIN, [BELOW]), beams_at(ABOVE, 240, THIN)
    match = Matcher(CONFIG, TABLES)(seen, np.array(ABOVE), Uncertainty(0.05, 0.05), window)
    assert match.T_grid_base == pytest.approx(ABOVE, abs=1e-6)
    assert match.quality < 0.1
    assert window.known_share(seen, np.array(ABOVE)) < 0.1


def test_a_wall_s_own_face_is_matched_with_the_other_one_beside_it():
    window, off = filled(240, THIN, [BELOW, ABOVE]), (0.0, 0.83, -math.pi / 2 + 0.03)
    match = Matcher(CONFIG, TABLES)(
        beams_at(ABOVE, 240, THIN), np.array(off), Uncertainty(0.05, 0.05), window
    )
    assert match.T_grid_base[1:] == pytest.approx(ABOVE[1:], abs=0.005)
    assert match.diversity < 0.05
    assert match.quality > 0.9


def test_a_scan_that_says_nothing_has_no_diversity():
    assert matching._gate(np.zeros((3, 3)), np.zeros(3), 0.08) == 0.0
