"""The mission `dock` through the whole robot: mux, smoother and safety gate before the wheels."""

import dataclasses

from lemtomap.robot.build import build_core
from lemtomap.robot.config import RobotConfig
from lemtomap.robot.exchange import MissionState
from lemtomap.robot.missions.missions import parse_mission
from lemtomap.robot.runs.lockstep import run_lockstep
from lemtomap.sim import worlds
from lemtomap.sim.simulator import Simulator


def test_the_robot_parks_on_its_dock_and_says_so_only_when_it_charges(tmp_path):
    world = dataclasses.replace(worlds.load("office"), spawn=(1.0, 5.0, 0.5))
    simulator = Simulator(world, seed=4)
    core = build_core(RobotConfig(), tmp_path / "map.lemto", durable=False, seed=4)
    ended = run_lockstep(simulator, core, parse_mission("dock"), 90.0)
    told = [note.text for note in core.exchange.notes.drain()]
    contacts = simulator.truth().contact_count
    core.close()
    simulator.close()
    assert (ended.state, ended.text) == (MissionState.DONE, "docked and charging")
    assert told.index("docking: waiting for the charger") < told.index("docked and charging")
    assert contacts == 0
