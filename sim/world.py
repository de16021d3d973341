"""What a simulated building is: boxes, things that move, a place to start, and the ground truth.

Frame `world`: metres, x east, y north, z up, floor at z = 0. Plain data, no engine.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lemtomap.sim.faults import Faults

Pose2 = tuple[float, float, float]
"""x m, y m, yaw rad."""


class Surface(StrEnum):
    """What a thing is made of, as the laser sees it."""

    WALL = "wall"
    FURNITURE = "furniture"
    DARK = "dark"
    GLASS = "glass"
    FLOOR = "floor"
    PERSON = "person"


ALBEDO: Mapping[Surface, float] = {
    Surface.WALL: 0.80,
    Surface.FURNITURE: 0.55,
    Surface.DARK: 0.06,
    Surface.GLASS: 0.0,
    Surface.FLOOR: 0.3,
    Surface.PERSON: 0.45,
}
"""Share of 785 nm light a surface gives back: white paint, wood, black leather or plastic, glass, carpet,
clothes (usual textbook values; the laser model needs only their order)."""


@dataclass(frozen=True, slots=True)
class Box:
    """One box, centre and half sizes in metres; turned by yaw, then tilted nose-up by pitch."""

    centre: tuple[float, float, float]
    half: tuple[float, float, float]
    yaw_rad: float = 0.0
    pitch_rad: float = 0.0
    surface: Surface = Surface.WALL


@dataclass(frozen=True, slots=True)
class Room:
    """Ground truth of one room."""

    name: str
    outline: tuple[tuple[float, float], ...]
    """Corners in metres, counter-clockwise."""
    kind: str = "room"
    level: int = 0

    def contains(self, x: float, y: float) -> bool:
        """Return True if a point lies inside (even-odd rule)."""
        inside = False
        for (x0, y0), (x1, y1) in zip(self.outline, self.outline[1:] + self.outline[:1], strict=True):
            if (y0 > y) != (y1 > y) and x < x0 + (y - y0) / (y1 - y0) * (x1 - x0):
                inside = not inside
        return inside


@dataclass(frozen=True, slots=True)
class Door:
    """Ground truth of one door: its two jambs and the two rooms it joins."""

    name: str
    ends: tuple[tuple[float, float], tuple[float, float]]
    rooms: tuple[str, str]

    @property
    def centre(self) -> tuple[float, float]:
        """Middle of the doorway, metres."""
        (x0, y0), (x1, y1) = self.ends
        return (x0 + x1) / 2, (y0 + y1) / 2


@dataclass(frozen=True, slots=True)
class GroundTruth:
    """What a perfect map would know."""

    rooms: tuple[Room, ...] = ()
    doors: tuple[Door, ...] = ()

    def graph(self) -> dict[str, set[str]]:
        """Return the room graph: who is next to whom through a door."""
        graph: dict[str, set[str]] = {room.name: set() for room in self.rooms}
        for door in self.doors:
            a, b = door.rooms
            graph.setdefault(a, set()).add(b)
            graph.setdefault(b, set()).add(a)
        return graph

    def room_at(self, x: float, y: float, level: int = 0) -> str | None:
        """Return the name of the room around a point of one storey."""
        return next((room.name for room in self.rooms if room.level == level and room.contains(x, y)), None)


@dataclass(frozen=True, slots=True)
class Raster:
    """The world as an image at the laser's height: the reference for planners, pictures and checks."""

    occupied: NDArray[np.bool_]
    """bool (rows, cols); [0, 0] is the cell of least x and y, rows grow with y."""
    free: NDArray[np.bool_]
    """bool (rows, cols): floor that is inside the building and not occupied."""
    resolution_m: float
    origin_m: tuple[float, float]

    def cell(self, x: float, y: float) -> tuple[int, int]:
        """Return (row, col) of a point."""
        x0, y0 = self.origin_m
        return int(np.floor((y - y0) / self.resolution_m)), int(np.floor((x - x0) / self.resolution_m))

    def point(self, row: int, col: int) -> tuple[float, float]:
        """Return the centre of a cell, metres."""
        x0, y0 = self.origin_m
        return x0 + (col + 0.5) * self.resolution_m, y0 + (row + 0.5) * self.resolution_m


class Motion(Protocol):
    """One moving thing in one run; may hold state."""

    def step(self, now_s: float, dt_s: float, robot: Pose2) -> Pose2:
        """Return where the thing is at now_s."""
        ...


class Mover(Protocol):
    """A thing that moves, as the world describes it."""

    @property
    def parts(self) -> tuple[Box, ...]:
        """Boxes in the thing's own frame."""
        ...

    def begin(self, seed: int) -> Motion:
        """Start one run."""
        ...


@dataclass(frozen=True, slots=True)
class World:
    """A building a robot can be put into."""

    name: str
    boxes: tuple[Box, ...]
    raster: Raster
    spawn: Pose2
    truth: GroundTruth = field(default_factory=GroundTruth)
    movers: tuple[Mover, ...] = ()
    dock: Pose2 | None = None
    """Where a charging dock stands and which way it faces."""
    flat: bool = True
    """False: there are ramps or holes, and wheels and cliff sensors must feel the floor."""
    level_height_m: float = 0.0
    """Height of one storey; 0 when there is only one."""
    faults: Faults | None = None
    """What goes wrong in a run in this world unless the run says otherwise."""
    description: str = ""
    remarks: tuple[str, ...] = ()
    """What the user should know about how the files were read, one line each."""

    def level_at(self, height_m: float) -> int:
        """Return the storey of a robot at a height."""
        return round(height_m / self.level_height_m) if self.level_height_m else 0
