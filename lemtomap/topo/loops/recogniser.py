"""What the mapper talks to: situations and places in, decisions out (thesis, 3-3-2: the explicit check)."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from lemtomap.topo.file.paging import PagedGraph
from lemtomap.topo.graph import Edge, Place
from lemtomap.topo.loops.closer import LoopCloser
from lemtomap.topo.loops.config import LoopConfig
from lemtomap.topo.loops.descriptor import describe
from lemtomap.topo.loops.index import PlaceIndex
from lemtomap.topo.loops.locator import Locator, WindowSnapshot
from lemtomap.topo.recognition import (
    Closed,
    Decision,
    Located,
    News,
    NotFound,
    Revoked,
    Situation,
)


class LoopRecogniser:
    """Explicit loop closing for one mapper (its `recogniser`)."""

    def __init__(self, config: LoopConfig | None = None) -> None:
        self.config = config or LoopConfig()
        self.closures: list[Edge] = []
        """All that were committed and not taken back."""
        self.locator: Locator | None = None
        """At work while a part of the map is not joined to the robot's."""
        self.revoked: list[int] = []
        """Edge IDs of those that were taken back."""
        self._is_behind = True
        self._lost_m = 0.0

    def attach(self, graph: PagedGraph) -> None:
        """Work on this map from now on; called once, before all else."""
        self._graph = graph
        self._closer = LoopCloser(self.config, graph)
        self._index: PlaceIndex | None = None

    def describe(self, points_node: NDArray[np.float64]) -> bytes:
        """Return the rotation-invariant descriptor of boundary points, float64 (N, 2), node frame."""
        return describe(points_node)

    def place_taken(self, node_id: int, place: Place) -> None:  # noqa: ARG002 - read again from the file
        """Take note of a node's localisation data, new or renewed."""
        self._is_behind = True
        self._closer.place_taken(node_id)

    def update(self, situation: Situation) -> list[Decision]:
        """Work a slice after each scan; return what was decided, to be carried out in this order."""
        self._hear(situation)
        if self._is_behind:
            self._is_behind = not self._index_of_map().catch_up()
        decisions: list[Decision] = []
        if not situation.lost:
            if wrong := self._proved_wrong(situation):
                return wrong  # all else that could be said now rests on them
            decisions += self._close()
            self._watch_other_parts()
        if self.locator is not None:
            decisions += self._locate(situation, self.locator)
        return decisions

    def committed(self, decision: Closed | Located, edges: Sequence[Edge]) -> None:
        """Put the edges that a decision has become on trial, with the evidence there is for them."""
        if isinstance(decision, Closed):
            evidence = sum(closure.evidence for closure in decision.closures)
        else:
            evidence = float(self.config.locator.checks)
        self.closures += edges
        if edges:
            self._closer.audit.commit(edges, support=evidence)

    def _hear(self, situation: Situation) -> None:
        match situation.news:
            case News.LOST:
                self._look_for_robot(situation)
            case News.WINDOW if situation.lost:
                self._look_for_robot(situation)
            case News.WINDOW:
                self._closer.restart()
                self.locator = None
            case News.NODE:
                self._is_behind = True  # whatever else changed the file is noticed here
                if not situation.lost:
                    self._closer.at_node(situation)

    # -- the robot's place in the map
    # ---------------------------------------------------------------------------

    def _look_for_robot(self, situation: Situation) -> None:
        """Look for the robot in all of the map but what it maps from now on."""
        part_id = situation.part_id
        self._closer.restart()
        self._lost_m = situation.travelled_m
        self.locator = self._locator(lambda node_id: node_id < part_id)

    def _watch_other_parts(self) -> None:
        """Look beside the mapping for parts of the map that nothing joins to the robot's yet."""
        closer = self._closer
        if self.locator is None and closer.sees_parts_apart():
            self.locator = self._locator(lambda node_id: not closer.is_joined(node_id))

    def _locator(self, is_known: Callable[[int], bool]) -> Locator:
        return Locator(self.config, self._graph, self._index_of_map(), is_known)

    def _locate(self, situation: Situation, locator: Locator) -> list[Decision]:
        """Look for the robot in the rest of the map."""
        if locator.due(situation.travelled_m, situation.turned_rad):
            locator.look(WindowSnapshot.of(situation))
        found = locator.update(self.config.locator.budget if situation.lost else self.config.budget)
        if found is not None:
            self._closer.restart()
            self.locator = None
            return [Located(found)]
        if situation.lost and situation.travelled_m - self._lost_m > self.config.locator.unknown_m:
            return [NotFound()]
        return []

    # -- closures
    # -----------------------------------------------------------------------------------------------

    def _proved_wrong(self, situation: Situation) -> list[Decision]:
        """Return the closures to take back; what was believed because of them is forgotten."""
        audit = self._closer.audit
        audit.notice(self._graph.edges_of(situation.here_id))
        wrong = [Revoked(tuple(edge.edge_id for edge in trial.edges)) for trial in audit.lost()]
        if wrong:
            edge_ids = [edge_id for each in wrong for edge_id in each.edge_ids]
            self.closures = [edge for edge in self.closures if edge.edge_id not in edge_ids]
            self.revoked += edge_ids
            self._closer.start_afresh()
        return list(wrong)

    def _close(self) -> list[Decision]:
        """Return the closures that have become certain, and where the associated node was found again."""
        closed = self._closer.update()
        confirmed, self._closer.confirmed = self._closer.confirmed, []
        return [*([] if closed is None else [closed]), *confirmed]

    def _index_of_map(self) -> PlaceIndex:
        if self._index is None:
            self._index = PlaceIndex.of_map(self._graph.store)
        return self._index
