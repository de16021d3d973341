"""Closures believed for now: each gathers sightings over the next nodes and is committed late (thesis, 7-2).

A sighting says where a known node lies in the window. Sightings that put the same part of the old map at the
same place in the window belong to one hypothesis; those that put it elsewhere are rivals, and while a rival
lives nothing is committed. A wrong closure is worse than a late one.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from lemtomap.se2 import Pose, between, compose
from lemtomap.topo.graph import Covariance
from lemtomap.topo.loops.config import LoopConfig
from lemtomap.topo.loops.matcher import SearchMatch
from lemtomap.topo.recognition import Found

Around = Callable[[int], Mapping[int, Pose]]
"""T_node_other of the nodes around a node, by the map's own edges."""


@dataclass(frozen=True, slots=True)
class Sighting:
    """A known node found in the window, and where the robot's own map was then."""

    node_id: int
    match: SearchMatch
    here_id: int
    """The node the robot was at."""
    T_here_node: Pose
    covariance: Covariance
    """float64 (3, 3), of T_here_node, axes of the node sighted."""
    travelled_m: float
    informs: bool
    """Whether the robot's own node stood surely in the window."""
    evidence: float = 1.0
    """How much it counts, 0..1."""

    @property
    def found(self) -> Found:
        """Where the node stands in the window by this sighting."""
        return Found(self.node_id, self.match.T_grid_place, self.match.covariance)


@dataclass(slots=True)
class Hypothesis:
    """One belief about which known part of the map this is."""

    sightings: list[Sighting] = field(default_factory=list)
    heard: bool = False
    """Whether all other places within the gate have been searched too."""
    needed: int = 2
    """Sightings it takes; one more where the graph has no say."""
    rejected: int = 0
    """How often the window contradicted it."""

    @property
    def latest(self) -> Sighting:
        """The newest sighting."""
        return self.sightings[-1]

    def support(self, config: LoopConfig) -> float:
        """Return the evidence of the sightings that count, those at least `apart_m` of travel from the one
        counted before, less the searches that contradicted.
        """
        total, counted_m = 0.0, -np.inf
        for sighting in self.sightings:
            if sighting.travelled_m - counted_m >= config.apart_m:
                total, counted_m = total + sighting.evidence, sighting.travelled_m
        return total - self.rejected


class Hypotheses:
    """All beliefs alive, and the rule by which one becomes certain."""

    def __init__(self, config: LoopConfig, around: Around) -> None:
        self.config = config
        self.alive: list[Hypothesis] = []
        self._around = around

    def add(self, sighting: Sighting) -> Hypothesis:
        """Let a sighting support the hypothesis it agrees with, or begin one."""
        for hypothesis in self.alive:
            if self._agrees(hypothesis.latest, sighting):
                hypothesis.sightings.append(sighting)
                return hypothesis
        hypothesis = Hypothesis([sighting])
        self.alive.append(hypothesis)
        return hypothesis

    def drop_old(self, travelled_m: float) -> None:
        """Forget what the following nodes did not confirm, or contradicted."""
        self.alive = [
            hypothesis
            for hypothesis in self.alive
            if travelled_m - hypothesis.latest.travelled_m <= self.config.forget_after_m
            and hypothesis.rejected < len(hypothesis.sightings) + 1
        ]

    def certain(self) -> Hypothesis | None:
        """Return a hypothesis with enough support, heard, and without a rival; None when there is none."""
        for hypothesis in self.alive:
            if not hypothesis.heard or hypothesis.support(self.config) < hypothesis.needed:
                continue
            if not any(
                other is not hypothesis and 2 * len(other.sightings) >= len(hypothesis.sightings)
                for other in self.alive
            ):
                return hypothesis
        return None

    def _agrees(self, earlier: Sighting, later: Sighting) -> bool:
        """Return True if two sightings put the old map at the same place in the window."""
        T_earlier_later = self._around(earlier.node_id).get(later.node_id)
        if T_earlier_later is None:
            return False
        expected = compose(earlier.match.T_grid_place, T_earlier_later)
        off = between(expected, later.match.T_grid_place)
        far_m = (
            float(np.hypot(T_earlier_later[0], T_earlier_later[1])) + later.travelled_m - earlier.travelled_m
        )
        slack = 1.0 + 0.1 * far_m
        return bool(
            np.hypot(off[0], off[1]) <= self.config.agree_m * slack
            and abs(off[2]) <= self.config.agree_rad * slack
        )
