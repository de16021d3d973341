"""The world behind the ports, in lock-step."""

import struct

import numpy as np
import pytest

from lemtomap.sim import worlds
from lemtomap.sim.body import BodyState
from lemtomap.sim.errors import BadWorld, Unplugged
from lemtomap.sim.faults import Faults, LinkFaults
from lemtomap.sim.raster import clearance_m
from lemtomap.sim.simulator import Simulator
from lemtomap.sim.urg import ANGLES_RAD
from tools.bench.sim import cast_segments, edges, segments_of

STREAM = b"MD0044072501000\n"


def drive(speed_mmps: int, radius_mm: int) -> bytes:
    body = bytes((6, 1, 4)) + struct.pack("<hh", speed_mmps, radius_mm)
    checksum = 0
    for byte in body:
        checksum ^= byte
    return b"\xaa\x55" + body + bytes((checksum,))


def run(simulator: Simulator, seconds: float, command: bytes = b"") -> tuple[bytes, bytes]:
    base, laser = b"", b""
    begin = simulator.now_s
    for tick in range(1, round(seconds / 0.02) + 1):
        simulator.kobuki.write(command)
        simulator.advance(begin + tick * 0.02)
        base += simulator.kobuki.read()
        laser += simulator.hokuyo.read()
    return base, laser


@pytest.fixture
def office():
    simulator = Simulator(worlds.load("office"), seed=3)
    yield simulator
    simulator.close()


def test_same_seed_and_commands_give_the_same_bytes_and_another_seed_does_not():
    def bytes_of(seed: int) -> tuple[bytes, bytes]:
        simulator = Simulator(worlds.load("office"), seed, Faults(hokuyo=LinkFaults(flip_bit=1e-3)))
        simulator.hokuyo.write(STREAM)
        result = run(simulator, 2.0, drive(300, 700))
        simulator.close()
        return result

    assert bytes_of(1) == bytes_of(1)
    assert bytes_of(1) != bytes_of(2)


def test_fifty_packets_and_ten_scans_a_second(office):
    office.hokuyo.write(STREAM)
    run(office, 1.0)
    base, laser = run(office, 5.0)
    assert abs(base.count(b"\xaa\x55\x4d\x01\x0f") + base.count(b"\xaa\x55\x53\x01\x0f") - 250) <= 1
    assert abs(laser.count(b"99b\n") - 50) <= 1


def test_robot_goes_where_it_is_told(office):
    x, y, yaw = office.truth().T_world_base
    run(office, 5.0, drive(200, 0))
    run(office, 1.0, drive(0, 0))
    moved = office.truth().T_world_base - [x, y, yaw]
    assert abs(moved[0] - 1.0) < 0.05
    assert abs(moved[1]) < 0.1
    run(office, 3.0, drive(60, 1))  # 0.52 rad/s to the left
    assert 1.3 < office.truth().T_world_base[2] - yaw < 1.8


def test_wall_stops_the_body_presses_the_bumper_and_lets_the_wheels_spin(office):
    run(office, 4.0, drive(100, 1))  # turn to the left, to the north wall
    base, _ = run(office, 10.0, drive(200, 0))
    bumpers = {base[i + 7] for i in range(len(base) - 8) if base[i : i + 2] == b"\xaa\x55"}
    assert bumpers & {0x02, 0x06, 0x04, 0x03, 0x01}
    truth = office.truth()
    assert truth.touching
    assert truth.contact_count >= 1
    assert truth.T_world_base[1] < 10.0 - 0.06 - 0.177


def test_unplugged_port_says_so_and_comes_back(office):
    office.kobuki.unplug()
    with pytest.raises(Unplugged):
        office.kobuki.read()
    run_s = office.now_s + 0.5
    office.advance(run_s)
    office.kobuki.replug()
    assert office.kobuki.read() == b""
    office.advance(run_s + 0.1)
    assert office.kobuki.read()


def test_lost_bytes_and_latency_bursts_reach_the_host():
    world = worlds.load("office")
    faults = Faults(kobuki=LinkFaults(lose_byte=0.01, burst_s=0.016))
    simulator = Simulator(world, 1, faults)
    arrivals = []
    received = 0
    for tick in range(1, 1001):
        simulator.advance(tick * 0.001)
        data = simulator.kobuki.read()
        received += len(data)
        if data:
            arrivals.append(tick)
    simulator.close()
    sent = 50 * 81
    assert 0.95 * sent < received < sent
    assert all(tick % 16 == 0 for tick in arrivals)


def test_laser_sees_the_walls_where_they_are(office):
    office.hokuyo.write(b"BM\n")
    run(office, 0.5)
    office.hokuyo.write(b"GD0384038401\nGD0640064001\n")  # ahead and 90 degrees to the left
    _, laser = run(office, 0.5)
    left_line = laser.split(b"GD0640064001\n")[1].split(b"\n")[2]
    left_mm = sum((byte - 0x30) << shift for byte, shift in zip(left_line[:3], (12, 6, 0), strict=True))
    assert abs(left_mm - (6.0 - 0.06 - 5.0) * 1000) < 60


def test_unknown_world_is_one_clear_line():
    with pytest.raises(BadWorld, match=r"nowhere: no such world; known are office"):
        worlds.load("nowhere")


def test_ros_map_becomes_few_boxes_and_bad_ones_one_line(tmp_path):
    grey = np.full((60, 80), 254, dtype=np.uint8)
    grey[0] = grey[-1] = grey[:, 0] = grey[:, -1] = 0
    grey[30, 20:60] = 0
    image = tmp_path / "m.pgm"
    image.write_bytes(b"P5\n80 60\n255\n" + grey.tobytes())
    settings = tmp_path / "m.yaml"
    text = "image: m.pgm\nresolution: 0.05\norigin: [-1, -2, 0]\nnegate: 0\n"
    settings.write_text(text)
    world = worlds.load(settings)
    assert len(world.boxes) <= 6
    assert world.raster.free[world.raster.cell(*world.spawn[:2])]
    assert world.raster.origin_m == (-1.0, -2.0)
    area = sum(4 * box.half[0] * box.half[1] for box in world.boxes)
    assert abs(area - (grey == 0).sum() * 0.05**2) < 1e-9
    image.write_bytes(b"P5\n80 60\n255\n" + (grey * 0).tobytes())
    with pytest.raises(BadWorld, match=r"m\.pgm: no free space"):
        worlds.load(settings)
    image.write_bytes(b"hello")
    with pytest.raises(BadWorld, match=r"m\.pgm: not a readable image"):
        worlds.load(settings)
    settings.write_text(text.replace("0.05", "x"))
    with pytest.raises(BadWorld, match=r"m\.pgm: not a readable image|must be a number"):
        worlds.load(settings)


def test_rays_agree_with_a_caster_that_knows_only_line_segments():
    world = worlds.load("offices:20:4")
    simulator = Simulator(world, 0)
    segments = segments_of(world, simulator.config.urg.height_m)
    rng = np.random.default_rng(1)
    cells = np.argwhere(clearance_m(world.raster) > 0.25)
    compared = 0
    for row, col in cells[rng.integers(0, len(cells), 25)]:
        x, y = world.raster.point(int(row), int(col))
        yaw = float(rng.uniform(-3, 3))
        ours = simulator.perfect_scan_m(BodyState(x, y, yaw))
        theirs = cast_segments(segments, (x, y), yaw + ANGLES_RAD, 5.6)
        same = ~(edges(ours) | edges(theirs))
        assert np.array_equal(np.isfinite(ours[same]), np.isfinite(theirs[same]))
        both = same & np.isfinite(ours)
        assert np.abs(ours[both] - theirs[both]).max(initial=0.0) < 0.02
        compared += int(both.sum())
    simulator.close()
    assert compared > 10_000
