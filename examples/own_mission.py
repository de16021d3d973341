"""Give the robot a mission of your own: drive the corners of a square beside where it began, so many times.

Needs `pip install 'lemtomap[sim]'`. It runs in the simulated office on a virtual clock and prints each corner
as it is reached, then `done`. A mission only says where to go next, never how.
"""

import tempfile
from pathlib import Path

from lemtomap import Goal
from lemtomap.nav.types import NavState
from lemtomap.robot.build import build_core
from lemtomap.robot.config import RobotConfig
from lemtomap.robot.exchange import MissionState
from lemtomap.robot.missions.missions import MissionInput, Order
from lemtomap.robot.runs.lockstep import run_lockstep
from lemtomap.sim import worlds
from lemtomap.sim.simulator import Simulator


class Square:
    """Asked after every navigation cycle: gives a corner, waits for the verdict, gives the next."""

    def __init__(self, side_m: float, rounds: int = 1) -> None:
        corners = ((side_m, 0.0), (side_m, side_m), (0.0, side_m), (0.0, 0.0))
        self._left = list(corners) * rounds
        self._asked_cycle: int | None = None

    def step(self, moment: MissionInput) -> Order:
        """Return what to do now: the corners are in the frame of the node at which the run began, metres."""
        if self._asked_cycle is not None and moment.output.cycle > self._asked_cycle:
            if moment.output.state is NavState.FAILED:
                return Order(MissionState.FAILED, f"a corner was not reached: {moment.output.text}")
            if moment.output.state is NavState.ARRIVED:
                print(f"{moment.now_s:.0f} s: at corner {self._left.pop(0)}")
                self._asked_cycle = None
        if not self._left:
            return Order(MissionState.DONE, "all corners driven")
        if self._asked_cycle is None:
            self._asked_cycle = moment.output.cycle
            return Order(text=f"{len(self._left)} corners to go", goal=Goal(moment.start_id, self._left[0]))
        return Order(text=f"{len(self._left)} corners to go")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        simulator = Simulator(worlds.load("office"), seed=1)
        core = build_core(RobotConfig(), Path(folder) / "office.lemto")
        ended = run_lockstep(simulator, core, Square(0.6), 90.0)
        core.close()
        simulator.close()
    print(f"{ended.state}: {ended.text}")
