"""The topological map's two nouns (thesis, section 3-3-1). A node has no pose; only edges relate places.

An edge's covariance is that of a small motion of the target in its *own* axes (right perturbation, as in
g2o and gtsam): the true relative pose is compose(T_source_target, xi), xi ~ N(0, covariance).
"""

from dataclasses import dataclass
from enum import StrEnum
from math import hypot
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from lemtomap.se2 import Pose, adjoint, inverse
from lemtomap.types import EdgeType, RouteEdge

Covariance = NDArray[np.float64]
"""float64 (3, 3): m, m, rad, symmetric and positive definite."""

Quantity = TypeVar("Quantity", float, NDArray[np.floating])
"""One number, or many in an array."""

USUAL_SPEED_MPS = 0.4  # expected speed on an edge nobody has driven yet; half of Kobuki's 0.7 m/s and a bit
FOR_EVER_S = 1e18
"""blocked_until_s of an edge closed by hand."""
UNPROVEN_DETOUR = 8.0
"""Way over straight line on a loop closing edge that nobody has driven: it says where a place is, not that
one can drive straight to it (thesis, section 2-1, observation based edges); a wall may stand between."""


@dataclass(frozen=True, slots=True)
class Node:
    """A place: an identity that is never used again, the area and level it is on, and how to recognise it."""

    node_id: int
    area_id: int = 1
    level: int = 0
    created_s: float = 0.0
    visits: int = 1
    """How often the robot associated with this node; long-term operation prunes and ages by it."""
    doubts: int = 0
    """Visits in a row at which the place did not look like its localisation data."""


@dataclass(frozen=True, slots=True)
class Place:
    """A node's localisation data: the obstacle boundary in the node's frame, coded, and its descriptor."""

    taken_s: float
    boundary: bytes
    descriptor: bytes = b""


@dataclass(frozen=True, slots=True)
class Edge:
    """A measured relation between two nodes. Its identity is never used again."""

    edge_id: int
    source_id: int
    target_id: int
    T_source_target: Pose
    covariance: Covariance
    type: EdgeType
    share: float = 1.0
    """0..1: how much of the covariance's information no other edge already holds. Near-neighbour edges
    read off the same window as the odometry edges beside them tell nothing new (0): they serve routes."""
    time_s: float | None = None
    """Learnt traversal time; None where no one has driven yet."""
    blocked_until_s: float = 0.0

    @property
    def length_m(self) -> float:
        """Length of the straight line between the ends (thesis: the edge's cost)."""
        x_m, y_m, _ = self.T_source_target.tolist()
        return hypot(x_m, y_m)

    @property
    def expected_time_s(self) -> float:
        """Learnt traversal time, else length over the usual speed, with the detour that a closure may
        take.
        """
        if self.time_s is not None:
            return self.time_s
        return straight_s(self.length_m, detour(self.type))

    @property
    def is_closed(self) -> bool:
        """Whether somebody closed it by hand; what a robot closed opens again by itself."""
        return self.blocked_until_s >= FOR_EVER_S

    @property
    def is_proven(self) -> bool:
        """Whether the line between the ends is known to be free: driven, or seen in the window."""
        return self.time_s is not None or self.type is not EdgeType.LOOP_CLOSING

    def other(self, node_id: int) -> int:
        """Return the end that is not `node_id`."""
        return self.target_id if node_id == self.source_id else self.source_id

    def seen_from(self, node_id: int) -> Pose:
        """Return the pose of the other end in this end's frame, float64 (3,)."""
        if node_id == self.source_id:
            return self.T_source_target
        return inverse(self.T_source_target)

    def covariance_from(self, node_id: int) -> Covariance:
        """Return the covariance of `seen_from(node_id)`, in the axes of the other end."""
        if node_id == self.source_id:
            return self.covariance
        turn = adjoint(self.T_source_target)
        return turn @ self.covariance @ turn.T


class DirectedEdge(NamedTuple):
    """An edge as seen from one end, in plain numbers: what a look over many thousand edges needs of each."""

    edge_id: int
    other_id: int
    x_m: float
    y_m: float
    yaw_rad: float
    """Pose of the other end in this end's frame."""
    length_m: float
    shift_var: float
    """Mean variance of the translation, m^2."""
    turn_var: float
    """rad^2."""

    @classmethod
    def along(cls, edge: Edge, node_id: int) -> "DirectedEdge":
        """Return an edge as seen from the node."""
        x_m, y_m, yaw_rad = edge.seen_from(node_id).tolist()
        (xx, _, _), (_, yy, _), (_, _, turn_var) = edge.covariance.tolist()
        other_id, length_m = edge.other(node_id), hypot(x_m, y_m)
        return cls(edge.edge_id, other_id, x_m, y_m, yaw_rad, length_m, 0.5 * (xx + yy), turn_var)


class OpeningState(StrEnum):
    """What became of an unexplored opening (thesis, section 7-2: placeholders)."""

    OPEN = "open"
    EXPLORED = "explored"
    CLOSED = "closed"


@dataclass(frozen=True, slots=True)
class Placeholder:
    """An opening towards unexplored space, remembered after the window forgot it; in its node's frame."""

    placeholder_id: int
    node_id: int
    x_m: float
    y_m: float
    yaw_rad: float
    width_m: float = 0.0
    state: OpeningState = OpeningState.OPEN


@dataclass(frozen=True, slots=True)
class Mark:
    """Something felt rather than seen (a bump, a cliff), in its node's frame."""

    mark_id: int
    node_id: int
    kind: str
    x_m: float
    y_m: float
    stamp_s: float


def route_edge(edge: Edge, node_id: int) -> RouteEdge:
    """Return what a planner needs of an edge, seen from one of its ends."""
    return RouteEdge(
        edge.edge_id,
        edge.other(node_id),
        edge.length_m,
        edge.expected_time_s,
        edge.blocked_until_s,
        edge.is_proven,
    )


def detour(kind: EdgeType) -> float:
    """Return the way to expect over the straight line on an edge that nobody has driven."""
    return UNPROVEN_DETOUR if kind is EdgeType.LOOP_CLOSING else 1.0


def straight_s(length_m: Quantity, detour_share: Quantity | float = 1.0) -> Quantity:
    """Return the time to expect over an edge that nobody has driven, or over many in arrays of equal length.

    detour_share: the way to expect over the straight line; 1 where the line is seen to be free.
    """
    return length_m / USUAL_SPEED_MPS * detour_share


def chain_covariance(first: Covariance, T_b_c: Pose, second: Covariance) -> Covariance:
    """Return the covariance of compose(T_a_b, T_b_c) in axes of c from those of its two parts.

    Independent parts, first order (Smith, Self and Cheeseman 1990).
    """
    carry = adjoint(inverse(T_b_c))
    return np.asarray(carry @ first @ carry.T + second)


def reversed_covariance(T_a_b: Pose, covariance: Covariance) -> Covariance:
    """Return the covariance of T_b_a (axes of a) from that of T_a_b (axes of b), float64 (3, 3)."""
    turn = adjoint(T_a_b)
    return np.asarray(turn @ covariance @ turn.T)


WEAK_AXIS = 0.1  # a direction with less of the strongest one's information tells nothing (thesis, appendix D)


def sure_of(information: Covariance, *, weak_axis: float = WEAK_AXIS) -> Covariance:
    """Return the covariance of a match from its information, a metre along what it does not really see.

    Walls are never quite straight, so a corridor seems to say a little about the way along it. It does not.
    """
    low, high = np.linalg.eigh(information[:2, :2])[0]
    if low < weak_axis * high:
        along = np.zeros(3)
        along[:2] = np.linalg.eigh(information[:2, :2])[1][:, 0]
        keep = np.eye(3) - np.outer(along, along)
        information = keep @ information @ keep
    values, axes = np.linalg.eigh(information)
    return np.asarray(axes @ np.diag(1.0 / np.maximum(values, 1.0)) @ axes.T)
