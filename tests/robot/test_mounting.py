"""A laser behind the axle, turned or upside down: its map is right, for [laser] says where it is."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from lemtomap import se2
from lemtomap.nav.types import ObstacleSighting
from lemtomap.pipeline import Mapper
from lemtomap.robot.config import RobotConfig
from lemtomap.robot.devices import bridge
from lemtomap.robot.runs.sim_server import mounting_of
from lemtomap.robot.settings.check import from_mapping
from lemtomap.types import Odometry
from tests.lemtomap.grid.rooms import box, scan_at

MOUNTINGS = {
    "in the middle": {},
    "before the axle": {"x_m": 0.1},
    "behind the axle": {"x_m": -0.15, "y_m": 0.04},
    "turned": {"yaw_rad": 2.0},
    "looking back": {"x_m": -0.1, "yaw_rad": -math.pi},
    "upside down": {"x_m": 0.05, "roll_deg": 180.0},
    "upside down, turned and behind": {"x_m": -0.12, "y_m": -0.05, "yaw_rad": 0.7, "roll_deg": -180.0},
}
WALLS = box(0.0, 0.0, 7.0, 5.0) + box(4.0, 3.0, 5.0, 3.6) + box(2.0, 1.0, 2.4, 1.8)
WAY = [(1.0 + 0.1 * i, 2.5 - 0.01 * i, 0.05 * i) for i in range(30)]


def settings(kind):
    return from_mapping({"laser": MOUNTINGS[kind]})


def seen_by(laser, T_world_base):
    """Return what the device itself tells: its beams run anticlockwise as it sees it."""
    T_world_laser = se2.compose(np.array(T_world_base), laser.T_base_laser)
    scan = scan_at(T_world_laser, WALLS)
    ranges = scan.ranges_m[::-1] if laser.is_upside_down else scan.ranges_m
    return SimpleNamespace(
        stamp_s=0.0,
        ranges_m=np.ascontiguousarray(ranges),
        angle_min_rad=scan.angle_min_rad,
        angle_step_rad=scan.angle_step_rad,
        time_step_s=0.0,
        range_min_m=0.02,
        range_max_m=5.6,
    )


def off_walls_m(points):
    """Return how far each point is from the nearest wall, (N,)."""
    away = np.full(len(points), np.inf)
    for a, b in WALLS:
        start, along = np.array(a), np.subtract(b, a)
        share = np.clip((points - start) @ along / (along @ along), 0.0, 1.0)
        away = np.minimum(away, np.hypot(*(points - start - share[:, None] * along).T))
    return away


@pytest.mark.parametrize("kind", MOUNTINGS)
def test_every_beam_ends_where_it_was_reflected(kind):
    laser = settings(kind).laser
    for T_world_base in (WAY[0], WAY[20]):
        scan = bridge.scan_of(
            seen_by(laser, T_world_base), laser.T_base_laser, upside_down=laser.is_upside_down
        )
        sighting = ObstacleSighting.from_scan(scan, np.array(T_world_base))
        ends = se2.transform(np.array(T_world_base), sighting.hits_base)
        assert len(ends) > 100
        assert off_walls_m(ends).max() < 1e-4
        assert sighting.origin_base == (laser.x_m, laser.y_m)


@pytest.mark.parametrize("kind", MOUNTINGS)
def test_the_map_of_a_room_stands_where_its_walls_are(tmp_path, kind):
    laser = settings(kind).laser
    with Mapper.open(tmp_path / "map.lemto") as mapper:
        for index, T_world_base in enumerate(WAY):
            scan = bridge.scan_of(
                seen_by(laser, T_world_base), laser.T_base_laser, upside_down=laser.is_upside_down
            )
            object.__setattr__(scan, "stamp_s", 0.1 * index)
            mapper.update(scan, Odometry(0.1 * index, se2.between(np.array(WAY[0]), np.array(T_world_base))))
        view = mapper.view()
    ended = se2.compose(np.array(WAY[0]), view.T_grid_base)
    assert np.abs(ended - WAY[-1]).max() < 0.01
    rows, columns = np.nonzero(view.grid.occupancy > 50)
    cells = np.array(view.grid.origin_m) + (np.stack([columns, rows], axis=1) + 0.5) * view.grid.resolution_m
    assert len(cells) > 300
    assert off_walls_m(se2.transform(np.array(WAY[0]), cells)).max() < 0.08


def test_the_simulated_laser_sits_where_the_settings_say():
    mounting = mounting_of(settings("upside down, turned and behind"))
    assert mounting.T_base_laser == (-0.12, -0.05, 0.7)
    assert mounting.upside_down
    assert not mounting_of(RobotConfig()).upside_down
