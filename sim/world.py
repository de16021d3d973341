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
from lemtomap.sim.truth.model import GroundTruth

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
