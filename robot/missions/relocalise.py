"""What a robot does that does not know where it is: come to rest, look round, drive a little into the open.

The map's recogniser does the finding; this only gives it something to see. The mission waits meanwhile.
"""

import math

from lemtomap.nav.config import NavConfig
from lemtomap.nav.explore.explorer import Explorer
from lemtomap.nav.types import Goal, NavState
from lemtomap.robot.missions.missions import MissionInput, Order
from lemtomap.se2 import between
from lemtomap.topo.events import NothingKnownHere

REST_S = 2.0  # whoever put the robot down has time to step back
TURNS_RAD = (2.1, 2.1, 2.1)  # once round, in steps that leave no doubt which way to turn
LOOKING = "lost: looking for its place in the map"


class Finder:
    """Asked after every navigation cycle for as long as the robot is lost."""

    def __init__(self, config: NavConfig, now_s: float) -> None:
        self._config = config
        self._since_s = now_s
        self._turns = list(TURNS_RAD)
        self._asked_cycle: int | None = None
        self._explorer: Explorer | None = None

    def step(self, moment: MissionInput) -> Order:
        """Return where to go next; when all within reach was seen and nothing is known, tell the map so."""
        if moment.now_s - self._since_s < REST_S:
            return Order(text=LOOKING)
        if self._turning(moment):
            return Order(text=LOOKING)
        if self._turns:
            return Order(text=LOOKING, goal=self._turn(moment))
        return self._drive(moment)

    def _turning(self, moment: MissionInput) -> bool:
        """Return True if the robot still turns."""
        asked = self._asked_cycle
        if asked is None:
            return False
        output = moment.output
        over = output.state in {NavState.ARRIVED, NavState.FAILED, NavState.IDLE}
        return output.cycle <= asked or not over

    def _turn(self, moment: MissionInput) -> Goal:
        self._asked_cycle = moment.output.cycle
        view = moment.view
        T_node_base = between(view.T_grid_node[view.associated_id], view.T_grid_base)
        x_m, y_m, yaw_rad = T_node_base.tolist()
        heading_rad = math.remainder(yaw_rad + self._turns.pop(0), math.tau)
        return Goal(view.associated_id, (x_m, y_m), heading_rad)

    def _drive(self, moment: MissionInput) -> Order:
        """Explore without a note of it: what is open here may long be known in the map."""
        self._asked_cycle = None
        self._explorer = self._explorer or Explorer(nav=self._config)
        found = self._explorer.step(
            moment.view, moment.graph, moment.output, moment.T_odom_base, moment.now_s
        )
        if found.done:
            return Order(text=LOOKING, cancel=True, events=(NothingKnownHere(),))
        return Order(text=LOOKING, goal=found.goal)
