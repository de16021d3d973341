"""A small kinematic world: a plan of boxes, a unicycle, a perfect laser, a window and a graph of the plan.

It shares no code with the simulator; it serves navigation's tests only.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from lemtomap import se2
from lemtomap.nav.types import Contact, ContactKind, ObstacleSighting
from lemtomap.types import (
    EdgeType,
    GridView,
    MapView,
    RouteEdge,
    Scan,
    Twist,
)

RES = 0.05


@dataclass
class Graph:
    """A RouteGraph in two dictionaries."""

    places: dict[int, tuple[float, float]]
    links: list[tuple[int, int, int]] = field(default_factory=list)
    """(edge id, a, b)"""
    blocked_s: dict[int, float] = field(default_factory=dict)
    unproven: set[int] = field(default_factory=set)
    """Ids of edges that are closures nobody has driven."""
    version: int = 1

    @classmethod
    def of(cls, places: dict[int, tuple[float, float]], pairs: Sequence[tuple[int, int]]) -> "Graph":
        return cls(places, [(100 + i, a, b) for i, (a, b) in enumerate(pairs)])

    def has_node(self, node_id: int) -> bool:
        return node_id in self.places

    def length(self, a: int, b: int) -> float:
        return float(np.hypot(*np.subtract(self.places[a], self.places[b])))

    def edges_of(self, node_id: int) -> list[RouteEdge]:
        found = []
        for edge_id, a, b in self.links:
            if node_id in (a, b):
                length = self.length(a, b)
                other = b if node_id == a else a
                proven, blocked_s = edge_id not in self.unproven, self.blocked_s.get(edge_id, 0.0)
                found.append(RouteEdge(edge_id, other, length, length / 0.4, blocked_s, proven))
        return found


class World:
    """Walls in cells, a robot that obeys twists exactly, and everything the navigator is given."""

    def __init__(self, width_m: float, height_m: float, graph: Graph, pose=(1.0, 1.0, 0.0)) -> None:
        self.walls = np.zeros((round(height_m / RES), round(width_m / RES)), dtype=bool)
        self.hidden = np.zeros_like(self.walls)
        self.known = np.ones_like(self.walls)
        self.graph = graph
        self.pose = np.array(pose, dtype=float)
        self.T_grid_odom = se2.pose(0.3, -0.2, 0.4)
        self.twist = Twist()
        self.now_s = 100.0
        self.contacts = 0
        self.lost = False
        self.extra: list[tuple[float, float, float]] = []
        """Discs the laser sees and the window does not know: x, y, radius."""
        self.box(0, 0, width_m, 0.1)
        self.box(0, height_m - 0.1, width_m, height_m)
        self.box(0, 0, 0.1, height_m)
        self.box(width_m - 0.1, 0, width_m, height_m)

    def box(self, x0, y0, x1, y1, *, value=True) -> None:
        self.walls[round(y0 / RES) : round(y1 / RES), round(x0 / RES) : round(x1 / RES)] = value

    @property
    def T_odom_base(self):  # noqa: N802 - a frame's name
        return se2.compose(se2.inverse(self.T_grid_odom), self.pose)

    def solid(self, x, y):
        r, c = np.floor(np.asarray(y) / RES).astype(int), np.floor(np.asarray(x) / RES).astype(int)
        inside = (r >= 0) & (c >= 0) & (r < self.walls.shape[0]) & (c < self.walls.shape[1])
        hit = np.ones_like(inside)
        hit[inside] = self.walls[r[inside], c[inside]]
        for ex, ey, er in self.extra:
            hit |= (np.asarray(x) - ex) ** 2 + (np.asarray(y) - ey) ** 2 < er * er
        return hit

    def scan(self) -> Scan:
        angles = np.linspace(-2.09, 2.09, 240)
        reach = np.arange(0.05, 5.6, 0.04)
        world = self.pose[2] + angles
        x = self.pose[0] + np.outer(np.cos(world), reach)
        y = self.pose[1] + np.outer(np.sin(world), reach)
        hit = self.solid(x, y)
        first = hit.argmax(axis=1)
        ranges = np.where(hit.any(axis=1), reach[first], np.inf).astype(np.float32)
        return Scan(self.now_s, ranges, float(angles[0]), float(angles[1] - angles[0]))

    def view(self, associated_id: int | None = None) -> MapView:
        occupancy = np.where(self.walls, 100, 0).astype(np.int8)
        occupancy[~self.known] = -1
        occupancy.setflags(write=False)
        nodes = self.graph.places
        nearest = min(nodes, key=lambda n: np.hypot(*np.subtract(nodes[n], self.pose[:2])))
        return MapView(
            stamp_s=self.now_s,
            grid=GridView(self.now_s, occupancy, RES, (0.0, 0.0)),
            T_grid_odom=self.T_grid_odom,
            T_grid_base=self.pose.copy(),
            associated_id=nearest if associated_id is None else associated_id,
            T_grid_node={n: se2.pose(x, y, 0.0) for n, (x, y) in nodes.items()},
            edges=[(e, a, b, EdgeType.ODOMETRY) for e, a, b in self.graph.links],
            quality=1.0,
            diversity=1.0,
            lost=self.lost,
        )

    def reveal(self) -> None:
        """Let the window learn what one scan shows, as a mapper would."""
        scan = self.scan()
        angles = scan.angle_min_rad + scan.angle_step_rad * np.arange(scan.ranges_m.size) + self.pose[2]
        reach = np.arange(0.0, 5.6, 0.025)
        lengths = np.where(np.isinf(scan.ranges_m), 5.6, scan.ranges_m + 0.05)
        x = self.pose[0] + np.outer(np.cos(angles), reach)
        y = self.pose[1] + np.outer(np.sin(angles), reach)
        inside = reach[None, :] <= lengths[:, None]
        r = np.clip((y[inside] / RES).astype(int), 0, self.walls.shape[0] - 1)
        c = np.clip((x[inside] / RES).astype(int), 0, self.walls.shape[1] - 1)
        self.known[r, c] = True

    def grow(self) -> None:
        """Put a node where none is near, joined to the one the robot comes from."""
        places = self.graph.places
        near = min(places, key=lambda n: np.hypot(*np.subtract(places[n], self.pose[:2])))
        if np.hypot(*np.subtract(places[near], self.pose[:2])) > 1.0:
            new = max(places) + 1
            places[new] = (float(self.pose[0]), float(self.pose[1]))
            self.graph.links.append((100 + len(self.graph.links), near, new))
            self.graph.version += 1

    def forget_far(self, reach_m: float) -> None:
        """Lose what lies further away than a window would hold."""
        rows, cols = np.nonzero(self.known)
        x, y = (cols + 0.5) * RES, (rows + 0.5) * RES
        far = np.maximum(np.abs(x - self.pose[0]), np.abs(y - self.pose[1])) > reach_m
        self.known[rows[far], cols[far]] = False

    def sighting(self) -> ObstacleSighting:
        return ObstacleSighting.from_scan(self.scan(), self.T_odom_base)

    def drive(self, twist: Twist, dt: float = 0.1) -> None:
        for _ in range(5):
            step = [twist.v_mps * dt / 5, 0.0, twist.w_radps * dt / 5]
            moved = se2.compose(self.pose, step)
            if self.touching(moved):
                self.contacts += 1
                break
            self.pose = moved
        self.twist = twist
        self.now_s += dt

    def cloud(self) -> np.ndarray:
        """What a depth camera sees of the floor and of low obstacles: 57 degrees, 0.8 to 4 m."""
        bearings, reach = np.linspace(-0.5, 0.5, 41), np.arange(0.8, 4.0, 0.04)
        x = self.pose[0] + np.outer(np.cos(self.pose[2] + bearings), reach)
        y = self.pose[1] + np.outer(np.sin(self.pose[2] + bearings), reach)
        r = np.clip((y / RES).astype(int), 0, self.walls.shape[0] - 1)
        c = np.clip((x / RES).astype(int), 0, self.walls.shape[1] - 1)
        seen = np.cumsum(self.solid(x, y), axis=1) == 0
        p_base = se2.transform(se2.inverse(self.pose), np.stack([x[seen], y[seen]], axis=-1))
        return np.column_stack([p_base, np.where(self.hidden[r, c][seen], 0.10, 0.0)])

    def bump(self) -> Contact:
        """What Kobuki's three bumper switches tell of a touch in front."""
        bearings = np.linspace(-1.5, 1.5, 61)
        x = self.pose[0] + 0.22 * np.cos(self.pose[2] + bearings)
        y = self.pose[1] + 0.22 * np.sin(self.pose[2] + bearings)
        r, c = np.floor(y / RES).astype(int), np.floor(x / RES).astype(int)
        hit = self.solid(x, y) | self.hidden[r, c]
        bearing = float(bearings[hit].mean()) if hit.any() else 0.0
        return Contact(self.now_s, ContactKind.BUMPER, float(np.clip(np.rint(bearing), -1, 1)))

    def touching(self, pose) -> bool:
        ring = np.linspace(0, 2 * np.pi, 48)
        x, y = pose[0] + 0.1757 * np.cos(ring), pose[1] + 0.1757 * np.sin(ring)
        r, c = np.floor(y / RES).astype(int), np.floor(x / RES).astype(int)
        return bool(self.solid(x, y).any() or self.hidden[r, c].any())


def run(world: World, navigator, goal, seconds: float, each=None) -> list:
    """Drive until the navigator has ended; returns every output."""
    navigator.set_goal(goal, world.now_s)
    outputs = []
    for _ in range(int(seconds / 0.1)):
        if each is not None:
            each(world)
        output = navigator.step(
            world.view(), world.graph, world.T_odom_base, world.twist, world.sighting(), (), world.now_s
        )
        outputs.append(output)
        if navigator.goal is None:
            break
        world.drive(output.twist)
    return outputs
