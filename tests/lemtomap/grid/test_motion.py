from dataclasses import replace

import numpy as np
import pytest

from lemtomap import se2
from lemtomap.grid import SlamConfig, WindowMatcher
from lemtomap.grid.beams import ScanPreparer
from lemtomap.grid.motion import OdometryNoise, odometry_drift
from lemtomap.types import Odometry
from tests.lemtomap.grid import naive
from tests.lemtomap.grid.rooms import box, drive, scan_at

ROOM = [*box(-4.0, -3.0, 4.0, 3.0), *box(1.0, 0.5, 1.8, 1.1)]
SEES_ALL, SEES_ACROSS = np.diag([1e6, 1e6, 1e6]), np.diag([0.0, 1e6, 1e6])


def taught(errors_m, information, step=(0.2, 0.0, 0.0)):
    """Standard deviation along the way of the next prediction, after steps that were so far off."""
    noise, step = OdometryNoise(SlamConfig()), np.array(step)
    for error_m in errors_m:
        seen = information[0, 0] / (information[0, 0] + 1.0 / noise.prior(step).sigma_m ** 2)
        noise.learn(np.array([seen * error_m, 0.0, 0.0]), 0.0, step, information)
    return noise.prior(step).sigma_m


def test_wheels_are_trusted_as_far_as_the_matches_bear_them_out():
    config, rng = SlamConfig(), np.random.default_rng(1)
    floor_m, share_m = config.odometry_floor_m, 0.2 * config.odometry_m_per_m
    poor, good, absurd = (taught(s * rng.standard_normal(900), SEES_ALL) for s in (0.03, 0.002, 5.0))
    assert poor == pytest.approx(np.hypot(floor_m, 0.03), rel=0.15)
    assert good == pytest.approx(np.hypot(floor_m, config.trust_least * share_m))
    assert absurd == pytest.approx(np.hypot(floor_m, config.trust_most * share_m))


def test_a_scan_that_does_not_see_along_the_way_says_nothing_about_the_wheels():
    assert taught(np.full(100, 0.5), SEES_ACROSS) == taught([], SEES_ACROSS)


def test_a_turn_is_trusted_as_far_as_the_matches_bear_it_out():
    rng, step = np.random.default_rng(1), np.array([0.0, 0.0, 0.3])

    def sigma_rad(error_rad):
        noise = OdometryNoise(SlamConfig())
        for _ in range(900):
            noise.learn(np.array([0.0, 0.0, error_rad * rng.standard_normal()]), 0.0, step, SEES_ALL)
        return noise.prior(step).sigma_rad

    assert sigma_rad(0.003) < 0.02
    assert sigma_rad(0.12) > 0.1


def test_a_late_stamp_still_excuses_the_scan_after_the_turn():
    noise, still = OdometryNoise(SlamConfig()), np.zeros(3)
    before = noise.prior(still).sigma_rad
    noise.learn(np.zeros(3), 0.0, np.array([0.0, 0.0, 0.3]), SEES_ALL)
    assert noise.prior(still).sigma_rad > 10.0 * before
    noise.learn(np.zeros(3), 0.0, still, SEES_ALL)
    assert noise.prior(still).sigma_rad > 5.0 * before
    for _ in range(20):
        noise.learn(np.zeros(3), 0.0, still, SEES_ALL)
    assert noise.prior(still).sigma_rad < 1.5 * before


def narrowed(errors_rad):
    """Share of the allowed drift that is left after so many steps of 0.05 m, each corrected by an error."""
    step = np.array([0.05, 0.0, 0.0])
    noise, drift = OdometryNoise(SlamConfig()), odometry_drift(step, SlamConfig())
    for error_rad in errors_rad:
        noise.learn(np.array([0.0, 0.0, error_rad]), 0.0, step, SEES_ALL)
    assert noise.prior(step).sigma_rad >= noise.drift(step).sigma_rad
    return noise.drift(step).sigma_rad / drift.sigma_rad


def test_a_heading_is_trusted_as_far_as_the_matches_bear_it_out():
    """Of a gyro the matches' own scatter of a milliradian is left, which does not add up."""
    rng = np.random.default_rng(1)
    allowed_rad = odometry_drift(np.array([0.05, 0.0, 0.0]), SlamConfig()).sigma_rad
    gyro = 1e-5 * rng.standard_normal(6000) + np.diff(1e-3 * rng.standard_normal(6001))
    assert narrowed(gyro) < 0.1
    assert 0.6 < narrowed(allowed_rad * rng.standard_normal(6000)) < 1.4
    slip = np.zeros(6000)
    slip[3000] = 0.5
    assert narrowed(gyro + slip) < 0.3, "one slip is no drift"


def tracked_with_qualities(blind_share, poor, rival):
    """Quality of what is taken when the wheels' pose fits poorly and another one better."""
    path = [(x, 0.0, 0.1) for x in np.arange(-2.0, -1.0, 0.04)]
    slam = WindowMatcher(SlamConfig())
    for truth, odometry, scan in drive(path, ROOM, odometry_noise=0.0):
        slam.update(scan, odometry)
        predicted = truth
    seen = slam._beams
    kept = np.arange(len(seen.hits)) % 10 >= 10 * blind_share
    beams = replace(
        seen, hits=seen.hits[kept], normals_rad=seen.normals_rad[kept], cuts=2.0 * seen.hits[~kept]
    )
    own = slam._match

    def fits(*args):
        quality = rival if len(args) == 5 and args[4] > 1.0 else poor
        return replace(own(*args), quality=quality, accepted=True)

    slam._match = fits
    return slam._track(beams, predicted, 0.0).quality


def test_where_most_beams_see_nothing_another_pose_must_fit_by_more():
    """In a yard, 60 beams of 180 turned the robot by 12 degrees against wheels that were right."""
    assert tracked_with_qualities(0.0, 0.4, 0.8) == 0.8
    assert tracked_with_qualities(0.7, 0.4, 0.8) == 0.4
    assert tracked_with_qualities(0.7, 0.1, 0.8) == 0.8


@pytest.mark.parametrize(("good", "searched"), [(True, False), (False, True)])
def test_only_wheels_that_have_not_proven_good_at_turning_are_searched_all_round(good, searched):
    slam = WindowMatcher(SlamConfig())
    for truth, odometry, scan in drive([(x, 0.0, 0.1) for x in np.arange(-2.0, -1.0, 0.04)], ROOM):
        slam.update(scan, odometry)
        predicted = truth
    for _ in range(800 * good):
        slam._noise.learn(np.zeros(3), 0.0, np.array([0.0, 0.0, 0.3]), SEES_ALL)
    own, reaches = slam._match, []

    def noting(beams, prior, uncertainty, window, reach_rad=0.0):
        reaches.append(reach_rad)
        return own(beams, prior, uncertainty, window, reach_rad)

    slam._match = noting
    slam._pending = np.array([0.05, 0.0, 0.35])
    slam._track(slam._beams, predicted, 0.35)
    assert (reaches[0] > 0.0) is searched


def test_stamps_that_do_not_fit_the_scans_cost_little_where_the_scan_sees():
    path = [(x, 0.0, 0.0) for x in np.arange(-3.0, 3.0, 0.03)]
    rng = np.random.default_rng(2)

    def worst(config):
        slam, errors = WindowMatcher(config), []
        for truth, _, scan in drive(path, ROOM, odometry_noise=0.0):
            late = truth + np.array([0.03 * rng.standard_normal(), 0.0, 0.0])
            update = slam.update(scan, Odometry(scan.stamp_s, late))
            errors.append(abs(update.T_grid_base[0] - truth[0]))
        return np.sqrt(np.mean(np.square(errors[60:] - np.mean(errors[60:]))))

    assert worst(SlamConfig()) < 0.85 * worst(SlamConfig(trust_most=0.2))


def test_the_direction_across_a_surface_is_the_twin_s():
    pose = se2.pose(-1.0, -0.6, 0.4)
    beams = ScanPreparer()(scan_at(pose, ROOM, beams=120), Odometry(0.0, pose), 5.6)
    wanted = naive.surface_normals(beams.hits)
    assert np.isfinite(wanted).sum() > 60
    assert np.isnan(wanted).sum() > 3  # corners and jumps in depth
    assert np.array_equal(np.isnan(beams.normals_rad), np.isnan(wanted))
    seen = ~np.isnan(wanted)
    assert np.cos(2.0 * (beams.normals_rad - wanted))[seen] == pytest.approx(1.0, abs=1e-6)
    off_axis = np.abs(np.sin(2.0 * (beams.normals_rad[seen] + pose[2])))
    assert np.quantile(off_axis, 0.9) < 0.02  # all walls are parallel to an axis; at a corner it may slant


@pytest.mark.parametrize("leap", [(5.0, 0.0, 0.0), (-3.0, 4.0, 1.5), (40.0, 0.0, 0.0)])
def test_odometry_that_teleports_is_not_followed_where_the_scan_fits_the_old_place(leap):
    slam, path = WindowMatcher(SlamConfig()), [(x, 0.0, 0.1) for x in np.arange(-2.0, 0.5, 0.04)]
    for index, (truth, odometry, scan) in enumerate(drive(path, ROOM, odometry_noise=0.0)):
        T_odom_base = odometry.T_odom_base
        if index >= 30:
            T_odom_base = se2.compose(np.array(leap), T_odom_base)
        update = slam.update(scan, Odometry(scan.stamp_s, T_odom_base))
        error = se2.between(truth, update.T_grid_base)
        assert np.hypot(error[0], error[1]) < 0.05


def test_scans_that_fit_nowhere_do_not_lower_what_a_leap_must_reach():
    """Blind for some metres round a corner, the robot took the first pose that fitted by a third."""
    path = [(x, 0.0, 0.1) for x in np.arange(-2.0, 0.0, 0.04)]
    slam = WindowMatcher(SlamConfig())
    for truth, odometry, scan in drive(path, ROOM, odometry_noise=0.0):
        slam.update(scan, odometry)
        predicted = truth
    usual, own = slam._usual_quality, slam._match
    for poor in (0.1, 0.15, 0.2) * 20:

        def fits_badly(*args, poor=poor):
            rival = len(args) == 5 and args[4] > 1.0
            quality = poor + 0.2 if rival else poor
            return replace(own(*args), quality=quality, accepted=quality > 0.25)

        slam._match = fits_badly
        assert slam._track(slam._beams, predicted, 0.0).quality == poor
    assert slam._usual_quality == usual
