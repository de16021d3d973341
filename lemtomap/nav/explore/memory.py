"""What has been seen around each node, so that floor the window forgot is not taken for unexplored.

A node keeps a coarse picture, in its own frame, of the ground the window knew when the robot was near:
one bit for each quarter metre, 288 bytes a node.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from lemtomap import se2
from lemtomap.nav.costmap import Costs
from lemtomap.nav.explore import kernels
from lemtomap.se2 import Pose

SIDE = 48
CELL_M = 0.25
TAKEN_WITHIN_M = 3.0
"""A node's picture is taken while the robot is this near: the window then knows its surroundings best."""
STAMP_M = 0.35
"""A remembered cell covers this much: the node's place in the window errs by some centimetres."""
FOLLOWED_M = 40.0
"""A node out of view is placed by a chain of nodes up to this long: its place then errs by half a metre."""


class SeenMemory:
    """Pictures of all nodes met so far, and where those lie that have left the view.

    The view ends a window's width along the edges. Beyond a door that the robot never drove through the
    ground may lie at hand and yet have its nodes far along the edges; it is known all the same.
    """

    def __init__(self) -> None:
        self._pictures: dict[int, NDArray[np.uint8]] = {}
        self._in_view: Mapping[int, Pose] = {}
        self._beside: dict[int, dict[int, Pose]] = {}
        """Nodes out of view, T_beside_node, by the nearest node that stayed in view when they left it."""
        self._beside_which: dict[int, int] = {}

    def follow(self, T_grid_node: Mapping[int, Pose]) -> None:
        """Note which nodes leave the view, and beside which ones they lie."""
        before, self._in_view = self._in_view, T_grid_node
        staying = [node_id for node_id in before if node_id in T_grid_node]
        for node_id in T_grid_node.keys() - before.keys():
            if node_id in self._beside_which:
                del self._beside[self._beside_which.pop(node_id)][node_id]
        if not staying:
            return  # another part of the map: nothing tells how the two lie to each other
        places = np.array([before[node_id][:2] for node_id in staying])
        for node_id in before.keys() - T_grid_node.keys():
            nearest_id = staying[int(np.argmin(np.hypot(*(places - before[node_id][:2]).T)))]
            T_nearest_node = se2.between(before[nearest_id], before[node_id])
            self._beside.setdefault(nearest_id, {})[node_id] = T_nearest_node
            self._beside_which[node_id] = nearest_id

    def places(self) -> dict[int, Pose]:
        """Return the poses in the grid frame of the nodes in view and of those chains lead to."""
        places = dict(self._in_view)
        ends = [(node_id, 0.0) for node_id in places if node_id in self._beside]
        while ends:
            from_id, way_m = ends.pop()
            for node_id, T_from_node in self._beside.get(from_id, {}).items():
                further_m = way_m + float(np.hypot(T_from_node[0], T_from_node[1]))
                if further_m <= FOLLOWED_M and node_id not in places:
                    places[node_id] = se2.compose(places[from_id], T_from_node)
                    ends.append((node_id, further_m))
        return places

    def take(self, costs: Costs, T_grid_node: Mapping[int, Pose], T_grid_base: Pose) -> None:
        """Add to the pictures of the nodes near the robot what the window shows now."""
        self.follow(T_grid_node)
        cell = CELL_M / costs.resolution_m
        for node_id, node in T_grid_node.items():
            if np.hypot(*(node[:2] - T_grid_base[:2])) > TAKEN_WITHIN_M:
                continue
            packed = self._pictures.get(node_id)
            bits = np.zeros(SIDE * SIDE, dtype=np.uint8) if packed is None else np.unpackbits(packed)
            row, col = costs.cell(node)
            kernels.remember(costs.state, row, col, float(node[2]), cell, bits.reshape(SIDE, SIDE))
            self._pictures[node_id] = np.packbits(bits)

    def recall(self, costs: Costs) -> NDArray[np.uint8]:
        """Return uint8 (rows, cols): 1 where the ground is known or was seen from a node before."""
        seen = (costs.state != kernels.UNKNOWN).astype(np.uint8)
        cell, stamp = CELL_M / costs.resolution_m, STAMP_M / costs.resolution_m
        for node_id, node in self.places().items():
            packed = self._pictures.get(node_id)
            if packed is None or not costs.holds(node, -0.5 * SIDE * CELL_M):
                continue
            row, col = costs.cell(node)
            bits = np.unpackbits(packed).reshape(SIDE, SIDE)
            kernels.recall(seen, row, col, float(node[2]), cell, bits, stamp)
        return np.asarray(seen)
