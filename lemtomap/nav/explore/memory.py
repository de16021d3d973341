"""What has been seen around each node, so that floor the window forgot is not taken for unexplored.

A node keeps a coarse picture, in its own frame, of the ground the window knew when the robot was near:
one bit for each quarter metre, 288 bytes a node. Those around the robot are in memory; the map is told of
each when the robot leaves its node, and asked when the robot comes back, in this run or in a later one.
"""

import math
import zlib
from collections import OrderedDict
from collections.abc import Mapping
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from lemtomap.nav.explore.aside import Aside
from lemtomap.nav.kernels import explore as kernels
from lemtomap.nav.kernels import shapes
from lemtomap.nav.motion.costmap import Costs
from lemtomap.se2 import Pose
from lemtomap.topo.events import GroundSeen
from lemtomap.types import RouteGraph

SIDE = 48
CELL_M = 0.25  # as the map file stores it
TAKEN_WITHIN_M = 3.0
"""A node's picture is taken while the robot is this near: the window then knows its surroundings best."""
STAMP_M = 0.35
"""A remembered cell covers this much: the node's place in the window errs by some centimetres."""
KEPT = 512
"""Pictures in memory: of the 400 nodes at most that a map view has, and of some it had a moment ago."""

Picture = NDArray[np.uint8]
"""uint8 (288,): SIDE x SIDE bits."""


@runtime_checkable
class RemembersGround(Protocol):
    """A graph on file that keeps pictures for whoever drew them."""

    def ground_seen(self, node_id: int) -> bytes | None:
        """Return what the map was told was seen from a node; None when it was told nothing."""
        ...


class SeenMemory:
    """Pictures of the nodes met of late; all others are with the map."""

    def __init__(self, kept: int = KEPT) -> None:
        self._kept = kept
        self._pictures: OrderedDict[int, Picture | None] = OrderedDict()
        """None: the map knows none."""
        self._untold: dict[int, None] = {}
        self._events: list[GroundSeen] = []
        self._aside = Aside()

    def __len__(self) -> int:
        """Return how many nodes are in memory."""
        return len(self._pictures)

    def take(
        self,
        costs: Costs,
        T_grid_node: Mapping[int, Pose],
        T_grid_base: Pose,
        graph: RouteGraph | None = None,
    ) -> None:
        """Add to the pictures of the nodes near the robot what the window shows now."""
        self._aside.follow(T_grid_node)
        cell = CELL_M / costs.resolution_m
        left = dict(self._untold)
        for node_id, node in T_grid_node.items():
            if np.hypot(*(node[:2] - T_grid_base[:2])) > TAKEN_WITHIN_M:
                continue
            left.pop(node_id, None)
            before = self._picture(node_id, graph)
            bits = np.zeros(SIDE * SIDE, dtype=np.uint8) if before is None else np.unpackbits(before)
            row, col = costs.cell(node)
            kernels.remember(costs.state, row, col, float(node[2]), cell, bits.reshape(SIDE, SIDE))
            picture = np.packbits(bits)
            if before is None or not np.array_equal(picture, before):
                self._pictures[node_id] = picture
                self._untold[node_id] = None
        for node_id in left:
            self._tell(node_id)

    def recall(self, costs: Costs, graph: RouteGraph | None = None) -> NDArray[np.uint8]:
        """Return uint8 (rows, cols): 1 where the ground is known or was seen from a node before.

        Of nodes in the view taken last, and of those out of view that lie beside them.
        """
        seen = (costs.state != kernels.UNKNOWN).astype(np.uint8)
        cell, stamp = CELL_M / costs.resolution_m, STAMP_M / costs.resolution_m
        for node_id, (node, off_m) in self._aside.places().items():
            if not costs.holds(node, -0.5 * SIDE * CELL_M):
                continue
            picture = self._picture(node_id, graph)
            if picture is None:
                continue
            row, col = costs.cell(node)
            bits = np.unpackbits(picture).reshape(SIDE, SIDE)
            if off_m > 0.0:
                bits = _sure(bits, math.ceil(off_m / CELL_M))
            kernels.recall(seen, row, col, float(node[2]), cell, bits, stamp)
        return np.asarray(seen)

    def take_events(self, *, last: bool = False) -> list[GroundSeen]:
        """Return what the map is to be told since the last call; `last`: of the nodes not left yet, too."""
        for node_id in list(self._untold) if last else ():
            self._tell(node_id)
        events, self._events = self._events, []
        return events

    def _tell(self, node_id: int) -> None:
        del self._untold[node_id]
        picture = self._pictures.get(node_id)
        if picture is not None:
            self._events.append(GroundSeen(node_id, zlib.compress(picture.tobytes(), 9)))

    def _picture(self, node_id: int, graph: RouteGraph | None) -> Picture | None:
        """Return a node's picture, the map's where none is in memory; forgets the one asked for last."""
        if node_id in self._pictures:
            self._pictures.move_to_end(node_id)
            return self._pictures[node_id]
        told = graph.ground_seen(node_id) if isinstance(graph, RemembersGround) else None
        picture = None if told is None else _decoded(told)
        self._pictures[node_id] = picture
        if len(self._pictures) > self._kept:
            oldest_id = next(iter(self._pictures))
            if oldest_id in self._untold:
                self._tell(oldest_id)
            del self._pictures[oldest_id]
        return picture


def _decoded(told: bytes) -> Picture | None:
    """Return the picture that a map holds, None when it is none: then nothing is known of that ground."""
    size = SIDE * SIDE // 8
    try:
        data = zlib.decompressobj().decompress(told, size + 1)
    except zlib.error:
        return None
    return np.frombuffer(data, dtype=np.uint8) if len(data) == size else None


def _sure(bits: NDArray[np.uint8], cells: int) -> NDArray[np.uint8]:
    """Return the ground that was seen even if the picture is so many cells off its place."""
    return shapes.eroded(bits, cells)
