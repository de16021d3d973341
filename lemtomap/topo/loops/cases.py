"""What closing loops talks about: the robot's situation, a place to search in it, what comes of it."""

from collections.abc import Container
from dataclasses import dataclass

import numpy as np

from lemtomap.se2 import Pose, adjoint
from lemtomap.topo.graph import Covariance
from lemtomap.topo.loops.audit import Trial
from lemtomap.topo.loops.hypotheses import Hypothesis
from lemtomap.topo.loops.matcher import Match, Reference, Search, SearchBox
from lemtomap.types import GridView


@dataclass(frozen=True, slots=True)
class Situation:
    """Where the robot is, as the mapper sees it at one update."""

    here_id: int
    T_grid_here: Pose
    covariance: Covariance
    """float64 (3, 3) of T_grid_here, axes of the node."""
    T_grid_base: Pose
    travelled_m: float
    grid: GridView
    unsure_m: float
    """Way since the robot's own node was sure."""
    measured: Container[int]
    """Nodes whose place in this window is sure: born in it, or found in it by a search."""


@dataclass(frozen=True, slots=True)
class Closure:
    """A relation between two nodes that has become certain."""

    here_id: int
    node_id: int
    T_here_node: Pose
    covariance: Covariance
    """float64 (3, 3), axes of the target."""
    T_grid_node: Pose
    """Where it was seen in the window."""
    match: Match
    informs: bool
    """Whether the first node's place in the window was sure, so that the relation tells something new."""
    evidence: float
    """How much its sighting counted, 0..1."""


@dataclass(frozen=True, slots=True)
class Confirmed:
    """The associated node was found about where the mapper has it, only better."""

    node_id: int
    T_grid_node: Pose
    covariance: Covariance


@dataclass(slots=True)
class Task:
    """One place to search in one snapshot."""

    node_id: int
    situation: Situation
    reference: Reference
    box: SearchBox
    way_m: float
    """Way over edges from the node the robot was at."""
    hearing_for: Hypothesis | None = None
    follows: Hypothesis | None = None
    """The belief that says where the place should be found."""
    T_grid_followed: Pose | None = None
    on_trial: tuple[Trial, ...] = ()
    """Closures that say that the place must be here."""
    search: Search | None = None


def reversed_covariance(T_a_b: Pose, covariance: Covariance) -> Covariance:
    """Return the covariance of T_b_a (axes of a) from that of T_a_b (axes of b), float64 (3, 3)."""
    turn = adjoint(T_a_b)
    return np.asarray(turn @ covariance @ turn.T)
