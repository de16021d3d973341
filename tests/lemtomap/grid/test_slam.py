import math
from dataclasses import replace

import numpy as np
import pytest

from lemtomap import se2
from lemtomap.errors import BadSetting
from lemtomap.grid import (
    GrowingGmapping,
    RollingGmapping,
    SlamConfig,
    WindowMatcher,
    particles,
)
from lemtomap.grid.foreground import is_foreground
from lemtomap.types import Odometry, Scan
from tests.lemtomap.grid.rooms import box, drive, scan_at

ROOM = [*box(-4.0, -3.0, 4.0, 3.0), *box(1.0, 0.5, 1.8, 1.1), *box(-3.2, 1.5, -2.6, 3.0)]
LOOP = [
    (2.5 * math.cos(a), -1.0 + 1.2 * math.sin(a), a + math.pi / 2) for a in np.linspace(0.0, 4 * math.pi, 420)
]
CORRIDOR = box(-10.0, -1.0, 40.0, 1.0)
ALL = [RollingGmapping, GrowingGmapping, WindowMatcher]


@pytest.mark.parametrize("kind", ALL)
def test_pose_stays_true_while_odometry_drifts(kind):
    slam = kind(SlamConfig(), 1)
    for truth, odometry, scan in drive(LOOP, ROOM, seed=3, odometry_noise=0.1):
        update = slam.update(scan, odometry)
        error = se2.between(truth, update.T_grid_base)
        assert math.hypot(error[0], error[1]) < 0.03
        assert abs(error[2]) < 0.02


def test_same_seed_same_bytes_and_another_seed_other_particles():
    def run(seed):
        slam = RollingGmapping(SlamConfig(), seed)
        poses = [slam.update(scan, odometry).T_grid_base for _, odometry, scan in drive(LOOP[:120], ROOM)]
        return np.array(poses).tobytes() + slam.view().occupancy.tobytes() + slam.particles().tobytes()

    assert run(1) == run(1)
    assert run(1) != run(2)


@pytest.mark.parametrize(("true_deg", "wheels_deg"), [(85, 85), (85, 60), (-85, -20), (60, 0), (0, 40)])
def test_a_large_turn_between_two_scans_is_survived(true_deg, wheels_deg):
    slam = WindowMatcher(SlamConfig())
    truth = T_odom_base = se2.pose(-2.0, -1.5, 0.3)
    for i in range(80):
        step = wheels = se2.pose(0.03, 0.0, 0.02)
        if i in (40, 60):
            step = se2.pose(0.05, 0.03, math.radians(true_deg))
            wheels = se2.pose(0.05, 0.0, math.radians(wheels_deg))
        truth, T_odom_base = se2.compose(truth, step), se2.compose(T_odom_base, wheels)
        update = slam.update(scan_at(truth, ROOM, 0.1 * i), Odometry(0.1 * i, T_odom_base))
    error = se2.between(truth, update.T_grid_base)
    assert math.hypot(error[0], error[1]) < 0.05
    assert abs(error[2]) < 0.02


def drive_corridor(config):
    slam = WindowMatcher(config)
    path = [(x, 0.0, 0.0) for x in np.arange(0.0, 20.0, 0.05)]
    for i, here in enumerate(path):  # odometry is exact: what is off at the end was invented by the match
        update = slam.update(scan_at(here, CORRIDOR, 0.1 * i), Odometry(0.1 * i, np.array(here)))
    return update, update.T_grid_base - path[-1]


def test_in_a_featureless_corridor_what_the_scan_cannot_see_follows_odometry():
    update, error = drive_corridor(SlamConfig())
    assert update.diversity < 0.2
    assert abs(error[0]) < 0.1  # the first scans, not yet surfaces, hold on for a step or two
    assert abs(error[1]) < 0.03
    sigma = np.sqrt(np.diag(update.covariance))
    assert sigma[0] > 3.0 * sigma[1]


def test_without_the_diversity_gate_the_corridor_slips_as_appendix_d_says():
    _, error = drive_corridor(replace(SlamConfig(), degenerate_below=0.0))
    assert abs(error[0]) > 0.3


def drive_behind_a_person(slam):
    """A bare corridor, and someone who walks ahead at the robot's own pace."""
    for i, x in enumerate(np.arange(0.0, 12.0, 0.05)):
        here, ahead_m = np.array([x, 0.0, 0.0]), x + (1.2 if x > 4.0 else 4.5)
        person = box(ahead_m, -0.25, ahead_m + 0.3, 0.25)
        update = slam.update(scan_at(here, [*CORRIDOR, *person], 0.1 * i), Odometry(0.1 * i, here))
    return update.T_grid_base - here


def test_a_person_who_walks_ahead_does_not_hold_the_robot_back():
    error = drive_behind_a_person(WindowMatcher(SlamConfig()))
    assert abs(error[0]) < 0.3
    assert abs(error[1]) < 0.03


def test_unless_what_stands_alone_is_heard_against_the_wheels():
    error = drive_behind_a_person(WindowMatcher(replace(SlamConfig(), doubted_share=math.inf)))
    assert error[0] < -1.0


def test_a_robot_whose_wheels_turn_in_vain_is_told_by_the_walls_that_it_stands():
    slam = WindowMatcher(SlamConfig())
    here = np.array([1.0, -1.5, 0.4])
    for i in range(60):
        wheels = se2.compose(here, se2.pose(0.02 * i, 0.0, 0.0))
        update = slam.update(scan_at(here, ROOM, 0.1 * i), Odometry(0.1 * i, wheels))
    assert math.hypot(*(update.T_grid_base - here)[:2]) < 0.05


def test_only_small_things_before_what_is_seen_beside_them_are_foreground():
    wall = np.column_stack([np.full(40, 3.0), np.linspace(-1.0, 1.0, 40)])
    person = np.column_stack([np.full(8, 1.5), np.linspace(-0.1, 0.1, 8)])
    niche = np.column_stack([np.full(8, 4.0), np.linspace(0.4, 0.7, 8)])
    hits = np.concatenate([wall[:18], person, wall[22:28], niche, wall[34:]])
    expected = np.zeros(len(hits), dtype=bool)
    expected[18:26] = True
    np.testing.assert_array_equal(is_foreground(hits), expected)
    assert not is_foreground(wall).any()
    assert is_foreground(np.empty((0, 2))).shape == (0,)


def test_a_map_starts_wherever_the_robot_is_switched_on():
    """In the middle of a hall of 40 m: the first scans meet nothing that tells what fits."""
    slam, hall = WindowMatcher(SlamConfig()), [*box(-20.0, -20.0, 20.0, 20.0), *box(19.0, 2.0, 19.6, 2.8)]
    updates = []
    for i, x in enumerate(np.arange(0.0, 18.0, 0.05)):
        here = np.array([x, 0.0, 0.0])
        updates.append(slam.update(scan_at(here, hall, 0.1 * i), Odometry(0.1 * i, here)))
    assert not any(update.matched for update in updates[:200])
    assert updates[-1].matched
    assert len(slam.occupied_points()) > 50
    np.testing.assert_allclose(updates[-1].T_grid_base, here, atol=0.05)


def hedge_scan(here, front_m, rng, stamp_s):
    """A ragged hedge to the left, each beam some leaves deep in it, and sky elsewhere."""
    angles = np.linspace(-math.pi / 2, math.pi / 2, 181)
    steps_m = np.arange(0.0, 10.0, 0.025)
    x = here[0] + np.cos(angles + here[2])[:, None] * steps_m
    y = here[1] + np.sin(angles + here[2])[:, None] * steps_m
    inside = y > front_m[((x + 20.0) / 0.3).astype(int)]
    at = np.where(inside.any(axis=1), inside.argmax(axis=1) + rng.geometric(0.15, len(angles)), len(steps_m))
    ranges = np.append(steps_m, np.inf)[np.minimum(at, len(steps_m))].astype(np.float32)
    return Scan(stamp_s, ranges, float(angles[0]), float(angles[1] - angles[0]), range_max_m=10.0)


@pytest.mark.parametrize("seed", range(2))
def test_a_hedge_turns_no_robot_whose_gyro_has_proven_good(seed):
    """In a room first, where the wheels can be checked; then along a hedge that turned it by 6 degrees."""
    slam, rng = WindowMatcher(SlamConfig()), np.random.default_rng(seed)
    front_m = 4.0 + rng.uniform(-0.7, 0.7, 270)
    circle = np.arange(0.0, 44.0, 0.1)
    path = np.column_stack([1.5 * np.cos(circle), 1.5 * np.sin(circle) - 1.0, circle + math.pi / 2])
    for i, here in enumerate(path):
        slam.update(scan_at(here, ROOM, 0.1 * i, noise_m=0.01, rng=rng), Odometry(0.1 * i, here))
    turned = []
    for i in range(100):
        along, stamp_s = se2.pose(0.2 * i, 0.0, 0.0), 60.0 + 0.1 * i
        T_odom_base = se2.compose(here, along)
        update = slam.update(hedge_scan(along, front_m, rng, stamp_s), Odometry(stamp_s, T_odom_base))
        turned.append(float(se2.wrap_angle(update.T_grid_base[2] - T_odom_base[2])))
    assert np.ptp(turned) < 0.03


def test_after_a_stretch_with_nothing_in_sight_new_walls_are_mapped_where_odometry_says():
    """And a lone wall is not taken for one seen before at another angle."""
    slam = WindowMatcher(SlamConfig())
    yard = [*box(-3.0, -2.0, 1.0, 2.0)[:3], ((20.0, -6.0), (20.0, 6.0)), *box(16.0, 4.0, 17.0, 6.0)]
    for i, x in enumerate(np.arange(0.0, 18.0, 0.05)):
        here = np.array([x, 0.0, 0.0])
        update = slam.update(scan_at(here, yard, 0.1 * i), Odometry(0.1 * i, here))
    assert update.matched
    np.testing.assert_allclose(update.T_grid_base, here, atol=0.05)


def test_after_a_stretch_with_nothing_in_sight_particles_spread_no_further_than_wheels_drift():
    """Spread as wide as a match searches, the luckiest chance fit would win."""
    slam = GrowingGmapping(replace(SlamConfig(), particles=30))
    hall = [*box(-3.0, -2.0, 1.0, 2.0)[:3], ((20.0, -6.0), (20.0, 6.0))]
    for i, x in enumerate(np.arange(0.0, 16.0, 0.05)):
        here = np.array([x, 0.0, 0.0])
        slam.update(scan_at(here, hall, 0.1 * i), Odometry(0.1 * i, here))
    spread_rad = np.std(slam.particles()[:, 2])
    assert 0.05 < spread_rad < 0.3
    assert np.ptp([particle.log_weight for particle in slam._particles]) < 2.0


def test_published_correction_never_leaps_unless_flagged():
    slam = WindowMatcher(SlamConfig())
    before = None
    for _, odometry, scan in drive(LOOP, ROOM, seed=5, odometry_noise=0.3):
        update = slam.update(scan, odometry)
        if before is not None and not update.jumped:
            leap = se2.between(
                se2.compose(before, odometry.T_odom_base),
                se2.compose(update.T_grid_odom, odometry.T_odom_base),
            )
            assert math.hypot(leap[0], leap[1]) <= 0.03 + 1e-9
            assert abs(leap[2]) <= math.radians(0.5) + 1e-4
        before = update.T_grid_odom
        gap = se2.between(se2.compose(before, odometry.T_odom_base), update.T_grid_base)
        assert math.hypot(gap[0], gap[1]) < 0.3


def test_step_covariance_grows_with_travel_and_not_while_standing():
    slam = WindowMatcher(SlamConfig())
    steps = [slam.update(scan, odometry) for _, odometry, scan in drive(LOOP[:60], ROOM)]
    for update in steps[1:]:
        assert (np.linalg.eigvalsh(update.step_covariance) > 0.0).all()
    standing = slam.update(scan_at(LOOP[59], ROOM, 6.0), Odometry(6.0, odometry_at_end(LOOP[:60])))
    assert np.trace(standing.step_covariance) < 0.05 * np.trace(steps[-1].step_covariance)


def odometry_at_end(path):
    return [odometry for _, odometry, _ in drive(path, ROOM)][-1].T_odom_base


def test_the_rolling_window_forgets_what_the_growing_map_keeps():
    config = SlamConfig(window_m=12.0, max_range_m=5.6, particles=2)
    hall = [*box(-6.0, -2.0, 30.0, 2.0), *(w for x in range(-4, 30, 3) for w in box(x, 1.2, x + 0.4, 1.5))]
    path = [(x, 0.0, 0.0) for x in np.arange(0.0, 20.0, 0.1)]
    rolling, growing = RollingGmapping(config, 0), GrowingGmapping(config, 0)
    for _, odometry, scan in drive(path, hall, odometry_noise=0.01):
        rolling.update(scan, odometry)
        growing.update(scan, odometry)
    assert rolling.view().occupancy.shape == (240, 240)
    whole = growing.view()
    assert whole.occupancy.shape[1] * whole.resolution_m > 25.0
    assert whole.origin_m[0] < -4.0 < 0.0 < rolling.view().origin_m[0]
    row = whole.occupancy[int((-2.0 - whole.origin_m[1]) / 0.05) - 2 :][:6]
    assert ((row > 50).any(axis=0)).sum() > 0.8 * 22.0 / 0.05


def test_particles_that_share_a_window_do_not_write_into_one_another():
    slam = RollingGmapping(SlamConfig(particles=4, resample_below=1.1), 0)  # resample at every integration
    for _, odometry, scan in drive(LOOP[:150], ROOM, odometry_noise=0.1):
        slam.update(scan, odometry)
        shared = {id(p.window) for p in slam._particles}
        assert len(shared) <= 4
    assert slam.nbytes == 4 * slam._windows[0].nbytes
    assert slam.nbytes / 4 * 5 <= 10e6


def test_resampling_keeps_particles_in_proportion_to_their_weight():
    weights = particles.normalised(np.log([0.6, 0.3, 0.1]))
    counts = np.zeros(3)
    rng = np.random.default_rng(0)
    for _ in range(2000):
        counts += np.bincount(particles.resample(weights, rng), minlength=3)
    assert counts / counts.sum() == pytest.approx([0.6, 0.3, 0.1], abs=0.01)
    assert particles.effective_number(np.full(5, 0.2)) == pytest.approx(5.0)


def test_window_smaller_than_twice_the_range_is_refused():
    with pytest.raises(BadSetting, match="twice as wide"):
        SlamConfig(window_m=10.0, max_range_m=5.6)
    assert SlamConfig(window_m=10.0).usable_range_m(30.0) == 5.0
    assert SlamConfig().usable_range_m(5.6) == 5.6


@pytest.mark.parametrize("kind", [WindowMatcher, RollingGmapping])
def test_the_window_goes_along_where_the_laser_meets_nothing(kind):
    """It stayed behind in a hall wider than the laser sees, and the navigator stood at its border."""
    slam = kind(SlamConfig())
    for index in range(300):
        pose = np.array([0.1 * index, 0.0, 0.0])
        scan = Scan(0.1 * index, np.full(61, np.inf, dtype=np.float32), -1.5, 0.05, silent_free_m=2.5)
        update = slam.update(scan, Odometry(0.1 * index, pose))
    view = slam.view()
    assert math.sqrt(update.covariance[2, 2]) < 0.3, "a random walk of 30 m, not 0.1 rad for each of them"
    col, row = np.floor((np.array([29.9, 0.0]) - view.origin_m) / view.resolution_m).astype(int)
    assert 0 <= view.occupancy[row, col] < 25


def test_a_blind_laser_follows_odometry():
    slam = WindowMatcher(SlamConfig())
    for _, odometry, scan in drive(LOOP[:50], [], odometry_noise=0.0):
        update = slam.update(scan, odometry)
        assert not update.matched
        assert update.T_grid_base == pytest.approx(odometry.T_odom_base, abs=1e-9)
