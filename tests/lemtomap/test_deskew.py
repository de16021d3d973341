"""A scan taken while the base moves, undone in one way for robot, logs and library."""

import numpy as np
import pytest

from lemtomap import se2
from lemtomap.deskew import motion_during
from lemtomap.errors import BadSample
from lemtomap.grid.beams import ScanPreparer
from lemtomap.nav.types import ObstacleSighting
from lemtomap.odometry import OdometryBuffer
from lemtomap.types import Odometry, Scan

BEAMS, TIME_STEP_S = 683, 0.1 / 683
SCAN = Scan(
    1.0,
    np.full(BEAMS, 2.0, dtype=np.float32),
    -2.0,
    4.0 / (BEAMS - 1),
    TIME_STEP_S,
    T_base_laser=se2.pose(0.1, 0.05, 0.2),
)
STAMPS_S = SCAN.stamp_s + TIME_STEP_S * np.arange(BEAMS)


def driven(way_m_at, turn_rad_at):
    """What a buffer of 50 Hz says during the scan of a base on a circle, from a start well off the origin."""
    buffer = OdometryBuffer()
    for stamp_s in np.arange(0.9, 1.3, 0.02):
        way_m, turn_rad = way_m_at(stamp_s - 1.0), turn_rad_at(stamp_s - 1.0)
        chord_m = way_m * np.sinc(0.5 * turn_rad / np.pi)
        step = se2.pose(chord_m * np.cos(0.5 * turn_rad), chord_m * np.sin(0.5 * turn_rad), turn_rad)
        buffer.add(Odometry(float(stamp_s), se2.compose(se2.pose(5.0, -3.0, 2.5), step), 0.5, 1.0))
    return buffer.odometry_during(STAMPS_S)


def truly_at(way_m, turn_rad, beam):
    chord_m = way_m * np.sinc(0.5 * turn_rad / np.pi)
    T = se2.pose(chord_m * np.cos(0.5 * turn_rad), chord_m * np.sin(0.5 * turn_rad), turn_rad)
    angle = SCAN.angle_min_rad + beam * SCAN.angle_step_rad
    end = 2.0 * np.array([np.cos(angle), np.sin(angle)])
    return se2.transform(se2.compose(T, SCAN.T_base_laser), end)


def test_at_constant_velocity_the_odometry_between_the_beams_says_what_the_velocity_says():
    odometry = driven(lambda s: 0.5 * s, lambda s: 1.0 * s)
    by_velocity = motion_during(SCAN, Odometry(1.0, odometry.T_odom_base, 0.5, 1.0))
    np.testing.assert_allclose(motion_during(SCAN, odometry), by_velocity, atol=5e-5)


def test_odometry_between_the_beams_undoes_what_no_velocity_can_a_base_that_brakes():
    odometry = driven(lambda s: 0.5 * s - 3.0 * s * s, lambda s: 1.0 * s + 8.0 * s * s)
    hits = ScanPreparer()(SCAN, odometry, 5.6).hits
    for beam in range(0, BEAMS, 97):
        s = beam * TIME_STEP_S
        wanted = truly_at(0.5 * s - 3.0 * s * s, 1.0 * s + 8.0 * s * s, beam)
        assert hits[beam] == pytest.approx(wanted, abs=3e-3)
    by_velocity = ScanPreparer()(SCAN, Odometry(1.0, odometry.T_odom_base, 0.5, 1.0), 5.6).hits
    assert np.hypot(*(by_velocity - hits).T).max() > 0.05


def test_mapping_and_navigation_see_the_same_points():
    odometry = driven(lambda s: 0.5 * s, lambda s: 2.0 * s)
    motion = motion_during(SCAN, odometry)
    sighting = ObstacleSighting.from_scan(SCAN, odometry.T_odom_base, T_base_beams=motion)
    np.testing.assert_allclose(sighting.hits_base, ScanPreparer()(SCAN, odometry, 5.6).hits, atol=1e-6)


def test_a_base_at_rest_and_beams_all_at_once_need_no_motion():
    assert len(motion_during(SCAN, Odometry(1.0, np.zeros(3)))) == 0
    at_once = Scan(1.0, SCAN.ranges_m, -2.0, 0.01)
    assert len(motion_during(at_once, Odometry(1.0, np.zeros(3), 0.5, 1.0))) == 0


def test_as_many_poses_as_beams_or_the_scan_is_refused_by_name():
    odometry = Odometry(1.0, np.zeros(3), T_odom_base_beams=np.zeros((682, 3)))
    with pytest.raises(
        BadSample, match=r"T_odom_base_beams: must be a pose for each .* 683 beams.*\(682, 3\)"
    ):
        ScanPreparer()(SCAN, odometry, 5.6)
