"""Build a world of your own and let the simulated robot explore it: two rooms and a door between them.

Needs `pip install 'lemtomap[sim]'`. Everything runs on a virtual clock, as fast as the machine can. It prints
the mission's end, the nodes of the map, and that nothing was touched. The same world may be a file of ten
lines: see docs/bring-your-own.md.
"""

import tempfile
from pathlib import Path

from lemtomap.robot.build import build_core
from lemtomap.robot.config import RobotConfig
from lemtomap.robot.missions.missions import parse_mission
from lemtomap.robot.runs.lockstep import run_lockstep
from lemtomap.sim import furniture
from lemtomap.sim.floorplan import FloorPlan
from lemtomap.sim.simulator import Simulator
from lemtomap.sim.world import World


def flat() -> World:
    """Return two rooms of 3 m by 3 m, a door of 0.95 m and a cabinet. Metres, the world's own frame."""
    plan = FloorPlan("flat")
    plan.rectangle((0.0, 0.0), (6.0, 3.0))
    plan.wall((3.0, 0.0), (3.0, 3.0))
    plan.door("door", (3.0, 1.5), ("west", "east"))
    for box in furniture.cabinet(5.0, 2.7, 0.0):
        plan.box(box)
    return plan.build(spawn=(1.0, 1.5, 0.0))


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        simulator = Simulator(flat(), seed=1)
        core = build_core(RobotConfig(), Path(folder) / "flat.lemto")
        ended = run_lockstep(simulator, core, parse_mission("explore"), 120.0)
        nodes = core.mapping.mapper.topo.store.count("node")
        core.close()
        truth = simulator.truth()
        simulator.close()
    print(f"{ended.state} after {ended.now_s:.0f} s: {ended.text}")
    print(f"{nodes} nodes, {truth.path_m:.1f} m driven, {truth.contact_count} contacts")
