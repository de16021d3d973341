"""Doors and narrow places near the robot, and the evidence for each: log-odds over looks from many places."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lemtomap.areas.config import AreaConfig
from lemtomap.areas.gaps import WallGap
from lemtomap.areas.model import MappedDoor
from lemtomap.se2 import Pose, between, compose, transform
from lemtomap.topo.kernels.sight import line_is_clear
from lemtomap.topo.segmentation import Neighbourhood

LEAST_WEIGHT_M = 0.3  # a look's weight falls with the square of the distance, but not nearer than this
MOST_WEIGHT = 40.0  # of all looks before: a door that was hung anew is followed within some passes
MOST_SIGMA_M = 0.35  # a node known worse than this in the window says nothing about its doors


@dataclass(slots=True)
class Gate:
    """A door or narrow place, from its first sighting on. Written to the map once the evidence suffices."""

    door: MappedDoor
    """`door_id` is 0 until it is written."""
    log_odds: float = 0.0
    weight: float = 0.0
    """Of the looks that its place and width are the mean of."""
    T_grid_gate: Pose | None = None
    """In the window now, None when its node does not stand there well enough."""
    at: tuple[float, float] = (math.inf, math.inf)
    """Its place in the window, metres; infinite when it does not stand there."""
    door_like: float = 0.0
    """Looks that took it for a door, less those that did not."""
    shut_in_a_row: int = 0

    def ends_grid(self, longer_m: float = 0.0) -> NDArray[np.float64]:
        """Return both ends in the window, float64 (2, 2), metres, each further out by `longer_m`."""
        half = 0.5 * self.door.width_m + longer_m
        assert self.T_grid_gate is not None  # noqa: S101 - asked only of gates in the window
        return transform(self.T_grid_gate, np.array([[0.0, -half], [0.0, half]]))


def place(gate: Gate, around: Neighbourhood) -> None:
    """Find where a gate stands in the window."""
    standing = around.standings.get(gate.door.node)
    known = standing is not None and (standing.anchored or standing.sigma_m <= MOST_SIGMA_M)
    if standing is None or not known:
        gate.T_grid_gate, gate.at = None, (math.inf, math.inf)
        return
    gate.T_grid_gate = compose(standing.T_grid_node, gate.door.T_node_door)
    gate.at = (float(gate.T_grid_gate[0]), float(gate.T_grid_gate[1]))


def distance_m(gate: Gate, T_grid_there: Pose) -> float:
    """Return how far a gate is from a pose in the window; infinite when it does not stand there."""
    return math.hypot(gate.at[0] - float(T_grid_there[0]), gate.at[1] - float(T_grid_there[1]))


def is_same(gate: Gate, T_grid_gap: Pose, config: AreaConfig) -> bool:
    """Return True if a gap in the window is this gate."""
    if gate.T_grid_gate is None or distance_m(gate, T_grid_gap) > config.same_door_m:
        return False
    return abs(math.remainder(gate.T_grid_gate[2] - T_grid_gap[2], math.pi)) < math.pi / 4


def see(gate: Gate, gap: WallGap, around: Neighbourhood, config: AreaConfig) -> None:
    """Take one look at a gate: it is there, and open."""
    T_grid_gap = gap.T_grid_gap
    gate.log_odds = min(config.evidence_most, gate.log_odds + config.evidence_seen)
    gate.door_like += 1.0 if gap.is_door(config) else -1.0
    distance_m = math.dist(around.T_grid_base[:2], T_grid_gap[:2])
    weight = 1.0 / max(LEAST_WEIGHT_M, distance_m) ** 2
    share = weight / (gate.weight + weight)
    gate.weight = min(MOST_WEIGHT, gate.weight + weight)
    door = gate.door
    x, y, yaw = between(around.standings[door.node].T_grid_node, T_grid_gap).tolist()
    yaw = door.yaw_rad + share * math.remainder(yaw - door.yaw_rad, math.pi)  # a normal has no front
    gate.door = replace(
        door,
        x_m=door.x_m + share * (x - door.x_m),
        y_m=door.y_m + share * (y - door.y_m),
        yaw_rad=math.remainder(yaw, 2.0 * math.pi),
        width_m=door.width_m + share * (gap.width_m - door.width_m),
        seen_open=door.seen_open + 1,
        last_open_s=around.stamp_s,
    )
    gate.shut_in_a_row = 0


def closed_share(gate: Gate, around: Neighbourhood) -> float | None:
    """Return which share of a gate's width is occupied, 0..1; None where too little of it is known."""
    grid, (a, b) = around.grid, gate.ends_grid(-0.1)
    steps = max(4, math.ceil(2.0 * gate.door.width_m / grid.resolution_m))
    points = a + (b - a) * np.linspace(0.0, 1.0, steps)[:, None]
    normal = np.array([math.cos(gate.T_grid_gate[2]), math.sin(gate.T_grid_gate[2])])  # type: ignore[index]
    rows, cols = grid.occupancy.shape
    worst = np.full(steps, -1)
    for off_m in (-0.1, 0.0, 0.1):  # a leaf stands a little before or behind the middle of its wall
        cells = ((points + off_m * normal - grid.origin_m) / grid.resolution_m).astype(int)
        inside = (cells >= 0).all(axis=1) & (cells[:, 1] < rows) & (cells[:, 0] < cols)
        seen = grid.occupancy[cells[inside, 1], cells[inside, 0]]
        worst[inside] = np.maximum(worst[inside], seen)
    known = worst >= 0
    if np.count_nonzero(known) < 0.7 * steps:
        return None
    return float(np.count_nonzero(worst[known] >= around.occupied_from) / np.count_nonzero(known))


def is_in_sight(gate: Gate, around: Neighbourhood, within_m: float) -> bool:
    """Return True if nothing stands between the robot and the floor before a gate."""
    assert gate.T_grid_gate is not None  # noqa: S101 - asked only of gates in the window
    x, y, yaw = gate.T_grid_gate.tolist()
    base = around.T_grid_base[:2] - around.grid.origin_m
    middle = np.array([x, y]) - around.grid.origin_m
    if math.dist(base, middle) > within_m:
        return False
    normal = np.array([math.cos(yaw), math.sin(yaw)])
    before = middle + 0.3 * normal * np.sign((base - middle) @ normal)
    grid = around.grid
    (x0, y0), (x1, y1) = base.tolist(), before.tolist()
    return bool(line_is_clear(grid.occupancy, grid.resolution_m, x0, y0, x1, y1, around.occupied_from))


def crosses(
    ends: NDArray[np.float64], starts: NDArray[np.float64], stops: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return bool (N,): which lines from starts to stops, float (N, 2), cross the line between two ends."""
    along = ends[1] - ends[0]
    before = _cross(along, starts - ends[0])
    behind = _cross(along, stops - ends[0])
    ways = stops - starts
    left = _cross(ways, ends[0] - starts)
    right = _cross(ways, ends[1] - starts)
    return (before * behind < 0.0) & (left * right < 0.0)


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
