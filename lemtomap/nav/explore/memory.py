"""What has been seen around each node, so that floor the window forgot is not taken for unexplored.

A node keeps a coarse picture, in its own frame, of the ground the window knew when the robot was near:
one bit for each quarter metre, 288 bytes a node.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from lemtomap.nav.costmap import Costs
from lemtomap.nav.explore import kernels
from lemtomap.se2 import Pose

SIDE = 48
CELL_M = 0.25
TAKEN_WITHIN_M = 3.0
"""A node's picture is taken while the robot is this near: the window then knows its surroundings best."""
STAMP_M = 0.35
"""A remembered cell covers this much: the node's place in the window errs by some centimetres."""


class SeenMemory:
    """Pictures of all nodes met so far."""

    def __init__(self) -> None:
        self._pictures: dict[int, NDArray[np.uint8]] = {}

    def take(self, costs: Costs, T_grid_node: Mapping[int, Pose], T_grid_base: Pose) -> None:
        """Add to the pictures of the nodes near the robot what the window shows now."""
        cell = CELL_M / costs.resolution_m
        for node_id, node in T_grid_node.items():
            if np.hypot(*(node[:2] - T_grid_base[:2])) > TAKEN_WITHIN_M:
                continue
            packed = self._pictures.get(node_id)
            bits = np.zeros(SIDE * SIDE, dtype=np.uint8) if packed is None else np.unpackbits(packed)
            row, col = costs.cell(node)
            kernels.remember(costs.state, row, col, float(node[2]), cell, bits.reshape(SIDE, SIDE))
            self._pictures[node_id] = np.packbits(bits)

    def recall(self, costs: Costs, T_grid_node: Mapping[int, Pose]) -> NDArray[np.uint8]:
        """Return uint8 (rows, cols): 1 where the ground is known or was seen from a node before."""
        seen = (costs.state != kernels.UNKNOWN).astype(np.uint8)
        cell, stamp = CELL_M / costs.resolution_m, STAMP_M / costs.resolution_m
        for node_id, node in T_grid_node.items():
            packed = self._pictures.get(node_id)
            if packed is None or not costs.holds(node, -0.5 * SIDE * CELL_M):
                continue
            row, col = costs.cell(node)
            bits = np.unpackbits(packed).reshape(SIDE, SIDE)
            kernels.recall(seen, row, col, float(node[2]), cell, bits, stamp)
        return np.asarray(seen)
