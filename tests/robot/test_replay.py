"""A recording holds everything that made the samples."""

import pickle

import numpy as np

from drivers.hokuyo.events import LaserScan
from drivers.kobuki.events import KobukiSample
from robot.build import build_core
from robot.config import RobotConfig
from robot.recording import Recorder
from robot.replay import replay_events, replay_map
from robot.wire import HOKUYO, KOBUKI, RecordedHokuyoSession, RecordedKobukiSession, Wire
from sim import worlds
from sim.errors import Unplugged
from sim.faults import Faults, LinkFaults
from sim.simulator import Simulator


def record(path, seconds):
    """Listen to a noisy robot whose cables are pulled now and then; return what it told."""
    noisy = LinkFaults(lose_byte=1e-3, flip_bit=1e-4, burst_s=0.016, unplugged=((1.5, 1.9), (3.0, 3.2)))
    simulator = Simulator(worlds.load("office"), seed=2, faults=Faults(kobuki=noisy, hokuyo=noisy))
    recorder = Recorder(path)
    base_session = RecordedKobukiSession(recorder.raw)
    base = Wire(KOBUKI, simulator.kobuki, base_session, recorder.raw, Unplugged)
    laser_session = RecordedHokuyoSession(recorder.raw)
    laser = Wire(HOKUYO, simulator.hokuyo, laser_session, recorder.raw, Unplugged)
    told = []
    for step in range(1, round(seconds * 50)):
        now_s = step * 20_000_000 * 1e-9
        simulator.advance(now_s)
        told += base.poll(now_s)
        told += laser.poll(now_s)
        base.write(base_session.drive(0.1, 0.2), now_s)
    recorder.close()
    simulator.close()
    return told


def test_the_same_samples_come_out_bit_for_bit(tmp_path):
    told = record(tmp_path / "run.mcap", 5.0)
    again = [
        event
        for _, samples in replay_events(tmp_path / "run.mcap")
        for event in (*samples.base, *samples.laser)
    ]
    assert sum(isinstance(event, LaserScan) for event in told) > 15
    assert sum(isinstance(event, KobukiSample) for event in told) > 150
    assert [pickle.dumps(event) for event in again] == [pickle.dumps(event) for event in told]


def test_a_recorded_run_can_be_mapped_again(tmp_path):
    told = record(tmp_path / "run.mcap", 5.0)
    core = build_core(RobotConfig(), tmp_path / "map.lemto", durable=False)
    end_s = replay_map(tmp_path / "run.mcap", core)
    trail = np.concatenate(list(core.mapping.mapper.topo.trail.records()))
    core.close()
    assert 4.9 < end_s <= 5.0
    whole = sum(isinstance(event, LaserScan) and event.complete for event in told)
    assert whole - 4 <= len(trail) <= whole
