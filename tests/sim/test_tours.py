"""Scripted drives and their logs."""

import numpy as np
import pytest

from lemtomap.sim import worlds
from lemtomap.sim.carmen import NO_RETURN_M, record_tour
from lemtomap.sim.errors import BadWorld
from lemtomap.sim.route import FloorRoutePlanner
from lemtomap.sim.simulator import Simulator
from lemtomap.sim.tours import (
    base_command,
    drive,
    plan_errand,
    plan_tour,
)
from lemtomap.sim.world import Raster


@pytest.fixture(scope="module")
def office():
    return worlds.load("office")


def test_route_keeps_off_the_walls_and_says_when_there_is_none(office):
    planner = FloorRoutePlanner(office.raster)
    path = planner.path((1.0, 1.0), (13.0, 2.0))
    assert np.hypot(*np.diff(path, axis=0).T).max() < 0.2
    for x, y in path:
        row, col = office.raster.cell(x, y)
        assert not office.raster.occupied[row - 3 : row + 4, col - 3 : col + 4].any()
    with pytest.raises(BadWorld, match="nothing passable"):
        planner.path((1.0, 1.0), (30.0, 2.0))


def test_three_minute_tour_sees_every_room_without_touching_and_leaves_a_log(office, tmp_path):
    tour = plan_tour(office, 180.0)
    simulator = Simulator(office, seed=5)
    log = tmp_path / "tour.log"
    scans = record_tour(simulator, tour, log)
    truth = simulator.truth()
    simulator.close()
    assert truth.contact_count == 0
    assert 150 < simulator.now_s < 220
    lines = log.read_text().splitlines()
    true = np.array([line.split()[1:4] for line in lines if line.startswith("TRUEPOS")], dtype=float)
    seen = {office.truth.room_at(x, y) for x, y, _ in true}
    assert seen >= {room.name for room in office.truth.rooms}
    lasers = [line.split() for line in lines if line.startswith("FLASER")]
    assert len(lasers) == scans
    ranges = np.array([fields[2:515] for fields in lasers], dtype=float)
    assert 0.02 < (ranges == NO_RETURN_M).mean() < 0.6
    odometry = np.array([fields[518:521] for fields in lasers], dtype=float)
    driven = np.hypot(*np.diff(odometry[:, :2], axis=0).T).sum()
    assert abs(driven - truth.path_m) < 0.04 * truth.path_m
    assert not np.allclose(odometry[-1], true[-1], atol=0.01)


def test_errand_goes_there_and_back_twice(office):
    tour = plan_errand(office, 12.0)
    simulator = Simulator(office, seed=5)
    track = [simulator.truth().T_world_base[:2] for _ in drive(simulator, tour)]
    simulator.close()
    away = np.hypot(*(np.array(track) - office.spawn[:2]).T) > 5.0
    assert np.count_nonzero(np.diff(away.astype(int)) == 1) == 2
    np.testing.assert_allclose(tour.path, tour.path[::-1])


@pytest.mark.parametrize(
    ("v", "w", "frame"),
    [
        (0.0, 0.0, "AA550601040000000003"),
        (0.0, -1.0, "AA550601048DFF010070"),
        (0.2, 0.5, "AA550601040101900192"),
        (-0.2, 0.5, "AA55060104FFFE70FE8C"),
    ],
)
def test_commands_match_the_worked_frames(v, w, frame):
    assert base_command(v, w).hex().upper() == frame


def test_a_way_through_the_open_is_straight():
    occupied = np.zeros((240, 240), dtype=bool)
    occupied[[0, -1]] = occupied[:, [0, -1]] = True
    planner = FloorRoutePlanner(Raster(occupied, ~occupied, 0.05, (0.0, 0.0)))
    path = planner.path((1.0, 1.0), (9.0, 5.0))
    length_m = float(np.hypot(*np.diff(path, axis=0).T).sum())
    assert length_m < 1.02 * np.hypot(8.0, 4.0), "eight directions make it 1.06 times as long"
    assert np.hypot(*np.diff(path, axis=0).T).max() < 0.2
