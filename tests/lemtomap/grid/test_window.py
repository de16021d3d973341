import math

import numpy as np
import pytest

from lemtomap import se2
from lemtomap.grid import SlamConfig
from lemtomap.grid.beams import Beams, ScanPreparer
from lemtomap.grid.kernels import searching
from lemtomap.grid.window import Scratch, Window, look_up
from lemtomap.types import Odometry, Scan
from tests.lemtomap.grid import naive
from tests.lemtomap.grid.rooms import box, scan_at

CONFIG = SlamConfig(window_m=4.0, max_range_m=2.0)
WALLS = [*box(-1.53, -1.27, 1.61, 1.18), *box(0.4, 0.3, 0.7, 0.52)]
TABLES = look_up(CONFIG.resolution_m)
ODOMETRY = Odometry(0.0, np.zeros(3))


def beams_at(pose, walls=WALLS, count=90):
    scan = scan_at(pose, walls, beams=count, range_max_m=2.0)
    return ScanPreparer()(scan, Odometry(0.0, np.zeros(3)), 2.0)


def filled(poses):
    window = Window(CONFIG, TABLES, Scratch(CONFIG.cells))
    for pose in poses:
        window.integrate(beams_at(pose), np.array(pose, dtype=float))
    return window


def assert_look_up_is_right(window, step=3):
    cells = naive.cells_of(window)
    n, (ox, oy) = window.cells, window.arrays.origin
    for gy in range(oy, oy + n, step):
        for gx in range(ox, ox + n, step):
            index = window.arrays.nearest[gy % n, gx % n]
            found = math.inf if index == 255 else math.hypot(*TABLES.offsets[index])
            wanted = naive.nearest_distance(cells, (gx, gy), 8.9)
            if math.isinf(wanted):
                assert math.isinf(found) or found > 8.5
            else:
                assert found == pytest.approx(wanted)


POSES = [(0.0, 0.0, 0.1), (0.21, -0.13, 1.0), (-0.4, 0.33, -2.0), (0.0, 0.1, 3.0)]


def test_integration_moves_each_cell_as_the_obvious_twin_says():
    window = Window(CONFIG, TABLES, Scratch(CONFIG.cells))
    cells = {}
    for pose in POSES:
        beams = beams_at(pose)
        cells = naive.integrated(cells, beams, pose, CONFIG)
        window.integrate(beams, np.array(pose))
        mine = naive.cells_of(window)
        wrong = [cell for cell in {*cells, *mine} if cells.get(cell) != mine.get(cell)]
        assert len(wrong) <= 0.005 * len(cells)  # a ray through a cell's very corner may round either way
    assert any(evidence > 0 for evidence in cells.values())


def test_nearest_look_up_stays_exact_while_cells_come_and_go():
    window = filled(POSES)
    assert_look_up_is_right(window)
    for _ in range(6):  # the small box is gone: its cells must be forgotten
        window.integrate(beams_at((0.0, 0.0, 0.5), box(-1.53, -1.27, 1.61, 1.18)), np.array([0.0, 0.0, 0.5]))
    assert_look_up_is_right(window)


@pytest.mark.parametrize("step", [(7, 0), (-5, 3), (0, -11), (40, 25), (200, 0)])
def test_a_shift_keeps_what_stays_and_forgets_what_leaves(step):
    window = filled(POSES)
    before = naive.cells_of(window)
    ox, oy = window.arrays.origin
    window.shift_to((ox + step[0], oy + step[1]))
    n = window.cells
    stays = {
        (gx, gy): evidence
        for (gx, gy), evidence in before.items()
        if ox + step[0] <= gx < ox + step[0] + n and oy + step[1] <= gy < oy + step[1] + n
    }
    assert naive.cells_of(window) == stays
    assert_look_up_is_right(window)


def test_score_is_the_twin_s_score():
    window = filled(POSES)
    cells = naive.cells_of(window)
    beams = beams_at((0.1, 0.05, 0.2))
    for pose in [(0.1, 0.05, 0.2), (0.13, 0.0, 0.3), (-0.2, 0.3, 2.0)]:
        mine = searching.score(beams.hits, 1, *pose, window.arrays, TABLES, CONFIG.resolution_m)
        wanted = naive.closeness_score(beams.hits, pose, cells, 0.1, CONFIG.resolution_m)
        assert mine == pytest.approx(wanted, abs=2e-3)


def test_occupied_points_lie_on_the_walls_not_on_cell_centres():
    window = filled([(0.0, 0.0, 0.0)])
    points = window.occupied_points()
    gaps = [min(_gap(p, wall) for wall in WALLS) for p in points]
    assert np.quantile(gaps, 0.9) < 1e-4
    assert max(gaps) < 0.01  # a cell at a corner averages both walls


def _gap(p, wall):
    (ax, ay), (bx, by) = wall
    t = ((p[0] - ax) * (bx - ax) + (p[1] - ay) * (by - ay)) / ((bx - ax) ** 2 + (by - ay) ** 2)
    t = min(max(t, 0.0), 1.0)
    return math.hypot(p[0] - ax - t * (bx - ax), p[1] - ay - t * (by - ay))


def test_view_tells_unknown_free_and_occupied_apart_in_map_order():
    window = filled(POSES)
    window.shift_to((-13, -29))
    view = window.view(1.0)
    for (gx, gy), evidence in naive.cells_of(window).items():
        percent = view.occupancy[gy + 29, gx + 13]
        assert (percent > 50) == (evidence > 0)
        assert percent >= 0
    assert view.origin_m == pytest.approx((-0.65, -1.45))
    assert not view.occupancy.flags.writeable


def test_a_passer_by_leaves_no_trace_and_an_opened_door_is_learnt():
    door = [((-1.0, 1.0), (1.0, 1.0))]
    pose = np.array([0.0, 0.0, 0.0])
    room = box(-1.5, -1.5, 1.5, 1.5)
    window = Window(CONFIG, TABLES, Scratch(CONFIG.cells))
    for _ in range(20):
        window.integrate(beams_at(pose, room), pose)
    window.integrate(beams_at(pose, [*room, *door]), pose)  # someone passes
    for _ in range(3):
        window.integrate(beams_at(pose, room), pose)
    assert not [
        c for c, e in naive.cells_of(window).items() if e > 0 and abs(c[1] - 20) < 3 and abs(c[0]) < 15
    ]
    for _ in range(20):
        window.integrate(beams_at(pose, [*room, *door]), pose)  # closed for long
    for _ in range(8):
        window.integrate(beams_at(pose, room), pose)
    assert not [
        c for c, e in naive.cells_of(window).items() if e > 0 and abs(c[1] - 20) < 3 and abs(c[0]) < 15
    ]


def test_deskewing_undoes_the_motion_during_the_sweep():
    v, w, time_step = 0.5, 1.2, 0.1 / 683
    ranges = np.full(683, 2.0, dtype=np.float32)
    scan = Scan(
        0.0, ranges, -2.0, 4.0 / 682, time_step, range_max_m=5.6, T_base_laser=se2.pose(0.1, 0.05, 0.2)
    )
    hits = ScanPreparer()(scan, Odometry(0.0, np.zeros(3), v, w), 5.6).hits
    for i in range(0, 683, 97):
        t = i * time_step
        arc = se2.pose(v / w * math.sin(w * t), v / w * (1 - math.cos(w * t)), w * t)
        angle = -2.0 + i * 4.0 / 682
        beam = np.array([2.0 * math.cos(angle), 2.0 * math.sin(angle)])
        wanted = se2.transform(se2.compose(arc, scan.T_base_laser), beam)
        assert hits[i] == pytest.approx(wanted, abs=1e-4)


def test_beams_that_saw_nothing_clear_only_the_usable_range():
    ranges = np.array([np.inf, np.nan, 9.0, 1.0, 0.001], dtype=np.float32)
    scan = Scan(0.0, ranges, 0.0, 0.1, range_min_m=0.02, range_max_m=5.6)
    beams = ScanPreparer()(scan, Odometry(0.0, np.zeros(3)), 2.0)
    assert np.hypot(*beams.hits.T) == pytest.approx([1.0])
    assert np.hypot(*beams.cuts.T) == pytest.approx([2.0, 2.0])
    assert isinstance(beams, Beams)


def test_both_faces_of_a_thin_wall_have_planes_of_their_own():
    wall = box(-1.5, -0.06, 1.5, 0.06)
    window = Window(CONFIG, TABLES, Scratch(CONFIG.cells))
    for pose in [(0.0, -0.8, math.pi / 2), (0.0, 0.8, -math.pi / 2)] * 2:
        window.integrate(beams_at(pose, wall, 240), np.array(pose))
    n, arrays = window.cells, window.arrays
    middle = [cell for cell, evidence in naive.cells_of(window).items() if evidence > 0 and abs(cell[0]) < 15]
    assert len(middle) > 50
    for gx, gy in middle:
        at = gy % n, gx % n
        assert TABLES.normals[arrays.normal[at]] == pytest.approx([0.0, 1.0], abs=0.02)
        height_m = (gy + arrays.mean[at][1] / 65535.0 + arrays.lift[at] / 254.0) * CONFIG.resolution_m
        assert abs(height_m) == pytest.approx(0.06, abs=1e-3)


def test_a_wall_close_by_has_normals_although_its_hits_lie_close_together():
    beams = ScanPreparer()(scan_at((0.0, 0.0, 0.0), box(-2.0, -0.3, 2.0, 2.0), beams=683), ODOMETRY, 5.6)
    x, y = beams.hits.T
    beside = (y < 0.0) & (x > -0.05) & (x < 0.15)  # further back the scan ends
    assert beside.sum() > 80
    assert beams.normals_rad[beside] == pytest.approx(math.pi / 2, abs=1e-3)
