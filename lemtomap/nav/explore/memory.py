"""What has been seen from each node, so that floor the window forgot is not taken for unexplored.

A node keeps how far seen floor reached in 72 directions, in its own frame: 288 bytes.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from lemtomap import se2
from lemtomap.nav.costmap import Costs
from lemtomap.nav.explore import kernels
from lemtomap.nav.types import Points
from lemtomap.se2 import Pose

DIRECTIONS = 72
TAKEN_WITHIN_M = 3.0
"""A node's view is taken while the robot is this near: the window then knows its surroundings best."""
CONSULTED_WITHIN_M = 8.0
MARGIN_M = 0.30
"""A point must lie this far inside a view: the node's place in the window errs by some centimetres."""


class SeenMemory:
    """Views of all nodes met so far."""

    def __init__(self) -> None:
        self._views_m: dict[int, NDArray[np.float32]] = {}

    def take(self, costs: Costs, T_grid_node: Mapping[int, Pose], p_robot_grid: Pose) -> None:
        """Widen the views of the nodes near the robot by what the window shows now."""
        for node_id, node in T_grid_node.items():
            near = np.hypot(*(node[:2] - p_robot_grid[:2])) <= TAKEN_WITHIN_M
            if not near or not costs.holds(node):
                continue
            old_m = self._views_m.get(node_id)
            lengths = np.zeros(DIRECTIONS) if old_m is None else old_m / costs.resolution_m
            lengths = np.ascontiguousarray(lengths, dtype=np.float64)
            row, col = costs.cell(node)
            kernels.sight_lengths(costs.state, row, col, float(node[2]), lengths)
            self._views_m[node_id] = (lengths * costs.resolution_m).astype(np.float32)

    def seen(self, points_grid: Points, T_grid_node: Mapping[int, Pose]) -> NDArray[np.bool_]:
        """Tell for each point (N, 2), metres, whether it was seen before from some node in the window."""
        seen = np.zeros(len(points_grid), dtype=bool)
        for node_id, node in T_grid_node.items():
            view_m = self._views_m.get(node_id)
            if view_m is None:
                continue
            p_node = se2.transform(se2.inverse(node), points_grid)
            away_m = np.hypot(p_node[:, 0], p_node[:, 1])
            bearing = np.arctan2(p_node[:, 1], p_node[:, 0])
            sector = np.rint(bearing / (2.0 * np.pi / DIRECTIONS)).astype(int)
            # Unseen ground beside the line of sight lies in the shadow of what cuts a neighbouring one short.
            least_m = np.minimum.reduce([view_m[(sector + k) % DIRECTIONS] for k in (-1, 0, 1)])
            seen |= (away_m < least_m - MARGIN_M) & (away_m < CONSULTED_WITHIN_M)
        return seen
