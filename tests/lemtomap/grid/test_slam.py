import math

import numpy as np
import pytest

from lemtomap import se2
from lemtomap.errors import BadSetting
from lemtomap.grid import GrowingGmapping, RollingGmapping, SlamConfig, WindowMatcher
from tests.lemtomap.grid.rooms import box, drive

ROOM = [*box(-4.0, -3.0, 4.0, 3.0), *box(1.0, 0.5, 1.8, 1.1)]
LOOP = [
    (2.5 * math.cos(a), -1.0 + 1.2 * math.sin(a), a + math.pi / 2) for a in np.linspace(0.0, 4 * math.pi, 420)
]
ALL = [RollingGmapping, GrowingGmapping, WindowMatcher]


@pytest.mark.parametrize("kind", ALL)
def test_pose_stays_true_while_odometry_drifts(kind):
    slam = kind(SlamConfig(), 1)
    for truth, odometry, scan in drive(LOOP, ROOM, seed=3, odometry_noise=0.1):
        update = slam.update(scan, odometry)
        error = se2.between(truth, update.T_grid_base)
        assert math.hypot(error[0], error[1]) < 0.1
        assert abs(error[2]) < 0.02


def test_same_seed_same_bytes_and_another_seed_other_particles():
    def run(seed):
        slam = RollingGmapping(SlamConfig(), seed)
        poses = [slam.update(scan, odometry).T_grid_base for _, odometry, scan in drive(LOOP[:120], ROOM)]
        return np.array(poses).tobytes() + slam.view().occupancy.tobytes() + slam.particles().tobytes()

    assert run(1) == run(1)
    assert run(1) != run(2)


def test_window_smaller_than_twice_the_range_is_refused():
    with pytest.raises(BadSetting, match="twice as wide"):
        SlamConfig(window_m=10.0, max_range_m=5.6)
