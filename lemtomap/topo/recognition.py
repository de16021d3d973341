"""What the mapper and the recogniser of places tell each other: a situation, and what was decided in it."""

from collections.abc import Container, Sequence
from dataclasses import dataclass
from enum import Enum, auto
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lemtomap.se2 import Pose
from lemtomap.topo.file.paging import PagedGraph
from lemtomap.topo.graph import Covariance, Edge, Place
from lemtomap.topo.place.hits import HitMap
from lemtomap.types import GridView

HITS_REACH_M = 14.2  # half the diagonal of a 20 m window


class News(Enum):
    """What this scan brought that matters for recognising places."""

    NONE = auto()
    NODE = auto()
    """A node was made or became the associated one."""
    LOST = auto()
    """The robot does not know where in the map it is: nodes from `part_id` on are a part apart."""
    WINDOW = auto()
    """The window began anew, on another level: nothing found in the old one counts any more."""


@dataclass(frozen=True, slots=True)
class Situation:
    """Where the robot is, as the mapper sees it after one scan."""

    here_id: int
    """The associated node."""
    T_grid_here: Pose
    covariance: Covariance
    """float64 (3, 3) of T_grid_here, axes of the node."""
    T_grid_base: Pose
    travelled_m: float
    turned_rad: float
    grid: GridView
    unsure_m: float
    """Way since the robot's own node was sure."""
    measured: Container[int]
    """Nodes whose place in this window is sure: born in it, or found in it by a search."""
    hits: HitMap
    occupied_from: int
    """Occupancy of `grid` that counts as an obstacle."""
    news: News = News.NONE
    lost: bool = False
    part_id: int = 1

    def points_grid(self) -> NDArray[np.float64]:
        """Return the averaged hits in the window around the robot, float64 (N, 2), metres."""
        x, y, _ = self.T_grid_base.tolist()
        return self.hits.around((x, y), HITS_REACH_M, self.grid, self.occupied_from)


@dataclass(frozen=True, slots=True)
class Found:
    """A known node found in the window."""

    node_id: int
    T_grid_node: Pose
    covariance: Covariance
    """float64 (3, 3), axes of the node."""


@dataclass(frozen=True, slots=True)
class Closure:
    """A relation between two nodes that has become certain."""

    here_id: int
    T_here_node: Pose
    covariance: Covariance
    """float64 (3, 3) of T_here_node, axes of the node found."""
    found: Found
    informs: bool
    """Whether the first node's place in the window was sure, so that the relation tells something new."""
    evidence: float
    """How much its sighting counted, 0..1."""


@dataclass(frozen=True, slots=True)
class Closed:
    """The robot has been here before: closures that became certain together."""

    closures: tuple[Closure, ...]


@dataclass(frozen=True, slots=True)
class Revoked:
    """Closures proved wrong."""

    edge_ids: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Located:
    """The robot, or the part of the map that it is in, was found in the rest of the map."""

    found: Found


@dataclass(frozen=True, slots=True)
class Confirmed:
    """The associated node was found about where the mapper has it, only better."""

    found: Found


@dataclass(frozen=True, slots=True)
class NotFound:
    """A lost robot has gone far and was found nowhere: this must be a place not mapped yet."""


Decision = Closed | Revoked | Located | Confirmed | NotFound


class Recogniser(Protocol):
    """Explicit loop closing, as the mapper sees it."""

    def attach(self, graph: PagedGraph) -> None:
        """Work on this map from now on; called once, before all else."""
        ...

    def describe(self, points_node: NDArray[np.float64]) -> bytes:
        """Return the rotation-invariant descriptor of boundary points, float64 (N, 2), node frame."""
        ...

    def place_taken(self, node_id: int, place: Place) -> None:
        """Take note of a node's localisation data, new or renewed."""
        ...

    def update(self, situation: Situation) -> Sequence[Decision]:
        """Work a slice after each scan; return what was decided, to be carried out in this order."""
        ...

    def committed(self, decision: Closed | Located, edges: Sequence[Edge]) -> None:
        """Take note of the edges that a decision has become: of each closure that informs, in their order."""
        ...
