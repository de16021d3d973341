"""Draw a building: walls, doors cut into them, rooms, furniture; `build` gives the World and its truth."""

import math
from dataclasses import dataclass, field

from lemtomap.sim.errors import BadStart, BadWorld
from lemtomap.sim.faults import Faults
from lemtomap.sim.raster import FAR_M, SPAWN_CLEARANCE_M, find_spawn, fits, rasterise
from lemtomap.sim.truth.model import Doorway, GroundTruth, Room
from lemtomap.sim.world import Box, Mover, Pose2, Surface, World

WALL_THICKNESS_M = 0.12
WALL_HEIGHT_M = 2.4
DOOR_WIDTH_M = 0.95  # a usual office door, 0.90 to 1.00 m

Point = tuple[float, float]


@dataclass
class _Wall:
    start: Point
    end: Point
    thickness_m: float
    height_m: float
    surface: Surface
    base_m: float = 0.0
    """Height of the floor it stands on."""
    gaps: list[tuple[float, float]] = field(default_factory=list)
    """Openings as (from, to) along the wall, metres from its start."""

    @property
    def length_m(self) -> float:
        return math.dist(self.start, self.end)

    def locate(self, point: Point) -> tuple[float, float]:
        """Return (metres along, metres off) of a point."""
        ux, uy = self.direction()
        dx, dy = point[0] - self.start[0], point[1] - self.start[1]
        return dx * ux + dy * uy, abs(-dx * uy + dy * ux)

    def direction(self) -> Point:
        return (self.end[0] - self.start[0]) / self.length_m, (self.end[1] - self.start[1]) / self.length_m

    def at(self, along: float) -> Point:
        ux, uy = self.direction()
        return self.start[0] + along * ux, self.start[1] + along * uy

    def pieces(self) -> list[tuple[float, float]]:
        """Return what is left of the wall between its gaps."""
        pieces, begin = [], 0.0
        for low, high in sorted(self.gaps):
            if low - begin > 0.01:
                pieces.append((begin, low))
            begin = max(begin, high)
        if self.length_m - begin > 0.01:
            pieces.append((begin, self.length_m))
        return pieces

    def boxes(self) -> list[Box]:
        yaw = math.atan2(self.end[1] - self.start[1], self.end[0] - self.start[0])
        boxes = []
        for low, high in self.pieces():
            x, y = self.at((low + high) / 2)
            # outer ends reach half a thickness further, so that corners close
            grow = sum(self.thickness_m / 4 for end in (low <= 0.0, high >= self.length_m) if end)
            half = ((high - low) / 2 + grow, self.thickness_m / 2, self.height_m / 2)
            shift = self.thickness_m / 4 * ((high >= self.length_m) - (low <= 0.0))
            ux, uy = self.direction()
            centre = (x + ux * shift, y + uy * shift, self.base_m + self.height_m / 2)
            boxes.append(Box(centre, half, yaw, surface=self.surface))
        return boxes


class FloorPlan:
    """A building being drawn."""

    def __init__(self, name: str, wall_height_m: float = WALL_HEIGHT_M) -> None:
        self.name = name
        self.level = 0
        """Storey being drawn."""
        self.level_height_m = 0.0
        self._wall_height_m = wall_height_m
        self.flat = True
        self.dock: Pose2 | None = None
        self.faults: Faults | None = None
        self.remarks: tuple[str, ...] = ()
        self._walls: list[_Wall] = []
        self._boxes: list[Box] = []
        self._rooms: list[Room] = []
        self._doors: list[Doorway] = []
        self._movers: list[Mover] = []

    def wall(
        self,
        start: Point,
        end: Point,
        *,
        thickness_m: float = WALL_THICKNESS_M,
        height_m: float | None = None,
        surface: Surface = Surface.WALL,
    ) -> None:
        """Draw a straight wall."""
        if math.dist(start, end) < 0.01:
            raise BadWorld(f"{self.name}: wall at {start} has no length")
        height = self._wall_height_m if height_m is None else height_m
        self._walls.append(_Wall(start, end, thickness_m, height, surface, self._base_m))

    @property
    def _base_m(self) -> float:
        return self.level * self.level_height_m

    def outline(self, margin_m: float) -> tuple[float, float, float, float]:
        """Return x0, y0, x1, y1 around all walls. Raises BadWorld when there are none."""
        points = [point for wall in self._walls for point in (wall.start, wall.end)]
        if not points:
            raise BadWorld(f"{self.name}: no walls")
        xs, ys = [x for x, _ in points], [y for _, y in points]
        return min(xs) - margin_m, min(ys) - margin_m, max(xs) + margin_m, max(ys) + margin_m

    def rectangle(self, low: Point, high: Point) -> None:
        """Draw four walls."""
        (x0, y0), (x1, y1) = low, high
        corners = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
        for start, end in zip(corners, corners[1:] + corners[:1], strict=True):
            self.wall(start, end)

    def door(
        self,
        name: str,
        at: Point,
        rooms: tuple[str, str],
        *,
        width_m: float = DOOR_WIDTH_M,
    ) -> Doorway:
        """Cut a doorway into the wall through `at`. Raises BadWorld when no wall is there."""
        for wall in self._walls:
            if wall.base_m != self._base_m:
                continue
            along, off = wall.locate(at)
            if off <= wall.thickness_m and width_m / 2 <= along <= wall.length_m - width_m / 2:
                low, high = along - width_m / 2, along + width_m / 2
                wall.gaps.append((low, high))
                door = Doorway(name, (wall.at(low), wall.at(high)), rooms, level=self.level)
                self._doors.append(door)
                return door
        raise BadWorld(f"{self.name}: door '{name}' at ({at[0]:g}, {at[1]:g}) lies in no wall")

    def opening(self, name: str, start: Point, end: Point, rooms: tuple[str, str]) -> None:
        """Note a passage without a wall, as wide as the room."""
        self._doors.append(Doorway(name, (start, end), rooms, "opening", level=self.level))

    def room(self, name: str, low: Point, high: Point, *, kind: str = "room") -> None:
        """Name a rectangle as ground truth."""
        (x0, y0), (x1, y1) = low, high
        self._rooms.append(Room(name, ((x0, y0), (x1, y0), (x1, y1), (x0, y1)), kind, self.level))

    def box(self, box: Box) -> None:
        """Put a box anywhere."""
        self._boxes.append(box)

    def mover(self, mover: Mover) -> None:
        """Add something that moves."""
        self._movers.append(mover)

    def build(self, spawn: Pose2 | None = None, description: str = "", name: str | None = None) -> World:
        """Raise the walls. Raises BadStart when the spawn pose stands in something, and BadWorld."""
        boxes = tuple(box for wall in self._walls for box in wall.boxes()) + tuple(self._boxes)
        inside = spawn[:2] if spawn is not None else self._middle()
        if not all(abs(metres) <= FAR_M for box in boxes for metres in (*box.centre, *box.half)):
            raise BadWorld(f"{self.name}: something reaches more than {FAR_M / 1000:g} km")
        try:
            raster = rasterise(boxes, inside)
        except BadWorld as error:
            raise BadWorld(f"{self.name}: {error}") from error
        if spawn is None:
            spawn = find_spawn(raster, self.name)
        elif not fits(raster, spawn[0], spawn[1], SPAWN_CLEARANCE_M / 2):
            raise BadStart(f"{self.name}: spawn ({spawn[0]:g}, {spawn[1]:g}) overlaps a wall or furniture")
        truth = GroundTruth(tuple(self._rooms), tuple(self._doors))
        return World(
            name=name or self.name,
            boxes=boxes,
            raster=raster,
            spawn=spawn,
            truth=truth,
            movers=tuple(self._movers),
            dock=self.dock,
            flat=self.flat,
            level_height_m=self.level_height_m,
            faults=self.faults,
            description=description,
            remarks=self.remarks,
        )

    def _middle(self) -> Point:
        if not self._rooms:
            return 0.0, 0.0
        outline = self._rooms[0].outline
        return sum(x for x, _ in outline) / len(outline), sum(y for _, y in outline) / len(outline)
