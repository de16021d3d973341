"""Which known places may lie where the robot is, and where in the window each must be searched.

The doubt accumulated along the graph is the only limit. A place that the graph knows to within the window is
searched where it is expected. After a long way round the doubt is wider than the window: the place may then
lie anywhere around the robot, and places so doubtful are tried in turn, not the likeliest again and again.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lemtomap.se2 import adjoint, between, compose
from lemtomap.topo.loops.config import GateConfig, LoopConfig
from lemtomap.topo.loops.descriptor import describe, distances
from lemtomap.topo.loops.matcher import SearchBox
from lemtomap.topo.loops.outlook import GraphUncertainty
from lemtomap.topo.loops.places import PlaceBook
from lemtomap.topo.recognition import Situation

USUAL_UNLIKENESS = 45.0  # descriptor distance of two visits to one place


def ranked(
    outlook: GraphUncertainty,
    situation: Situation,
    points_grid: NDArray[np.float64],
    places: PlaceBook,
    config: LoopConfig,
) -> tuple[list[int], list[int]]:
    """Return the known places that may lie here, most promising first, by how they look and where they are.

    Those that the graph knows to within the window, and those that it does not.
    points_grid: averaged hits in the window, float (N, 2), metres, grid frame.
    """
    gate, here_id = config.gate, situation.here_id
    T_anchor_here = outlook.pose(here_id)
    if T_anchor_here is None:
        return [], []
    robot = compose(T_anchor_here, between(situation.T_grid_here, situation.T_grid_base))
    ids, offness, is_sure = outlook.near(here_id, robot[0], robot[1], gate.reach_m, gate.least_way_m)
    rows = [k for k, node_id in enumerate(ids) if node_id not in situation.measured and places.has(node_id)]
    if not rows:
        return [], []
    base = situation.T_grid_base[:2]
    around = points_grid[np.abs(points_grid - base).max(axis=1) <= config.describe_m]
    unlike = distances(describe(around), np.array([places.descriptor(ids[k]) for k in rows]))
    order = np.argsort((unlike / USUAL_UNLIKENESS) ** 2 + offness[rows], kind="stable")
    best = [rows[i] for i in order.tolist()]
    return [ids[k] for k in best if is_sure[k]], [ids[k] for k in best if not is_sure[k]]


def spaced(
    outlook: GraphUncertainty,
    here_id: int,
    node_ids: Sequence[int],
    count: int,
    spacing_m: float,
    gate: GateConfig,
    taken_ids: Sequence[int] = (),
) -> list[int]:
    """Return the first few that are not next to one another or to those taken, nor in the window anyway."""
    poses = [outlook.pose(node_id) for node_id in node_ids]
    at = np.array([[np.nan, np.nan] if pose is None else pose[:2] for pose in poses]).reshape(-1, 2)
    free = ~np.isnan(at[:, 0])
    for node_id in taken_ids:
        if (taken := outlook.pose(node_id)) is not None:
            free &= np.hypot(*(at - taken[:2]).T) >= spacing_m
    chosen: list[int] = []
    for k, node_id in enumerate(node_ids):
        if len(chosen) == count:
            break
        if free[k] and way_m(outlook, here_id, node_id) >= gate.least_way_m:
            chosen.append(node_id)
            free &= np.hypot(*(at - at[k]).T) >= spacing_m
    return chosen


def way_m(outlook: GraphUncertainty | None, here_id: int, node_id: int) -> float:
    """Return the way over edges to a node; a short one means that it lies in the window anyway."""
    seen = None if outlook is None else outlook.between(here_id, node_id)
    return np.inf if seen is None else seen.way_m


def search_box(
    outlook: GraphUncertainty, situation: Situation, node_id: int, gate: GateConfig
) -> SearchBox | None:
    """Return where to search a node in the window: where it is expected, as wide as that is doubtful.

    Where that is wider than the window, what of it lies around the robot; None when hardly anything does.
    """
    seen = outlook.between(situation.here_id, node_id)
    if seen is None:
        return None
    T_grid_node = compose(situation.T_grid_here, seen.T_from_node)
    turn = adjoint(np.array([0.0, 0.0, situation.T_grid_here[2]]))
    sigma = np.sqrt(np.diag(turn @ seen.covariance @ turn.T))
    is_sure = situation.here_id in situation.measured
    least = gate if is_sure else gate.unsure(situation.unsure_m)
    half = np.maximum(gate.gate_sigmas * sigma, [least.least_box_m, least.least_box_m, least.least_box_rad])
    half_yaw_rad = min(float(half[2]), gate.widest_rad)
    if half[:2].max() <= gate.widest_m:
        return SearchBox(T_grid_node, float(half[0]), float(half[1]), half_yaw_rad, sigma)
    low = np.maximum(T_grid_node[:2] - half[:2], situation.T_grid_base[:2] - gate.window_m)
    high = np.minimum(T_grid_node[:2] + half[:2], situation.T_grid_base[:2] + gate.window_m)
    if (high - low).min() < 2.0 * gate.least_box_m:
        return None
    middle = np.array([*(0.5 * (low + high)), T_grid_node[2]])
    half_x_m, half_y_m = (0.5 * (high - low)).tolist()
    return SearchBox(middle, half_x_m, half_y_m, half_yaw_rad, sigma, T_grid_node, is_cut=True)
