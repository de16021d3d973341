"""A mission without end: see the building, then drive to one place after another."""

from dataclasses import dataclass

import numpy as np

from lemtomap.robot.exchange import MissionState
from lemtomap.robot.missions.missions import (
    Explore,
    GoTo,
    MissionInput,
    Order,
)
from lemtomap.topo.file.reader import TopoReader


@dataclass(slots=True)
class Errand:
    """One goal and how it went."""

    node_id: int
    begun_s: float
    ended_s: float = 0.0
    reached: bool = False
    text: str = ""


class ExploreThenGoals:
    """Explores until done or for so long, then takes nodes of its own map at random, for ever."""

    def __init__(self, explore_s: float, seed: int) -> None:
        self.errands: list[Errand] = []
        """Finished ones, in order."""
        self.explored_s: float | None = None
        """When exploring ended."""
        self.explored_text = ""
        self._explore: Explore | None = Explore()
        self._explore_s = explore_s
        self._rng = np.random.default_rng(seed)
        self._leg: GoTo | None = None
        self._errand = Errand(0, 0.0)

    @property
    def under_way(self) -> Errand | None:
        """The goal that is being driven to; None while exploring."""
        return self._errand if self._leg is not None else None

    def step(self, moment: MissionInput) -> Order:
        """Return what to do now; never over."""
        if self._explore is not None:
            order = self._explore.step(moment)
            if not order.state.over and moment.now_s < self._explore_s:
                return order
            self.explored_s, self.explored_text = moment.now_s, order.text
            self._explore = None
        if self._leg is not None:
            order = self._leg.step(moment)
            if not order.state.over:
                return order
            self._errand.ended_s, self._errand.text = moment.now_s, order.text
            self._errand.reached = order.state is MissionState.DONE
            self.errands.append(self._errand)
        node_id = self._drawn(moment)
        self._leg, self._errand = GoTo(str(node_id)), Errand(node_id, moment.now_s)
        order = self._leg.step(moment)
        return Order(MissionState.RUNNING, order.text, order.goal)

    def _drawn(self, moment: MissionInput) -> int:
        """Return a node of the map other than the one here."""
        graph = moment.graph
        if not isinstance(graph, TopoReader):
            raise TypeError("the soak drives over a map file")
        while True:
            node_id = int(self._rng.integers(1, graph.node_count() + 1))
            if node_id != moment.view.associated_id and graph.has_node(node_id):
                return node_id
