"""What a perfect map would know of a building: rooms, doors between them, lifts. Never seen by the robot.

Frame `world`, metres. A room is an outline or a number in an image of labels; both answer `room_at`.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Point = tuple[float, float]
WIDEST_DOOR_M = 1.6  # what is wider is an opening


@dataclass(frozen=True, slots=True)
class Room:
    """Ground truth of one room."""

    name: str
    outline: tuple[Point, ...] = ()
    """Corners in metres, counter-clockwise; empty for a room that only the image of labels draws."""
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
class Doorway:
    """Ground truth of one door or opening: its two jambs and the two rooms it joins."""

    name: str
    ends: tuple[Point, Point]
    rooms: tuple[str, str]
    kind: str = "hinged"
    """hinged, sliding, double_hinged, double_sliding or opening."""
    stated_width_m: float | None = None
    """Clear width as the file gives it; None: from jamb to jamb."""
    level: int = 0

    @property
    def centre(self) -> Point:
        """Middle of the doorway, metres."""
        (x0, y0), (x1, y1) = self.ends
        return (x0 + x1) / 2, (y0 + y1) / 2

    @property
    def width_m(self) -> float:
        """Clear width."""
        return math.dist(*self.ends) if self.stated_width_m is None else self.stated_width_m

    @property
    def is_door(self) -> bool:
        """False for an opening: what is wider than 1.6 m, or has no leaf."""
        return self.kind != "opening" and self.width_m <= WIDEST_DOOR_M


@dataclass(frozen=True, slots=True)
class Lift:
    """A cabin and the levels it serves."""

    name: str
    centre: Point
    width_m: float
    depth_m: float
    levels: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class LabelImage:
    """Rooms as numbers of cells."""

    labels: NDArray[np.int32]
    """int32 (rows, cols), 0 for no room; row 0 at least y of the plan."""
    resolution_m: float
    origin_m: Point
    """Lower left corner, about which the plan is turned."""
    yaw_rad: float = 0.0

    def at(self, x: float, y: float) -> int:
        """Return the label at a point, 0 outside."""
        dx, dy = x - self.origin_m[0], y - self.origin_m[1]
        cos, sin = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        col = math.floor((cos * dx + sin * dy) / self.resolution_m)
        row = math.floor((cos * dy - sin * dx) / self.resolution_m)
        rows, cols = self.labels.shape
        return int(self.labels[row, col]) if 0 <= row < rows and 0 <= col < cols else 0


@dataclass(frozen=True, slots=True)
class GroundTruth:
    """What a perfect map would know."""

    rooms: tuple[Room, ...] = ()
    doors: tuple[Doorway, ...] = ()
    lifts: tuple[Lift, ...] = ()
    places: tuple[tuple[str, Point], ...] = ()
    """Points that somebody named."""
    image: LabelImage | None = None
    damage: tuple[str, ...] = ()
    """Why a file of it could not be read, one line each; then all else is empty."""

    def graph(self) -> dict[str, set[str]]:
        """Return the room graph: who is next to whom through a door."""
        graph: dict[str, set[str]] = {room.name: set() for room in self.rooms}
        for door in self.doors:
            a, b = door.rooms
            if a in graph and b in graph and a != b:
                graph[a].add(b)
                graph[b].add(a)
        return graph

    def room_at(self, x: float, y: float, level: int = 0) -> str | None:
        """Return the name of the room around a point of one storey."""
        if self.image is not None:
            return str(self.image.at(x, y) or "") or None
        return next((room.name for room in self.rooms if room.level == level and room.contains(x, y)), None)
