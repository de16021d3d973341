"""Where the nodes lie that have left the view, as long as those beside them are in it.

The view ends a window's width along the edges. Beyond a door that the robot never drove through the ground
may lie at hand and yet have its nodes far along the edges; it is known all the same.
"""

from collections.abc import Mapping

import numpy as np

from lemtomap import se2
from lemtomap.se2 import Pose

FOLLOWED_M = 40.0
"""A node out of view is placed by a chain of nodes up to this long: its place then errs by half a metre."""
LEAST_OFF_M, OFF_SHARE = 0.15, 0.01
"""A chain's end is off by this much at most, nine times of ten: 0.44 m after 20 to 40 m were measured."""
KEPT_ASIDE = 2048
"""Nodes out of view that are still followed, those that left it last."""


class Aside:
    """Follows the view of the map; owned by whoever looks at every view."""

    def __init__(self, kept: int = KEPT_ASIDE) -> None:
        self._kept = kept
        self._in_view: Mapping[int, Pose] = {}
        self._beside: dict[int, dict[int, Pose]] = {}
        """Nodes out of view, T_beside_node, by the nearest node that stayed in view when they left it."""
        self._beside_which: dict[int, int] = {}

    def __len__(self) -> int:
        """Return how many nodes out of view are followed."""
        return len(self._beside_which)

    def follow(self, T_grid_node: Mapping[int, Pose]) -> None:
        """Note which nodes leave the view, and beside which ones they lie."""
        before, self._in_view = self._in_view, T_grid_node
        for node_id in T_grid_node.keys() - before.keys():
            self._drop(node_id)
        staying = [node_id for node_id in before if node_id in T_grid_node]
        if not staying:
            return  # another part of the map: nothing tells how the two lie to each other
        places = np.array([before[node_id][:2] for node_id in staying])
        for node_id in before.keys() - T_grid_node.keys():
            nearest_id = staying[int(np.argmin(np.hypot(*(places - before[node_id][:2]).T)))]
            T_nearest_node = se2.between(before[nearest_id], before[node_id])
            self._beside.setdefault(nearest_id, {})[node_id] = T_nearest_node
            self._beside_which[node_id] = nearest_id
        while len(self._beside_which) > self._kept:
            self._drop(next(iter(self._beside_which)))

    def _drop(self, node_id: int) -> None:
        beside_id = self._beside_which.pop(node_id, None)
        if beside_id is None:
            return
        others = self._beside[beside_id]
        del others[node_id]
        if not others:
            del self._beside[beside_id]

    def places(self) -> dict[int, tuple[Pose, float]]:
        """Return T_grid_node and by how much it may be off, m, of nodes in view and at the ends of chains."""
        places = {node_id: (T_grid_node, 0.0) for node_id, T_grid_node in self._in_view.items()}
        ends = [(node_id, 0.0) for node_id in places if node_id in self._beside]
        while ends:
            from_id, way_m = ends.pop()
            for node_id, T_from_node in self._beside.get(from_id, {}).items():
                further_m = way_m + float(np.hypot(T_from_node[0], T_from_node[1]))
                if further_m <= FOLLOWED_M and node_id not in places:
                    T_grid_node = se2.compose(places[from_id][0], T_from_node)
                    places[node_id] = (T_grid_node, LEAST_OFF_M + OFF_SHARE * further_m)
                    ends.append((node_id, further_m))
        return places
