"""The whole robot in the built-in office, on a virtual clock: real bytes, real map, real motion."""

import hashlib

import numpy as np
import pytest

from lemtomap.drivers.kobuki.session import KobukiSession
from lemtomap.robot.build import build_core
from lemtomap.robot.config import RobotConfig
from lemtomap.robot.devices.recording import Call
from lemtomap.robot.exchange import MissionState
from lemtomap.robot.missions.missions import parse_mission
from lemtomap.robot.runs.lockstep import run_lockstep
from lemtomap.sim import worlds
from lemtomap.sim.simulator import Simulator


def drive(path, mission, duration_s, seed=4):
    simulator = Simulator(worlds.load("office"), seed=seed)
    core = build_core(RobotConfig(), path / "map.lemto", durable=False, seed=seed)
    calls = []
    ended = run_lockstep(simulator, core, parse_mission(mission), duration_s, record=calls.append)
    trail = np.concatenate(list(core.mapping.mapper.topo.trail.records()))
    truth = simulator.truth()
    core.close()
    simulator.close()
    return ended, calls, trail, truth


@pytest.fixture(scope="module")
def explored(tmp_path_factory):
    return drive(tmp_path_factory.mktemp("first"), "explore", 25.0)


def test_the_robot_explores_without_contact_and_maps_every_scan(explored):
    ended, _, trail, truth = explored
    assert ended.state is MissionState.RUNNING
    assert truth.contact_count == 0
    assert truth.path_m > 3.0
    assert len(trail) > 230
    assert len(np.unique(trail["node_id"])) >= 3


def test_the_last_bytes_to_the_base_are_a_stop(explored):
    sent = [entry for entry in explored[1] if entry.device == "kobuki" and entry.call is Call.SEND]
    assert sent[-1].data == KobukiSession().stop_bytes()
    assert any(entry.data != sent[-1].data for entry in sent[:-1])


def test_the_same_seed_gives_the_same_bytes_and_the_same_map(explored, tmp_path):
    _, calls, trail, _ = drive(tmp_path, "explore", 25.0)

    def digest(entries):
        whole = b"".join(f"{e.device}{e.call}{e.stamp_ns}".encode() + e.data for e in entries)
        return hashlib.sha256(whole).hexdigest()

    assert digest(calls) == digest(explored[1])
    assert trail.tobytes() == explored[2].tobytes()
