import math

import numpy as np
import pytest

from lemtomap import se2
from lemtomap.grid import GrowingGmapping, SlamConfig
from lemtomap.grid.beams import ScanPreparer
from lemtomap.grid.growing import TILE, ArchivedWindow
from lemtomap.grid.window import Scratch, look_up
from lemtomap.types import Odometry
from tests.lemtomap.grid.rooms import box, drive, scan_at

CONFIG = SlamConfig(window_m=6.0, max_range_m=3.0, particles=3)
RING = [*box(-7.0, -7.0, 7.0, 7.0), *box(-3.0, -3.0, 3.0, 3.0), *box(4.0, 1.0, 4.3, 1.4)]
ROUND = [(5.0 * math.cos(a), 5.0 * math.sin(a), a + math.pi / 2) for a in np.linspace(0.0, 2 * math.pi, 315)]


def test_what_left_the_window_comes_back_as_it_was():
    tables = look_up(CONFIG.resolution_m)
    window = ArchivedWindow(CONFIG, tables, Scratch(CONFIG.cells))
    for pose in ((0.0, 0.0, 0.1), (0.2, 0.1, 1.0)):
        beams = ScanPreparer()(scan_at(pose, box(-1.5, -1.3, 1.6, 1.2)), Odometry(0.0, np.zeros(3)), 3.0)
        window.integrate(beams, np.array(pose))
    home = int(window.arrays.origin[0]), int(window.arrays.origin[1])
    evidence, points = window.arrays.evidence.copy(), window.occupied_points()
    nearest = window.arrays.nearest.copy()
    for origin in ((home[0] + 10 * TILE, home[1] - 2 * TILE), (home[0] - 3 * TILE, home[1]), home):
        window.shift_to(origin)
    assert np.array_equal(window.arrays.evidence, evidence)
    assert np.array_equal(window.occupied_points(), points)
    assert np.array_equal(window.arrays.nearest, nearest)
    window.shift_to((home[0] + 10 * TILE, home[1]))
    assert max(map(len, window.archive.values())) < 1000  # bytes a tile: memory grows with the building


def test_a_particle_is_its_whole_path():
    slam, online, truths = GrowingGmapping(CONFIG, 2), [], []
    for truth, odometry, scan in drive(ROUND, RING, seed=4, odometry_noise=0.02, range_max_m=3.0):
        online.append(slam.update(scan, odometry).T_grid_base)
        truths.append(truth)
    path = slam.path()
    assert path.shape == (len(online), 3)
    assert path[-1] == pytest.approx(online[-1], abs=1e-9)
    errors = se2.between(np.array(truths), path)
    assert np.hypot(errors[:, 0], errors[:, 1]).max() < 0.15
