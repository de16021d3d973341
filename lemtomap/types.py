"""What the parts of LEMTOMap hand to one another: frozen samples and snapshots, SI units.

Frames: `base` (robot, x forward, y left), `laser`, `odom` (continuous, drifts), `grid` (the rolling
window's frame), `node/<id>` (each topological node owns one). There is no world frame.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lemtomap.samples import as_number, as_pose, as_poses, as_row
from lemtomap.se2 import Pose


@dataclass(frozen=True, slots=True)
class Odometry:
    """Where the wheels (and gyro) say the base is. Lists and tuples will do; raises BadSample."""

    stamp_s: float
    """Any clock that runs on evenly, the scans' too."""
    T_odom_base: Pose
    """float64 (3,): x m, y m, yaw rad; frame odom: continuous, drifts."""
    v_mps: float = 0.0
    """Speed forwards, base frame."""
    w_radps: float = 0.0
    """Speed of turning, positive to the left."""
    T_odom_base_beams: Pose | None = None
    """float64 (N, 3): the same at each beam of the scan at this stamp, where that is known; None: the
    velocity has to do."""

    def __post_init__(self) -> None:
        as_number("Odometry.stamp_s", self.stamp_s, "seconds")
        as_number("Odometry.v_mps", self.v_mps, "metres per second")
        as_number("Odometry.w_radps", self.w_radps, "radians per second")
        object.__setattr__(self, "T_odom_base", as_pose("Odometry.T_odom_base", self.T_odom_base))
        if self.T_odom_base_beams is not None:
            beams = as_poses("Odometry.T_odom_base_beams", self.T_odom_base_beams)
            object.__setattr__(self, "T_odom_base_beams", beams)


@dataclass(frozen=True, slots=True)
class Scan:
    """One turn of a planar laser. Beam i points to angle_min + i * angle_step at stamp + i * time_step.

    Lists and tuples will do; raises BadSample.
    """

    stamp_s: float
    """Time of the first beam."""
    ranges_m: NDArray[np.float32]
    """float32 (N,), REP-117: NaN invalid, +inf nothing seen; what lies below range_min_m or beyond
    range_max_m says nothing."""
    angle_min_rad: float
    """Direction of the first beam, laser frame: 0 straight on, positive to the left."""
    angle_step_rad: float
    """From beam to beam; negative where they turn clockwise."""
    time_step_s: float = 0.0
    """From beam to beam; 0: all at once."""
    range_min_m: float = 0.02
    range_max_m: float = 5.6
    silent_free_m: float = math.inf
    """A beam that saw nothing (+inf) proves free space only so far: a URG-04LX overlooks dark and slanting
    surfaces much nearer than its range."""
    T_base_laser: Pose = field(default_factory=lambda: np.zeros(3))
    """float64 (3,): x m, y m, yaw rad, where the laser stands in the base frame."""

    def __post_init__(self) -> None:
        as_number("Scan.stamp_s", self.stamp_s, "seconds")
        as_number("Scan.angle_min_rad", self.angle_min_rad, "radians")
        as_number("Scan.angle_step_rad", self.angle_step_rad, "radians")
        as_number("Scan.time_step_s", self.time_step_s, "seconds", 0.0)
        least_m = as_number("Scan.range_min_m", self.range_min_m, "metres", 0.0)
        as_number("Scan.range_max_m", self.range_max_m, "metres", least_m)
        as_number("Scan.silent_free_m", self.silent_free_m, "metres", 0.0, endless=True)
        object.__setattr__(self, "ranges_m", as_row("Scan.ranges_m", self.ranges_m, np.float32))
        object.__setattr__(self, "T_base_laser", as_pose("Scan.T_base_laser", self.T_base_laser))


@dataclass(frozen=True, slots=True)
class Twist:
    """Velocity of the base in its own frame."""

    v_mps: float = 0.0
    w_radps: float = 0.0


@dataclass(frozen=True, slots=True)
class GridView:
    """Immutable snapshot of the best particle's window."""

    stamp_s: float
    occupancy: NDArray[np.int8]
    """int8 (rows, cols), read-only, C order; -1 unknown, else 0..100; [0, 0] is the cell of least x and y,
    rows grow with y."""
    resolution_m: float
    origin_m: tuple[float, float]
    """Lower-left corner of cell [0, 0], in the grid frame."""


@dataclass(frozen=True, slots=True)
class SlamUpdate:
    """What one scan told the rolling-window SLAM."""

    stamp_s: float
    T_grid_base: Pose
    T_grid_odom: Pose
    """Published correction, spread over time: T_grid_base == compose(T_grid_odom, T_odom_base) up to the part
    still being spread."""
    covariance: NDArray[np.float64]
    """float64 (3, 3) of this update's T_grid_base *relative to the window*, axes of grid: m, m, rad."""
    step_covariance: NDArray[np.float64]
    """float64 (3, 3) of the motion since the previous update, in the previous base frame: what a
    topological odometry edge accumulates."""
    quality: float
    """0 (scan and window disagree) to 1 (every beam explained)."""
    diversity: float
    """mu of Appendix D: 0 in a featureless corridor, 1 where surfaces face all ways."""
    matched: bool
    """False: the match was refused or there was nothing to match; the pose follows odometry."""
    integrated: bool
    """True: the scan went into the window."""
    known: float = 1.0
    """Share of the hits on ground that the window knows, 0..1: the rest can neither fit nor misfit. 0 with
    too little in sight to match."""
    jumped: bool = False
    """True: T_grid_odom moved by more than the smooth limit on purpose (relocalisation)."""


class EdgeType(StrEnum):
    """Why an edge is believed (thesis, section 3-3-1)."""

    ODOMETRY = "odometry"
    NEAR_NEIGHBOUR = "near_neighbour"
    LOOP_CLOSING = "loop_closing"


@dataclass(frozen=True, slots=True)
class RouteEdge:
    """What a planner needs of an edge, seen from one of its ends."""

    edge_id: int
    other_id: int
    length_m: float
    time_s: float
    """Expected traversal time: learnt where driven, else length over a usual speed."""
    blocked_until_s: float = 0.0
    """The edge is closed to planning while now_s is below this."""
    proven: bool = True
    """False: a closure that nobody has driven. It says where a place is; a wall may stand between."""


@dataclass(frozen=True, slots=True)
class EdgeTable:
    """Edges in columns of equal length."""

    edge_id: NDArray[np.int64]
    source_id: NDArray[np.int64]
    target_id: NDArray[np.int64]
    length_m: NDArray[np.float32]
    time_s: NDArray[np.float32]
    blocked_until_s: NDArray[np.float64]
    proven: NDArray[np.bool_] | None = None
    """None: all are."""


class RouteGraph(Protocol):
    """The topological map as a planner sees it; also of maps far larger than memory."""

    @property
    def version(self) -> int:
        """Changes whenever an edge appears, goes, or changes its cost or blocking."""
        ...

    def has_node(self, node_id: int) -> bool:
        """Return True if the map knows this node."""
        ...

    def edges_of(self, node_id: int) -> Sequence[RouteEdge]:
        """Return the edges at a node, blocked ones too; empty for an unknown node."""
        ...


@dataclass(frozen=True, slots=True)
class MapView:
    """What mapping tells navigation and viewers: one immutable snapshot."""

    stamp_s: float
    grid: GridView
    T_grid_odom: Pose
    T_grid_base: Pose
    associated_id: int
    T_grid_node: Mapping[int, Pose]
    """Nodes near the associated node, from local graph solving and the local grid map transform."""
    edges: Sequence[tuple[int, int, int, EdgeType]]
    """(edge id, node a, node b, type) among those nodes, for pictures."""
    quality: float
    """How likely the pose relative to the associated node is right within 10 cm and 2 degrees, 0 to 1; of
    poses with more than 0.9, at least 99 % are."""
    diversity: float
    lost: bool
    """The robot does not know where in the map it is, and maps a part of its own meanwhile."""
    particles: NDArray[np.float64] | None = None
    """float64 (N, 3), T_grid_base of each particle."""
    names: Mapping[int, str] = field(default_factory=dict)
    area_of: Mapping[int, int] = field(default_factory=dict)
    """Area of each of those nodes; empty where nobody divides the map into areas."""
    doors: Mapping[int, NDArray[np.float64]] = field(default_factory=dict)
    """Both ends of each door in the window, float64 (2, 2), metres, grid frame."""
    changed: Mapping[int, Sequence[RouteEdge]] = field(default_factory=dict)
    """All edges, as they are now, of every node that is new or whose edges changed since the map file was
    last written: who plans takes them for what the file holds."""
    graph_version: int = 0
    """RouteGraph.version of the map with these changes."""
