"""What navigation takes in and gives out, beside the types all of LEMTOMap shares."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from lemtomap.deskew import UNMOVED
from lemtomap.samples import as_number, as_row, as_whole
from lemtomap.se2 import Pose, compose
from lemtomap.topo.events import NavEvent
from lemtomap.types import Scan, Twist

Points = NDArray[np.float64]
"""float64 (N, 2), metres."""

FLOOR_M = 0.025
"""A depth camera's floor is rough by this much near by, and by FLOOR_SLOPE more per metre of distance."""
FLOOR_SLOPE = 0.012
ROBOT_HEIGHT_M = 0.45
"""TurtleBot 2 with its plates: 0.42 m."""
BODY_M = 0.25
"""Nearer points are the robot itself."""


@dataclass(frozen=True, slots=True)
class Goal:
    """A place to go: a node, or a point (and heading) given in a node's own frame."""

    node_id: int
    p_node: tuple[float, float] = (0.0, 0.0)
    """Metres, frame of the node."""
    yaw_node_rad: float | None = None
    """Heading to arrive with; None: any."""
    tolerance_m: float | None = None
    """None: NavConfig.goal_tolerance_m."""

    def __post_init__(self) -> None:
        """Raise BadSample for what is no place."""
        x, y = as_row("Goal.p_node (x m, y m)", self.p_node, np.float64, 2).tolist()
        point = as_number("Goal.p_node: x", x, "metres"), as_number("Goal.p_node: y", y, "metres")
        object.__setattr__(self, "node_id", as_whole("Goal.node_id", self.node_id))
        object.__setattr__(self, "p_node", point)
        if self.yaw_node_rad is not None:
            as_number("Goal.yaw_node_rad", self.yaw_node_rad, "radians")
        if self.tolerance_m is not None:
            as_number("Goal.tolerance_m", self.tolerance_m, "metres", 0.0)


class NavState(StrEnum):
    """What the navigator is doing now."""

    IDLE = "idle"
    TURNING = "turning"
    """In place, because the way starts to the side or behind."""
    DRIVING = "driving"
    WAITING = "waiting"
    """For somebody to make way, or for the pose to be found again."""
    RECOVERING = "recovering"
    ARRIVED = "arrived"
    FAILED = "failed"


class NavReason(StrEnum):
    """Why the navigator waits or gave up."""

    NONE = ""
    NO_ROUTE = "no route"
    """The graph holds no open way from here to the goal."""
    BLOCKED = "blocked"
    """There is a route, but no way along it could be driven within the limits."""
    LOST = "lost"
    """The pose in the map is not known."""
    OBSTACLE = "obstacle"
    """Something that may go away stands in the way."""
    CANCELLED = "cancelled"


class ContactKind(StrEnum):
    """Which sense met something the laser overlooked."""

    BUMPER = "bump"
    CLIFF = "cliff"


@dataclass(frozen=True, slots=True)
class Contact:
    """A bumper was pressed or a cliff sensor fired."""

    stamp_s: float
    kind: ContactKind
    bearing_rad: float
    """Direction of the sensor in the base frame."""


@dataclass(frozen=True, slots=True)
class ObstacleSighting:
    """What a range sensor saw at one moment: where rays ended, and rays that met nothing."""

    stamp_s: float
    T_odom_base: Pose
    """Where the base was at that moment."""
    hits_base: Points
    """float64 (N, 2): ends of rays that met something, base frame."""
    misses_base: Points
    """float64 (M, 2): far ends of rays known to be free all along (+inf ranges), base frame."""
    origin_base: tuple[float, float] = (0.0, 0.0)
    """Where the rays start, base frame."""
    source: str = "laser"
    """Each source has its own obstacle layer: a laser ray never clears what a depth camera saw."""
    floor_base: Points | None = None
    """float64 (K, 2): places where bare floor was seen. A camera looks over a low obstacle at the floor
    behind it, so its rays clear nothing on their way, only where they end on the floor."""

    @classmethod
    def from_scan(
        cls, scan: Scan, T_odom_base: Pose, source: str = "laser", T_base_beams: Pose = UNMOVED
    ) -> "ObstacleSighting":
        """Read a scan: NaN and out-of-range values say nothing, +inf says free up to the range limit.

        T_base_beams: the motion during the scan, as deskew.motion_during tells it. The mapper's beams
        (grid.beams) come out alike, but in float32, cut at a range of its own choice, with surfaces, and by a
        kernel: its thread has no time to lose.
        """
        ranges = np.asarray(scan.ranges_m, dtype=np.float64)
        lasers = compose(T_base_beams, scan.T_base_laser) if len(T_base_beams) else scan.T_base_laser
        angles = scan.angle_min_rad + scan.angle_step_rad * np.arange(ranges.size) + lasers[..., 2]
        starts = np.broadcast_to(lasers[..., :2], (ranges.size, 2))
        hit = np.isfinite(ranges) & (ranges >= scan.range_min_m) & (ranges <= scan.range_max_m)
        miss = np.isposinf(ranges)
        directions = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        origin = scan.T_base_laser
        return cls(
            stamp_s=scan.stamp_s,
            T_odom_base=T_odom_base,
            hits_base=starts[hit] + directions[hit] * ranges[hit, None],
            misses_base=starts[miss] + directions[miss] * min(scan.range_max_m, scan.silent_free_m),
            origin_base=(float(origin[0]), float(origin[1])),
            source=source,
        )

    @classmethod
    def from_cloud(
        cls, stamp_s: float, T_odom_base: Pose, cloud_base: NDArray[np.floating], source: str = "depth"
    ) -> "ObstacleSighting":
        """Take points (N, 3) of a depth camera, metres, base frame with z above the floor.

        What the robot would run into stands between FLOOR_M and its own height; what is lower is floor.
        """
        cloud = np.asarray(cloud_base, dtype=np.float64).reshape(-1, 3)
        cloud = cloud[np.isfinite(cloud).all(axis=1)]
        away_m, z_m = np.hypot(cloud[:, 0], cloud[:, 1]), cloud[:, 2]
        floor = z_m < FLOOR_M + FLOOR_SLOPE * away_m
        solid = ~floor & (z_m < ROBOT_HEIGHT_M) & (away_m > BODY_M)
        none = np.empty((0, 2))
        return cls(stamp_s, T_odom_base, cloud[solid, :2], none, source=source, floor_base=cloud[floor, :2])

    @classmethod
    def from_points(
        cls, stamp_s: float, T_odom_base: Pose, hits_base: NDArray[np.floating], source: str = "laser"
    ) -> "ObstacleSighting":
        """Take bare hit points (N, 2) in the base frame; rows that are not finite are dropped."""
        hits = np.asarray(hits_base, dtype=np.float64).reshape(-1, 2)
        hits = hits[np.isfinite(hits).all(axis=1)]
        return cls(stamp_s, T_odom_base, hits, np.empty((0, 2)), source=source)


@dataclass(frozen=True, slots=True)
class CostmapView:
    """Picture of one moment's costmap, in the grid frame, for viewers: navigation does not wait for paint."""

    stamp_s: float
    resolution_m: float
    origin_m: tuple[float, float]
    paint: Callable[[], NDArray[np.uint8]]
    """uint8 (rows, cols): 0 free .. 252 close to something, 253 too close for the body, 254 obstacle,
    255 unknown."""


@dataclass(frozen=True, slots=True)
class NavOutput:
    """One navigation cycle's result."""

    stamp_s: float
    twist: Twist
    """What the robot should do now; zero unless driving."""
    state: NavState
    reason: NavReason = NavReason.NONE
    text: str = ""
    """One line for a person: what it does, or why it cannot."""
    goal: Goal | None = None
    route: tuple[int, ...] = ()
    """Node ids from the associated node to the goal."""
    target_id: int | None = None
    """The route's node the robot is steering for: the furthest one the window proves reachable."""
    remaining_m: float = 0.0
    expected_s: float = 0.0
    local_path_grid: Points = field(default_factory=lambda: np.empty((0, 2)))
    """float64 (N, 2), metres, grid frame."""
    costmap: CostmapView | None = None
    events: Sequence[NavEvent] = ()
    cycle: int = 0
