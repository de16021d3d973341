"""What navigation tells the topological map."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class EdgeTraversed:
    """The robot drove from one node to a neighbour."""

    from_id: int
    to_id: int
    time_s: float


@dataclass(frozen=True, slots=True)
class EdgeBlocked:
    """The way between two neighbours proved closed; plan around it until then (0 opens it again)."""

    from_id: int
    to_id: int
    until_s: float


@dataclass(frozen=True, slots=True)
class Bumped:
    """The robot felt something ("bump", "cliff", "wheel_drop") at a point of its own frame."""

    kind: str
    x_base_m: float
    y_base_m: float
    stamp_s: float


@dataclass(frozen=True, slots=True)
class OpeningSeen:
    """An opening towards unexplored space, in the frame of a node; known already or new.

    Navigation gives the ID, counting on from the largest in the map, so that it can name the opening later.
    """

    placeholder_id: int
    node_id: int
    x_m: float
    y_m: float
    yaw_rad: float
    width_m: float


@dataclass(frozen=True, slots=True)
class OpeningDone:
    """An opening was explored, or found closed."""

    placeholder_id: int
    closed: bool


@dataclass(frozen=True, slots=True)
class GroundSeen:
    """What has been seen around a node, for exploration to ask for when the robot comes back."""

    node_id: int
    picture: bytes
    """As navigation codes it; the map only keeps it."""


@dataclass(frozen=True, slots=True)
class NothingKnownHere:
    """A lost robot has seen all it can reach, and none of it looks like the map: this place is new."""


@dataclass(frozen=True, slots=True)
class LevelChanged:
    """The robot is on another level now: it came out of a lift, or to the end of a ramp."""

    level: int


NavEvent = (
    EdgeTraversed
    | EdgeBlocked
    | Bumped
    | OpeningSeen
    | OpeningDone
    | GroundSeen
    | NothingKnownHere
    | LevelChanged
)
