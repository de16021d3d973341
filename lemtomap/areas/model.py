"""The two nouns of the area map: doors and areas. A door stands in the frame of a node, an area is nodes."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from lemtomap.se2 import Pose


class AreaKind(StrEnum):
    """What sort of area a person, or its shape, says it is."""

    ROOM = "room"
    CORRIDOR = "corridor"
    AREA = "area"
    """Neither, or nobody knows."""


@dataclass(frozen=True, slots=True)
class MappedDoor:
    """A gap between wall ends, 0.6 to 1.6 m wide, that parts two areas. Its ID is never used again."""

    door_id: int
    node: int
    """The node in whose frame it stands."""
    x_m: float
    y_m: float
    yaw_rad: float
    """Direction of the door's normal, the way one walks through it, in the node's frame."""
    width_m: float
    edges: tuple[int, ...] = ()
    """IDs of the edges that lead through it."""
    seen_open: int = 0
    seen_shut: int = 0
    """Looks at it from different places that found it so."""
    last_open_s: float | None = None
    last_shut_s: float | None = None
    passed: int = 0
    """How often the robot drove through."""
    is_door: bool = True
    """False for a place where the floor only narrows, between two areas without a door."""

    @property
    def id(self) -> int:
        """The door's ID."""
        return self.door_id

    @property
    def T_node_door(self) -> Pose:  # noqa: N802 - a frame's name
        """Pose of the door's middle, x along its normal, float64 (3,)."""
        return np.array([self.x_m, self.y_m, self.yaw_rad])

    @property
    def is_shut(self) -> bool:
        """Whether it was shut when the robot saw it last."""
        if self.last_shut_s is None:
            return False
        return self.last_open_s is None or self.last_shut_s > self.last_open_s

    def ends(self) -> NDArray[np.float64]:
        """Return both ends of the gap, float64 (2, 2), metres, node frame."""
        half = 0.5 * self.width_m * np.array([-np.sin(self.yaw_rad), np.cos(self.yaw_rad)])
        middle = np.array([self.x_m, self.y_m])
        return np.array([middle - half, middle + half])


@dataclass(frozen=True, slots=True)
class Area:
    """Nodes with one area ID: mostly a room or a corridor. Its ID is never used again."""

    area_id: int
    name: str = ""
    kind: str = ""
    """What a person says it is; empty when nobody said anything."""
    aliases: tuple[int, ...] = ()
    """IDs of areas that proved to be part of this one."""
    other_names: tuple[str, ...] = ()
    """Names of those areas, which mean this one now."""
    level: int = 0
    is_held: bool = False
    """A person drew it: the robot adds nodes that are born in it, and changes nothing else."""

    @property
    def id(self) -> int:
        """The area's ID."""
        return self.area_id
