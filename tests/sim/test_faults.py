"""What goes wrong, from a world file, and the senses that are not the planar laser."""

import errno
import math
import os
import threading
from pathlib import Path

import numpy as np
import pytest

from lemtomap.sim import worlds
from lemtomap.sim.body import BodyState
from lemtomap.sim.errors import BadWorld
from lemtomap.sim.faults import Faults, LinkFaults
from lemtomap.sim.hokuyo import FIRST_STEP, LAST_STEP
from lemtomap.sim.serve import PtyServer
from lemtomap.sim.simulator import Simulator
from lemtomap.sim.tours import base_command
from lemtomap.sim.urg import ANGLES_RAD

ROOM = 'name = "w"\nspawn = [1.0, 1.0, 0.0]\n[[wall]]\npoints = [[0, 0], [6, 0], [6, 2], [0, 2], [0, 0]]\n'


def world_of(tmp_path, extra: str = "", top: str = ""):
    path = tmp_path / "w.toml"
    path.write_text(top + ROOM + extra)
    return worlds.load(path)


def test_faults_come_from_the_world_file_and_bad_ones_are_one_line(tmp_path):
    text = "[faults]\nstuck_left = [1.0, 2.0]\n[faults.kobuki]\nlose_byte = 0.25\nunplugged = [[3.0, 4.0]]\n"
    faults = world_of(tmp_path, text).faults
    assert faults == Faults(LinkFaults(lose_byte=0.25, unplugged=((3.0, 4.0),)), stuck_left=(1.0, 2.0))
    with pytest.raises(BadWorld, match=r"w\.toml:8: \[faults\.kobuki\] 'lose_byte' must be"):
        world_of(tmp_path, text.replace("0.25", "2"))
    with pytest.raises(BadWorld, match=r"w\.toml:8: \[faults\.kobuki\] unknown key 'loose_byte'"):
        world_of(tmp_path, text.replace("lose_byte", "loose_byte"))


def test_stuck_encoder_stops_counting_while_the_wheel_turns(tmp_path):
    simulator = Simulator(world_of(tmp_path), 1, Faults(stuck_right=(1.0, 50.0)))
    ticks = []
    for _ in range(150):
        simulator.kobuki.write(base_command(0.3, 0.0))
        simulator.advance(simulator.now_s + 0.02)
        ticks.append((simulator.base.last.readings.left_ticks, simulator.base.last.readings.right_ticks))
    simulator.close()
    gained = np.array(ticks[-1]) - np.array(ticks[52])
    assert gained[0] > 6000
    assert gained[1] == 0


def test_blocked_laser_sees_nothing_far_and_then_sees_again(tmp_path):
    simulator = Simulator(world_of(tmp_path), 1, Faults(blocked_laser=(0.3, 1.0)))
    simulator.hokuyo.write(b"BM\n")
    simulator.advance(0.9)
    assert simulator.last_scan.ranges_mm[FIRST_STEP:LAST_STEP].max() < 50
    simulator.advance(1.5)
    assert np.median(simulator.last_scan.ranges_mm[FIRST_STEP:LAST_STEP]) > 500
    simulator.close()


def test_beams_are_taken_one_by_one_while_the_robot_turns(tmp_path):
    simulator = Simulator(world_of(tmp_path), 1)
    simulator.hokuyo.write(b"BM\n")
    stamps, poses = [], []
    for _ in range(100):
        simulator.kobuki.write(base_command(0.0, 2.0))
        simulator.advance(simulator.now_s + 0.01)
        stamps.append(simulator.now_s)
        poses.append(simulator.base.body.state.yaw)
    turn = simulator.last_scan
    ranges = turn.ranges_mm[FIRST_STEP : LAST_STEP + 1] / 1000.0
    x, y, _ = simulator.base.body.state.pose
    simulator.close()
    beam_s = turn.started_s + np.arange(FIRST_STEP, LAST_STEP + 1) * 0.1 / 1024

    def wall_error(yaw):
        """How far the points are from the nearest of the four walls' faces."""
        px, py = x + ranges * np.cos(yaw + ANGLES_RAD), y + ranges * np.sin(yaw + ANGLES_RAD)
        faces = [np.abs(px - 0.06), np.abs(px - 5.94), np.abs(py - 0.06), np.abs(py - 1.94)]
        return np.median(np.min(faces, axis=0)[ranges > 0.02])

    assert wall_error(np.interp(beam_s, stamps, poses)) < 0.02
    assert wall_error(np.interp(turn.started_s, stamps, poses)) > 0.04


def test_depth_camera_sees_a_crate_that_the_laser_overlooks(tmp_path):
    world = world_of(tmp_path, '[[furniture]]\nkind = "crate"\nat = [2.6, 1.0, 0.0]\n')
    simulator = Simulator(world, 1)
    image = simulator.depth_image()
    points = simulator.camera.points_base(image)
    laser = simulator.perfect_scan_m(BodyState(1.0, 1.0, 0.0))
    simulator.close()
    crate = points[(points[:, 2] > 0.03) & (points[:, 2] < 0.13) & (np.abs(points[:, 1]) < 0.15)]
    assert len(crate) > 20
    assert np.median(crate[:, 0]) == pytest.approx(1.45, abs=0.03)
    assert np.nanmin(image) >= 0.78
    assert np.nanmax(image) < 4.1
    assert laser[340] == pytest.approx(4.94, abs=0.01)


def test_dock_is_seen_on_the_right_side_and_charges_on_contact(tmp_path):
    def base_at(spawn: str, dock: str):
        simulator = Simulator(world_of(tmp_path, top=f"dock = {dock}\n".replace("'", "")), 1)
        simulator.base.body.state = BodyState(*(float(v) for v in spawn.split()))
        simulator.advance(0.1)
        readings = simulator.base.last.readings
        simulator.close()
        return readings

    straight = base_at(f"2.0 1.0 {math.pi}", "[0.2, 1.0, 0.0]")
    assert straight.dock_ir == (0, 0x08, 0)  # far centre, middle receiver
    left = base_at("1.2 1.6 -1.5", "[0.2, 1.0, 0.0]")
    assert left.dock_ir == (0x10, 0, 0)  # on the dock's left, seen by the right receiver
    assert straight.charger == 0
    docked = base_at(f"0.38 1.0 {math.pi}", "[0.2, 1.0, 0.0]")
    assert docked.charger in {2, 6}
    assert docked.dock_ir[1] == 0x02


def test_a_slower_motor_turns_slower_and_its_stamps_and_beams_with_it(tmp_path):
    simulator = Simulator(world_of(tmp_path), 1)
    turns_s: list[float] = []

    def turn_for(seconds: float) -> list[float]:
        turns_s.clear()
        end_s = simulator.now_s + seconds
        while simulator.now_s < end_s:
            simulator.advance(simulator.now_s + 0.01)
            started_s = simulator.last_scan.started_s if simulator.last_scan else 0.0
            if not turns_s or turns_s[-1] != started_s:
                turns_s.append(started_s)
        return list(np.diff(turns_s[2:]))

    simulator.hokuyo.write(b"MD0044072501000\n")
    assert np.allclose(turn_for(1.0), 60.0 / 600, rtol=0.01)
    simulator.hokuyo.write(b"CR10\n")
    assert np.allclose(turn_for(1.5), 60.0 / 540, rtol=0.01)
    assert b"540[rpm]" in _ask(simulator, b"II\n")
    simulator.hokuyo.write(b"RS\nBM\n")
    assert np.allclose(turn_for(1.0), 60.0 / 600, rtol=0.01)
    simulator.close()


def _ask(simulator: Simulator, command: bytes) -> bytes:
    simulator.hokuyo.write(command)
    simulator.advance(simulator.now_s + 0.05)
    return simulator.hokuyo.read()


def test_a_scan_asked_for_by_one_client_is_not_sent_to_the_next(tmp_path):
    simulator = Simulator(world_of(tmp_path), 1)
    simulator.hokuyo.write(b"BM\nGD0044072501\n")
    simulator.hokuyo.hang_up()
    simulator.hokuyo.write(b"VV\n")
    simulator.advance(1.0)
    said = simulator.hokuyo.read()
    assert said.startswith(b"VV\n00P\n")
    assert b"GD" not in said
    simulator.close()


def test_only_what_was_asked_for_waits_for_a_slow_reader(tmp_path):
    simulator = Simulator(world_of(tmp_path), 1)
    simulator.hokuyo.write(b"BM\nGD0044072501\n")
    simulator.advance(0.5)
    assert [frame.answer for frame in simulator.hokuyo.read_frames()] == [True, True]
    simulator.hokuyo.write(b"MD0044072501000\n")
    simulator.advance(0.8)
    assert [frame.answer for frame in simulator.hokuyo.read_frames()][:3] == [True, False, False]
    assert not any(frame.answer for frame in simulator.kobuki.read_frames())
    simulator.close()


def hung_up(client: int) -> bool:
    """Read until the port says that it has gone."""
    try:
        while os.read(client, 4096):
            pass
    except OSError as error:
        return error.errno == errno.EIO
    return True


@pytest.mark.realtime
def test_unplugged_pseudo_terminal_hangs_up_and_comes_back_under_its_name(tmp_path):
    simulator = Simulator(world_of(tmp_path), 1, Faults(LinkFaults(unplugged=((0.3, 0.6),))))
    server, stop = PtyServer(simulator), threading.Event()
    path = server.kobuki_path
    client = os.open(path, os.O_RDWR | os.O_NOCTTY)
    thread = threading.Thread(target=server.serve, args=(stop, 1.2))
    thread.start()
    try:
        assert hung_up(client)
        os.close(client)
        while not Path(path).exists():
            assert thread.is_alive()
        client = os.open(path, os.O_RDWR | os.O_NOCTTY)
        assert os.read(client, 4096)
        os.close(client)
    finally:
        stop.set()
        thread.join()
        server.close()
        simulator.close()
    assert not Path(path).exists()
