"""Things that move, floors that are not flat, and what the robot feels of them."""

import math

import numpy as np
import pytest

from lemtomap.sim import worlds
from lemtomap.sim.movers import Appearing, Person, SwingDoor
from lemtomap.sim.route import FloorRoutePlanner
from lemtomap.sim.simulator import Simulator
from lemtomap.sim.tours import ScriptedTour, base_command, drive
from lemtomap.sim.world import Box

FAR = (50.0, 50.0, 0.0)


def yaws(door: SwingDoor, robot, seconds: float) -> list[float]:
    motion = door.begin(0)
    return [motion.step(0.01 * k, 0.01, robot)[2] for k in range(round(seconds * 100))]


def test_door_opens_and_closes_by_its_timetable_but_never_on_the_robot():
    door = SwingDoor((0.0, 0.0), 0.0, 0.9, period_s=20.0, open_share=0.5, phase_s=0.0)
    angles = yaws(door, FAR, 20.0)
    assert angles[100] == pytest.approx(math.radians(85))
    assert angles[-1] == 0.0
    assert max(np.abs(np.diff(angles))) <= math.radians(0.46)
    assert yaws(door, (0.5, 0.0, 0.0), 20.0)[-1] == pytest.approx(math.radians(25), abs=math.radians(3))
    assert yaws(door, (0.5, -0.23, 0.0), 5.0)[-1] == pytest.approx(math.radians(85))  # it opens away from it


def test_person_gives_way_at_the_last_moment_and_still_arrives():
    motion = Person(((0.0, 0.0), (6.0, 0.0)), speed_mps=1.0).begin(0)
    robot = (3.0, 0.05, 0.0)
    track = [motion.step(0.01 * k, 0.01, robot) for k in range(900)]
    distances = [math.dist(place[:2], robot[:2]) for place in track]
    assert 0.35 < min(distances) < 0.76
    assert max(place[0] for place in track) > 5.9
    assert abs(track[200][1]) < 0.01  # straight on until then


def test_appearing_thing_is_absent_before_and_after():
    motion = Appearing((Box((0, 0, 0.5), (1, 1, 0.5)),), 1.0, 2.0).begin(0)
    here = [motion.step(t, 0.01, FAR)[0] == 0.0 for t in (0.5, 1.0, 1.9, 2.0)]
    assert here == [False, True, True, False]


def small(tmp_path, extra: str):
    path = tmp_path / "w.toml"
    path.write_text(
        'name = "w"\nspawn = [1.0, 1.0, 0.0]\n[[wall]]\npoints = [[0, 0], [6, 0], [6, 2], [0, 2], [0, 0]]\n'
        + extra
    )
    return worlds.load(path)


def forward(simulator: Simulator, seconds: float, v: float = 0.3) -> list[bytes]:
    packets = []
    for _ in range(round(seconds / 0.02)):
        simulator.kobuki.write(base_command(v, 0.0))
        simulator.advance(simulator.now_s + 0.02)
        packets.append(simulator.kobuki.read())
    return packets


def test_closed_corridor_appears_in_mid_mission_and_is_bumped_into(tmp_path):
    world = small(tmp_path, "[[barrier]]\nfrom = [4.0, 0.1]\nto = [4.0, 1.9]\nduring = [1.0, 100.0]\n")
    simulator = Simulator(world, 1)
    forward(simulator, 12.0)
    x = simulator.truth().T_world_base[0]
    simulator.close()
    assert 3.7 < x < 3.78


def test_low_crate_is_under_the_laser_but_not_under_the_bumper(tmp_path):
    world = small(tmp_path, '[[furniture]]\nkind = "crate"\nat = [3.0, 1.0, 0.0]\n')
    simulator = Simulator(world, 1)
    simulator.hokuyo.write(b"BM\n")
    packets = forward(simulator, 8.0)
    ahead_mm = simulator.last_scan.ranges_mm[380:389]
    simulator.close()
    assert simulator.truth().T_world_base[0] < 2.7
    assert packets[-1][7] & 0x02  # centre bumper
    assert np.median(ahead_mm) > 2500


def test_glass_stops_the_body_and_not_the_light(tmp_path):
    world = small(tmp_path, '[[wall]]\npoints = [[3, 0], [3, 2]]\nsurface = "glass"\n')
    simulator = Simulator(world, 1)
    simulator.hokuyo.write(b"BM\n")
    forward(simulator, 8.0)
    simulator.close()
    assert simulator.truth().T_world_base[0] < 2.77
    assert np.median(simulator.last_scan.ranges_mm[380:389]) > 2500


def test_cliff_is_felt_before_the_wheels_and_then_they_hang(tmp_path):
    world = small(tmp_path, "[[hole]]\nlow = [3.0, -0.9]\nhigh = [5.0, 2.9]\n")
    simulator = Simulator(world, 1)
    packets = forward(simulator, 9.0)
    simulator.close()
    cliffs = [packet[9] for packet in packets if packet[:2] == b"\xaa\x55"]
    drops = [packet[8] for packet in packets if packet[:2] == b"\xaa\x55"]
    assert cliffs[0] == 0
    first = next(index for index, bits in enumerate(cliffs) if bits)
    assert cliffs[first] & 0x02
    assert any(drops)
    assert next(index for index, bits in enumerate(drops) if bits) > first


def test_ramp_lifts_the_robot_to_the_next_storey_and_the_gyro_feels_it():
    world = worlds.load("storeys:2")
    simulator = Simulator(world, 1)
    path = FloorRoutePlanner(world.raster).through([(2.0, 5.0), (0.75, 10.8), (15.25, 10.8), (14.0, 8.0)])
    pitch = [simulator.base.body.state.pitch for _ in drive(simulator, ScriptedTour(path), 120.0)]
    truth = simulator.truth()
    simulator.close()
    assert truth.room == "1/lobby"
    assert truth.height_m == pytest.approx(1.3, abs=0.02)
    assert max(pitch) == pytest.approx(math.atan(0.1), abs=0.01)
    assert truth.contact_count == 0
