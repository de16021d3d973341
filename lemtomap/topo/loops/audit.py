"""Committed closures stay on trial: what the window or the rest of the graph contradicts is taken back.

Two witnesses. The window: a place that lies round the corner only by a closure must be there when the robot
comes by. The graph: the way round without the closure must lead to where the closure leads, within what that
way can be wrong. Each witness for or against is counted; the closures found first count for themselves.
"""

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from lemtomap.se2 import Pose, adjoint, wrap_angle
from lemtomap.topo.file.paging import PagedGraph, Reached
from lemtomap.topo.graph import Covariance, DirectedEdge, Edge
from lemtomap.topo.loops.config import AuditConfig, GateConfig
from lemtomap.topo.loops.outlook import Expected, GraphUncertainty, LegSource
from lemtomap.types import EdgeType


@dataclass(slots=True, eq=False)
class Trial:
    """Closures that were committed together, and what speaks for and against them."""

    edges: list[Edge]
    support: float = 0.0
    """Evidence of the sightings they were committed for; 0 for one that somebody else put in."""
    confirmed: int = 0
    contradicted: int = 0

    def is_lost(self, config: AuditConfig) -> bool:
        """Return True if more speaks against them than for them."""
        return self.contradicted >= max(config.least_against, self.support + self.confirmed)


@dataclass(slots=True)
class Without:
    """A graph without some of its edges."""

    graph: LegSource
    edge_ids: frozenset[int]

    def legs_of(self, node_id: int) -> Sequence[DirectedEdge]:
        """Return the edges at a node as seen from it."""
        return [leg for leg in self.graph.legs_of(node_id) if leg.edge_id not in self.edge_ids]


@dataclass(slots=True)
class _Round:
    """The way round one trial's closures, while it is looked for."""

    trial: Trial
    outlook: GraphUncertainty


@dataclass(slots=True)
class Audit:
    """All trials, and the way round that is being looked for."""

    graph: PagedGraph
    config: AuditConfig
    gate: GateConfig
    _trial_of: dict[int, Trial] = field(default_factory=dict)
    _accused: bool = False
    """Whether anything was said against a trial since `lost` was last asked."""
    _due: deque[Trial] = field(default_factory=deque)
    _round: _Round | None = None

    def commit(self, edges: Iterable[Edge], support: float = 0.0) -> None:
        """Put closures that were committed together on trial."""
        trial = Trial(list(edges), support)
        for edge in trial.edges:
            self._trial_of[edge.edge_id] = trial
        self._due.append(trial)

    def notice(self, edges: Iterable[Edge]) -> None:
        """Put closures on trial that somebody else has put in."""
        for edge in edges:
            if edge.type is EdgeType.LOOP_CLOSING and edge.edge_id not in self._trial_of:
                self.commit([edge])

    def crossed(self, reached: Mapping[int, Reached], node_id: int) -> list[Trial]:
        """Return the trials whose closures lie on the way to a node; closures not seen before come on trial.

        One of two closures committed together is no way round the other.
        """
        found: dict[int, Trial] = {}
        at = node_id
        while (via := reached[at].via) is not None:
            if via.type is EdgeType.LOOP_CLOSING:
                self.notice([via])
                trial = self._trial_of[via.edge_id]
                found[id(trial)] = trial
            at = via.other(at)
        return list(found.values())

    def hear(self, trials: Iterable[Trial], *, agrees: bool) -> None:
        """Take in what the window says about the way over closures."""
        for trial in trials:
            if agrees:
                trial.confirmed += 1
            else:
                trial.contradicted += 1
                self._accused = True

    def advance(self, nodes: int) -> None:
        """Look a slice further for the way round the next closure due."""
        if self._round is None:
            if not self._due:
                return
            trial = self._due.popleft()
            edge_ids = frozenset(edge.edge_id for edge in trial.edges)
            source_id = trial.edges[0].source_id
            self._round = _Round(trial, GraphUncertainty(Without(self.graph, edge_ids), source_id, self.gate))
        outlook, edge = self._round.outlook, self._round.trial.edges[0]
        done = outlook.advance(nodes)
        if edge.target_id in outlook:
            expected = outlook.between(edge.source_id, edge.target_id)
            if expected is not None:
                self._judge(self._round.trial, edge, expected, outlook)
            self._round = None
        elif done:
            self._round = None

    def lost(self) -> list[Trial]:
        """Return the trials that are lost and forget them; the others then start without blame."""
        if not self._accused:
            return []
        self._accused = False
        gone = [trial for trial in self._trials() if trial.is_lost(self.config)]
        for trial in gone:
            for edge in trial.edges:
                self._trial_of.pop(edge.edge_id, None)
        if gone:
            self._round = None
            self._due.clear()
            for trial in self._trials():
                trial.contradicted = 0
                self._due.append(trial)
        return gone

    def _trials(self) -> list[Trial]:
        return list({id(trial): trial for trial in self._trial_of.values()}.values())

    def _judge(self, trial: Trial, edge: Edge, expected: Expected, outlook: GraphUncertainty) -> None:
        """Hold a closure against the way round it; who is wrong when they differ, the least supported is."""
        others = self._on_way(outlook, edge.target_id)
        if _chi2(edge, expected) <= self.config.limit_chi2:
            tight = float(np.trace(expected.covariance[:2, :2])) <= self.config.tight_m**2
            if tight and others:
                self.hear([trial, *others], agrees=True)
            return
        weakest = min([trial, *others], key=lambda each: each.support + each.confirmed)
        weakest.contradicted += self.config.least_against if others else 1_000
        self._accused = True

    def _on_way(self, outlook: GraphUncertainty, node_id: int) -> list[Trial]:
        """Return the trials with a closure on the way the outlook went to a node."""
        found: dict[int, Trial] = {}
        for before_id, after_id in outlook.way(node_id):
            edge = self.graph.edge_between(before_id, after_id)
            if edge is not None and edge.edge_id in self._trial_of:
                trial = self._trial_of[edge.edge_id]
                found[id(trial)] = trial
        return list(found.values())


def _chi2(edge: Edge, expected: Expected) -> float:
    """Return how far an edge is from where its target should be, squared Mahalanobis, 3 degrees."""
    off = np.asarray(edge.T_source_target - expected.T_from_node)
    off[2] = wrap_angle(off[2])
    return float(off @ np.linalg.solve(expected.covariance + _in_source(edge), off))


def _in_source(edge: Edge) -> Covariance:
    """Return an edge's covariance in the axes of its source."""
    turn = adjoint(_turn_only(edge.T_source_target))
    return np.asarray(turn @ edge.covariance @ turn.T)


def _turn_only(T_a_b: Pose) -> Pose:
    return np.array([0.0, 0.0, T_a_b[2]])
