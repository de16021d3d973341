from dataclasses import replace

import numpy as np
import pytest

from lemtomap import se2
from lemtomap.grid import SlamConfig, WindowMatcher
from lemtomap.grid.beams import ScanPreparer
from lemtomap.grid.motion import (
    HeadingTrust,
    Uncertainty,
    WheelTrust,
    odometry_drift,
)
from lemtomap.types import Odometry
from tests.lemtomap.grid import naive
from tests.lemtomap.grid.rooms import box, drive, scan_at

ROOM = [*box(-4.0, -3.0, 4.0, 3.0), *box(1.0, 0.5, 1.8, 1.1)]
SEES_ALL, SEES_ACROSS = np.diag([1e6, 1e6, 1e6]), np.diag([0.0, 1e6, 1e6])


def taught(errors_m, information, config):
    trust, step = WheelTrust(config), Uncertainty(0.01, 0.02)
    for error_m in errors_m:
        trust.learn(np.array([error_m, 0.0, 0.0]), 0.0, information, step)
    return trust.widen(step).sigma_m / step.sigma_m


def test_wheels_are_trusted_as_far_as_the_matches_bear_them_out():
    config, rng = SlamConfig(), np.random.default_rng(1)
    poor, good, absurd = (taught(s * rng.standard_normal(600), SEES_ALL, config) for s in (0.02, 0.002, 5.0))
    assert poor == pytest.approx(2.0, rel=0.15)
    assert good == config.trust_least
    assert absurd == config.trust_most


def test_a_scan_that_does_not_see_along_the_way_says_nothing_about_the_wheels():
    assert taught(np.full(100, 0.5), SEES_ACROSS, SlamConfig()) == 1.0


def narrowed(errors_rad, information=1e6):
    """Share of the allowed drift that is left after so many steps of 0.05 m, each corrected by an error."""
    config, step = SlamConfig(), np.array([0.05, 0.0, 0.0])
    trust, drift = HeadingTrust(config), odometry_drift(step, config)
    for error_rad in errors_rad:
        trust.learn(float(error_rad), step, information, 0.025)
    return trust.narrow(drift).sigma_rad / drift.sigma_rad


def test_a_heading_is_trusted_as_far_as_the_matches_bear_it_out():
    """Of a gyro the matches' own scatter of a milliradian is left, which does not add up."""
    rng = np.random.default_rng(1)
    allowed_rad = odometry_drift(np.array([0.05, 0.0, 0.0]), SlamConfig()).sigma_rad
    gyro = 1e-4 * rng.standard_normal(2000) + np.diff(1e-3 * rng.standard_normal(2001))
    assert narrowed(gyro) < 0.15
    assert 0.6 < narrowed(allowed_rad * rng.standard_normal(2000)) <= 1.0
    assert narrowed(gyro, information=100.0) == 1.0


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

    assert worst(SlamConfig()) < 0.85 * worst(SlamConfig(trust_most=1.0))


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
