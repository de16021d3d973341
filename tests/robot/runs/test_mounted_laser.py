"""The whole robot in simulation with its laser mounted otherwise than in the middle."""

import numpy as np
import pytest

from lemtomap import se2
from lemtomap.robot.build import build_core
from lemtomap.robot.missions.missions import parse_mission
from lemtomap.robot.runs.lockstep import run_lockstep
from lemtomap.robot.runs.sim_server import mounting_of
from lemtomap.robot.settings.check import from_mapping
from lemtomap.sim import worlds
from lemtomap.sim.simulator import Simulator


def explored(tmp_path, config, mounting):
    """Return how far off the pose is after 12 s of exploring the office, metres and radians."""
    simulator = Simulator(worlds.load("office"), seed=4, mounting=mounting)
    T_world_start = simulator.truth().T_world_base
    core = build_core(config, tmp_path / "map.lemto", durable=False, seed=4)
    run_lockstep(simulator, core, parse_mission("explore"), 12.0)
    view, odometry = core.exchange.map_view.get(), core.exchange.odometry.get()
    truth = simulator.truth()
    T_start_base = se2.compose(view.T_grid_odom, odometry.T_odom_base)
    off = np.abs(se2.between(se2.between(T_world_start, truth.T_world_base), T_start_base))
    core.close()
    simulator.close()
    assert truth.contact_count == 0
    assert truth.path_m > 1.0
    return float(np.hypot(*off[:2])), float(off[2])


@pytest.mark.parametrize(
    "laser",
    [{"x_m": -0.15, "y_m": 0.04}, {"x_m": -0.12, "y_m": -0.05, "yaw_rad": 0.7, "roll_deg": 180.0}],
    ids=["behind", "upside down"],
)
def test_the_robot_explores_and_knows_where_it_is_with_a_laser_behind_or_upside_down(tmp_path, laser):
    config = from_mapping({"laser": laser})
    off_m, off_rad = explored(tmp_path, config, mounting_of(config))
    assert off_m < 0.05
    assert off_rad < 0.02
