"""Nothing is compiled, or loaded from the cache, while the robot drives."""

import subprocess
import sys

DRIVE = """
import gc, pathlib, sys
from numba.core.registry import CPUDispatcher
from lemtomap.robot.build import build_core
from lemtomap.robot.config import RobotConfig
from lemtomap.robot.runs.lockstep import run_lockstep
from lemtomap.robot.missions.missions import parse_mission
from lemtomap.robot.runs.warmup import warm_up
from lemtomap.sim import worlds
from lemtomap.sim.simulator import Simulator

def kernels():
    gc.unfreeze()  # warming up freezes what it made, and what is frozen is not among the objects listed
    return {
        (each.py_func.__qualname__, str(signature))
        for each in gc.get_objects()
        if isinstance(each, CPUDispatcher) and each.py_func.__module__.startswith("lemtomap.")
        for signature in each.signatures
    }

warm_up(RobotConfig())
warm = kernels()
rare = {"told_apart", "eroded", "in_front", "share_near"}  # places alike, out of view, passers-by
assert rare <= {name for name, _ in warm}
path = pathlib.Path(sys.argv[1])
for mission, seconds in (("explore", 40.0), ("goto:1", 40.0)):  # then known, and lost in it at first
    simulator = Simulator(worlds.load("office"), seed=1)
    core = build_core(RobotConfig(), path, durable=False)
    run_lockstep(simulator, core, parse_mission(mission), seconds)
    core.close()
    simulator.close()
print(sorted(kernels() - warm))
"""


def test_a_warm_robot_meets_no_kernel_for_the_first_time(tmp_path):
    command = [sys.executable, "-c", DRIVE, str(tmp_path / "map.lemto")]
    done = subprocess.run(command, check=True, capture_output=True, text=True)  # noqa: S603 - our own interpreter
    assert done.stdout.strip() == "[]"
