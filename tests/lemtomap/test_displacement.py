"""When somebody else has moved the robot, and what its pose is worth."""

import numpy as np
import pytest

from lemtomap.displacement import Watch, WatchConfig, pose_quality
from lemtomap.se2 import transform
from lemtomap.types import Odometry
from tests.lemtomap.topo.drive import said

ANGLES = np.linspace(-2.0, 2.0, 200)
ROOM = 3.0 * np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=-1)
SURE = np.diag([1e-4, 1e-4, 1e-6])


def told(watch, stamp_s, T_grid_base, T_odom_base, quality=0.94, known=1.0, hits=None):
    return watch.displaced(
        said(stamp_s, np.array(T_grid_base, float), quality=quality, known=known),
        Odometry(stamp_s, np.array(T_odom_base, float)),
        hits,
    )


def driven(scans=20):
    """A watch over a robot that has driven two metres, its odometry turned against the grid."""
    watch = Watch()
    for k in range(scans):
        assert told(watch, 0.1 * k, [0.1 * k, 0.0, 0.0], [0.0, 0.1 * k, np.pi / 2]) == ""
    return watch


@pytest.mark.parametrize("jump", [[1.9 + 0.4, 0.0, 0.0], [1.9, 0.0, 0.4]], ids=["shifted", "turned"])
def test_a_laser_that_leaps_where_no_wheel_turned_says_that_the_robot_was_moved(jump):
    assert told(driven(), 2.0, jump, [0.0, 1.9, np.pi / 2]) != ""


def test_a_small_push_that_fits_afterwards_is_followed():
    at = [1.9, 0.12, 0.0]
    assert told(driven(), 2.0, at, [0.0, 1.9, np.pi / 2]) == ""
    assert told(driven(), 2.0, at, [0.0, 1.9, np.pi / 2], quality=0.7) != ""


def test_people_may_stand_in_the_way_for_a_moment_but_not_for_good():
    watch = driven()
    answers = [told(watch, 2.0 + 0.1 * k, [1.9, 0, 0], [0, 1.9, np.pi / 2], 0.3) for k in range(12)]
    assert answers[:9] == [""] * 9
    assert answers[-1] != ""
    watch.restart()
    assert told(watch, 9.0, [50.0, 0.0, 0.0], [0.0, 1.9, np.pi / 2]) == ""


@pytest.mark.parametrize(
    ("quality", "known"), [(0.0, 0.0), (0.3, 0.35)], ids=["nothing in sight", "mostly new ground"]
)
def test_open_space_and_new_ground_do_not_tell_that_the_robot_was_moved(quality, known):
    watch = driven()
    for k in range(30):
        assert told(watch, 2.0 + 0.1 * k, [1.9, 0, 0], [0, 1.9, np.pi / 2], quality, known) == ""
    assert watch.fit < 0.5  # nor do they make a pose sure


def test_who_sees_nothing_of_what_was_in_sight_before_was_moved_even_onto_unknown_ground():
    at, odom = [1.9, 0, 0], [0, 1.9, np.pi / 2]
    watch = driven()
    assert told(watch, 2.0, at, odom, hits=ROOM) == ""
    assert told(watch, 2.1, at, odom, quality=0.06, known=0.06, hits=ROOM * 0.7) != ""
    watch = driven()
    assert told(watch, 2.0, at, odom, hits=ROOM) == ""
    doors = np.concatenate([ROOM[:80], ROOM[80:] * 1.5])  # most of the room opened into new ground
    assert told(watch, 2.1, at, odom, quality=0.3, known=0.4, hits=doors) == ""
    assert told(watch, 2.2, at, odom, quality=0.0, known=0.0, hits=ROOM[:40] * 1.5) == ""  # little in sight
    assert told(watch, 3.0, at, odom, quality=0.0, known=0.0, hits=ROOM * 0.7) == ""  # too long ago
    turned = np.array([0, 1.9, np.pi / 2 + 0.2])
    seen = transform(np.array([0.0, 0.0, -0.2]), ROOM * 0.7)
    assert (
        told(watch, 3.1, [1.9, 0, 0.2], turned, quality=0.0, known=0.0, hits=seen) == ""
    )  # wheels tell of it


def test_the_first_scan_after_a_blind_stretch_may_correct_the_wheels():
    watch = driven()
    assert told(watch, 2.0, [5.0, 0, 0], [0, 5.0, np.pi / 2], quality=0.0, known=0.0) == ""
    assert told(watch, 2.1, [5.0, 0.3, 0], [0, 5.0, np.pi / 2], quality=0.8) == ""


def test_quality_falls_with_doubt_misfit_and_an_unproven_place():
    config = WatchConfig()
    best = pose_quality(SURE, 1.0, born=True, measured=True, config=config)
    assert best > 0.95
    assert 0.7 < pose_quality(SURE, 1.0, born=False, measured=True, config=config) < 0.9
    assert pose_quality(SURE * 25, 1.0, born=True, measured=True, config=config) < 0.5
    assert pose_quality(SURE, 0.6, born=True, measured=True, config=config) < 0.3
    assert pose_quality(SURE, 1.0, born=True, measured=False, config=config) < 0.9
    assert pose_quality(np.diag([1e-4, 1e-4, 0.03**2]), 1.0, born=True, measured=True, config=config) < 0.6
