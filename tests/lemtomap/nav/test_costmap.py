"""What the costmap's live layers make of scans: decay, clearing, NaN and +inf."""

import numpy as np

from lemtomap import se2
from lemtomap.nav.config import BodyLimits, CollisionConfig, CostmapConfig
from lemtomap.nav.kernels import fields as kernels
from lemtomap.nav.motion.collision import limit_twist
from lemtomap.nav.motion.costmap import Costmap
from lemtomap.nav.types import ObstacleSighting
from lemtomap.types import GridView, Scan, Twist

BODY = BodyLimits()
CONFIG = CostmapConfig()


def window(origin=(0.0, 0.0)) -> GridView:
    return GridView(0.0, np.zeros((120, 120), dtype=np.int8), 0.05, origin)


def scan(stamp_s: float, range_m: float) -> Scan:
    ranges = np.full(81, range_m, dtype=np.float32)
    return Scan(stamp_s, ranges, -0.4, 0.01, silent_free_m=3.0)


def see(costmap: Costmap, stamp_s: float, range_m: float) -> None:
    costmap.see(ObstacleSighting.from_scan(scan(stamp_s, range_m), se2.pose(1.0, 3.0, 0.0)), se2.IDENTITY)


def lethal(costmap: Costmap, now_s: float) -> int:
    costs = costmap.build(now_s, (1.0, 3.0))
    return int((costs.state == kernels.LETHAL).sum())


def fresh() -> Costmap:
    costmap = Costmap(CONFIG, BODY)
    costmap.follow_window(window())
    return costmap


def test_one_ghost_is_no_obstacle_two_sightings_are():
    costmap = fresh()
    see(costmap, 0.0, 2.0)
    assert lethal(costmap, 0.0) == 0
    see(costmap, 0.1, 2.0)
    assert lethal(costmap, 0.1) > 10


def test_a_live_obstacle_decays():
    costmap = fresh()
    see(costmap, 0.0, 2.0)
    see(costmap, 0.1, 2.0)
    assert lethal(costmap, CONFIG.live_decay_s) > 0
    assert lethal(costmap, CONFIG.live_decay_s + 0.2) == 0


def test_open_space_clears_and_nan_does_not():
    for value, cleared in ((np.inf, True), (np.nan, False), (3.5, True)):
        costmap = fresh()
        see(costmap, 0.0, 2.0)
        see(costmap, 0.1, 2.0)
        before = lethal(costmap, 0.1)
        see(costmap, 0.2, value)
        see(costmap, 0.3, value)
        left = costmap.build(0.3, (1.0, 3.0)).state[:, :65] == kernels.LETHAL
        assert (int(left.sum()) < before / 10) == cleared, value


def test_floor_seen_beside_a_thin_bar_does_not_hide_it_and_floor_seen_where_it_was_does():
    costmap, robot = fresh(), se2.pose(1.0, 3.0, 0.0)
    aside = np.linspace(-0.3, 0.3, 61)
    floor = np.column_stack([np.repeat([1.01, 1.04], 61), np.tile(aside, 2), np.zeros(122)])
    bar = np.column_stack([np.full(61, 1.02), aside, np.full(61, 0.1)])
    for stamp_s in (0.0, 0.2, 0.4):
        costmap.see(ObstacleSighting.from_cloud(stamp_s, robot, np.concatenate([floor, bar])), se2.IDENTITY)
    assert lethal(costmap, 0.4) >= 12
    costmap.see(ObstacleSighting.from_cloud(0.6, robot, floor), se2.IDENTITY)
    assert lethal(costmap, 0.6) >= 12  # one look beside it, by a pose that moved a little
    for stamp_s in (0.8, 1.0, 1.2):
        costmap.see(ObstacleSighting.from_cloud(stamp_s, robot, floor), se2.IDENTITY)
    assert lethal(costmap, 1.2) == 0


def test_recovering_forgets_what_the_laser_sees_again_not_what_lies_below_the_camera():
    costmap, robot = fresh(), se2.pose(1.0, 3.0, 0.0)
    bar = np.column_stack([np.full(61, 1.02), np.linspace(-0.3, 0.3, 61), np.full(61, 0.1)])
    for stamp_s in (0.0, 0.2):
        see(costmap, stamp_s, 2.0)
        costmap.see(ObstacleSighting.from_cloud(stamp_s, robot, bar), se2.IDENTITY)
    both = lethal(costmap, 0.2)
    costmap.forget_live()
    assert 12 <= lethal(costmap, 0.2) < both


def test_a_person_whom_laser_and_camera_saw_leaves_no_ghost_and_a_bar_beside_him_stays():
    costmap, robot = fresh(), se2.pose(1.0, 3.0, 0.0)
    across = np.linspace(-0.2, 0.2, 41)
    legs = np.column_stack([np.full(41, 1.0), across])
    person = np.column_stack([np.tile(legs, (2, 1)), np.repeat([0.15, 0.3], 41)])
    bar = np.column_stack([np.full(61, 1.02), np.linspace(0.6, 1.2, 61), np.full(61, 0.1)])
    for stamp_s in (0.0, 0.2, 0.4):
        costmap.see(ObstacleSighting.from_points(stamp_s, robot, legs), se2.IDENTITY)
        costmap.see(ObstacleSighting.from_cloud(stamp_s, robot, np.concatenate([person, bar])), se2.IDENTITY)
    costs = costmap.build(0.4, (1.0, 3.0))
    assert costs.state[cell(costs, 2.0, 3.0)] == kernels.LETHAL
    gone = ObstacleSighting(
        0.6, robot, np.empty((0, 2)), 3.0 * np.column_stack([np.cos(across), np.sin(across)])
    )
    for _ in range(4):
        costmap.see(gone, se2.IDENTITY)
    costs = costmap.build(0.6, (1.0, 3.0))
    assert costs.state[cell(costs, 2.0, 3.0)] != kernels.LETHAL
    assert costs.state[cell(costs, 2.02, 3.9)] == kernels.LETHAL


def cell(costs, x_m, y_m):
    row, col = costs.cell((x_m, y_m))
    return int(row), int(col)


def test_live_obstacles_stay_where_they_are_when_the_window_rolls():
    costmap = fresh()
    see(costmap, 0.0, 2.0)
    see(costmap, 0.1, 2.0)
    before = costmap.build(0.1, (1.0, 3.0))
    rows, cols = np.nonzero(before.state == kernels.LETHAL)
    costmap.follow_window(window((0.5, -0.25)))
    after = costmap.build(0.1, (1.0, 3.0))
    assert (after.state[rows + 5, cols - 10] == kernels.LETHAL).all()


def test_clearance_agrees_with_a_slow_twin():
    rng = np.random.default_rng(3)
    state = np.where(rng.random((40, 50)) < 0.02, kernels.LETHAL, kernels.FREE).astype(np.uint8)
    rows, cols = np.nonzero(state == kernels.LETHAL)
    r, c = np.indices(state.shape)
    slow = np.hypot(r[..., None] - rows, c[..., None] - cols).min(axis=-1)
    assert np.allclose(kernels.clearance_transform(state, 9.0), np.minimum(slow, 9.0), atol=1e-4)


def test_field_agrees_with_straight_distance_in_the_open():
    cost = np.ones((101, 101), dtype=np.float32)
    field = kernels.march(cost, np.array([50 * 101 + 50]), np.zeros(1), -1, 0.0, 1.0)
    r, c = np.indices(cost.shape)
    straight = np.hypot(r - 50, c - 50)
    far = straight > 10
    assert np.abs(field[far] / straight[far] - 1.0).max() < 0.08


def test_raw_points_slow_the_robot_down_and_stop_it():
    fast = Twist(0.5, 0.0)
    assert limit_twist(fast, np.array([[1.5, 0.0]]), BODY, CollisionConfig()) == fast
    near = limit_twist(fast, np.array([[0.40, 0.05]]), BODY, CollisionConfig())
    assert 0.0 < near.v_mps < 0.45
    assert limit_twist(fast, np.array([[0.215, 0.0]]), BODY, CollisionConfig()).v_mps == 0.0
    assert limit_twist(fast, np.array([[-0.3, 0.0], [0.1, 0.25]]), BODY, CollisionConfig()) == fast
    turning = Twist(0.0, 1.0)
    assert limit_twist(turning, np.array([[0.19, 0.0]]), BODY, CollisionConfig()) == turning
