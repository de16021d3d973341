"""How surely the graph knows where its nodes lie from here: the gate every closure must pass.

Along the shortest way over edges errors add up: each edge's own, and each edge's heading error times the arm
from it to the node asked for. The sums of heading variance and its first and second moments give that exactly
to first order, for every pair of nodes, in one pass without matrices.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from math import cos, sin
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from lemtomap.dijkstra import CheapestFirst
from lemtomap.se2 import Pose, between
from lemtomap.topo.graph import DirectedEdge
from lemtomap.topo.loops.config import GateConfig

# Columns of a node's sums: translation variance, heading variance, and that times the place of each edge
# (x, y) and its square (xx, xy, yy), in the anchor's frame.
SHIFT, TURN, TURN_X, TURN_Y, TURN_XX, TURN_XY, TURN_YY = range(7)
Sums = NDArray[np.float64]


class LegSource(Protocol):
    """What the outlook reads of a graph."""

    def legs_of(self, node_id: int) -> Sequence[DirectedEdge]:
        """Return the edges at a node as seen from it."""
        ...


@dataclass(frozen=True, slots=True)
class Expected:
    """Where one node should be, seen from another."""

    T_from_node: Pose
    covariance: NDArray[np.float64]
    """float64 (3, 3), axes of the first node; heading uncorrelated with the rest."""
    way_m: float
    """Length of the way over edges."""


class _Known(NamedTuple):
    x_m: float
    y_m: float
    yaw_rad: float
    way_m: float
    via_id: int
    depth: int
    sums: tuple[float, ...]


_START = _Known(0.0, 0.0, 0.0, 0.0, 0, 0, (0.0,) * 7)


class GraphUncertainty:
    """Expected poses of the nodes around one anchor node, found a slice at a time, surest first."""

    def __init__(self, graph: LegSource, anchor_id: int, config: GateConfig) -> None:
        self.anchor_id = anchor_id
        self._graph = graph
        self._config = config
        self._known: dict[int, _Known] = {}
        self._search = CheapestFirst(anchor_id, self._steps_from)
        self._ids: list[int] = []
        self._rows = np.empty((64, 11))

    @property
    def done(self) -> bool:
        """Whether every node that counts has been reached."""
        return self._search.is_over or len(self._known) >= self._config.outlook_nodes

    def __len__(self) -> int:
        return len(self._known)

    def __contains__(self, node_id: int) -> bool:
        return node_id in self._known

    def advance(self, nodes: int) -> bool:
        """Reach up to `nodes` more; return True when done."""
        room = self._config.outlook_nodes - len(self._known)
        for node_id, _, via_id, leg in islice(self._search, max(0, min(nodes, room))):
            self._add(node_id, _START if leg is None else self._after(self._known[via_id], leg, via_id))
        return self.done

    def extend(self, node_id: int) -> None:
        """Reach a node made since the outlook began, over its surest edge to a node already reached."""
        ways = [
            (self._doubt(back), leg.other_id, back)
            for leg in self._graph.legs_of(node_id)
            if leg.other_id in self._known
            for back in self._graph.legs_of(leg.other_id)
            if back.other_id == node_id
        ]
        if ways:
            doubt, via_id, back = min(ways, key=lambda way: way[0])
            self._add(node_id, self._after(self._known[via_id], back, via_id))
            self._search.settle(node_id, doubt)

    def _add(self, node_id: int, known: _Known) -> None:
        self._known[node_id] = known
        if len(self._ids) == len(self._rows):
            self._rows = np.concatenate([self._rows, np.empty_like(self._rows)])
        self._rows[len(self._ids)] = (known.x_m, known.y_m, known.yaw_rad, known.way_m, *known.sums)
        self._ids.append(node_id)

    def _steps_from(self, node_id: int) -> Iterator[tuple[int, float, DirectedEdge]]:
        return ((leg.other_id, self._doubt(leg), leg) for leg in self._graph.legs_of(node_id))

    def _doubt(self, leg: DirectedEdge) -> float:
        """Return what crossing an edge costs: well measured ways win."""
        shift_var, turn_var = self._variances(leg)
        return shift_var + self._config.arm_m**2 * turn_var

    def _variances(self, leg: DirectedEdge) -> tuple[float, float]:
        config, (_, _, _, _, _, length, shift_var, turn_var) = self._config, leg
        return shift_var + config.shift_var_m2_per_m * length, turn_var + config.turn_var_rad2_per_m * length

    def _after(self, known: _Known, leg: DirectedEdge, node_id: int) -> _Known:
        """Return where an edge from a node reached leads."""
        _, _, dx, dy, turn, length, _, _ = leg
        shift_var, turn_var = self._variances(leg)
        c, s = cos(known.yaw_rad), sin(known.yaw_rad)
        x, y = known.x_m + c * dx - s * dy, known.y_m + s * dx + c * dy
        mx, my = 0.5 * (x + known.x_m), 0.5 * (y + known.y_m)
        before = known.sums
        sums = (
            before[SHIFT] + shift_var,
            before[TURN] + turn_var,
            before[TURN_X] + turn_var * mx,
            before[TURN_Y] + turn_var * my,
            before[TURN_XX] + turn_var * mx * mx,
            before[TURN_XY] + turn_var * mx * my,
            before[TURN_YY] + turn_var * my * my,
        )
        return _Known(x, y, known.yaw_rad + turn, known.way_m + length, node_id, known.depth + 1, sums)

    def pose(self, node_id: int) -> Pose | None:
        """Return T_anchor_node; None while a node is not reached."""
        k = self._known.get(node_id)
        return None if k is None else np.array([k.x_m, k.y_m, k.yaw_rad])

    def between(self, from_id: int, node_id: int) -> Expected | None:
        """Return where a node should be, seen from another; None when either is not reached."""
        a, b = self._known.get(from_id), self._known.get(node_id)
        if a is None or b is None:
            return None
        common = self._common(from_id, node_id)
        sums = np.array(a.sums) + np.array(b.sums) - 2.0 * np.array(common.sums)
        xx, xy, yy = _spread(sums, b.x_m, b.y_m)
        covariance = np.array([[xx, xy, 0.0], [xy, yy, 0.0], [0.0, 0.0, sums[TURN]]])
        c, s = cos(a.yaw_rad), sin(a.yaw_rad)
        turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        T_from_node = between(np.array([a.x_m, a.y_m, a.yaw_rad]), np.array([b.x_m, b.y_m, b.yaw_rad]))
        return Expected(T_from_node, turn @ covariance @ turn.T, a.way_m + b.way_m - 2.0 * common.way_m)

    def way(self, node_id: int) -> list[tuple[int, int]]:
        """Return the pairs of nodes on the way from a node back to the anchor."""
        pairs = []
        while node_id != self.anchor_id:
            via_id = self._known[node_id].via_id
            pairs.append((via_id, node_id))
            node_id = via_id
        return pairs

    def _common(self, a_id: int, b_id: int) -> _Known:
        """Return the last node that the ways to two nodes share."""
        a, b = self._known[a_id], self._known[b_id]
        while a_id != b_id:
            if a.depth >= b.depth:
                a_id = a.via_id
                a = self._known[a_id]
            else:
                b_id = b.via_id
                b = self._known[b_id]
        return a

    def near(
        self, from_id: int, x_m: float, y_m: float, reach_m: float, least_way_m: float
    ) -> tuple[list[int], NDArray[np.float64], NDArray[np.bool_]]:
        """Return the nodes that may lie within `reach_m` of a point of the anchor's frame, seen from a node.

        Likeliest first and not more than `near_nodes`; with how unlikely each is (squared distance in doubts,
        1 m added), float64 (N,), and whether it is known to within the window, bool (N,). Only nodes at least
        `least_way_m` away over edges; generous, as both ways to the anchor count in full.
        """
        config, start = self._config, self._known[from_id]
        rows = self._rows[: len(self._ids)]
        gap_m = np.hypot(rows[:, 0] - x_m, rows[:, 1] - y_m)
        sums = rows[:, 4:].T + np.array(start.sums)[:, None]
        xx, _, yy = _spread(sums, rows[:, 0], rows[:, 1])
        doubt_m = config.gate_sigmas * np.sqrt(xx + yy)
        inside = (gap_m <= reach_m + doubt_m) & (rows[:, 3] + start.way_m >= least_way_m)
        offness = gap_m**2 / (1.0 + 0.5 * (xx + yy))
        chosen = np.flatnonzero(inside)
        chosen = chosen[np.argsort(offness[chosen], kind="stable")][: config.near_nodes]
        ids = [self._ids[i] for i in chosen.tolist()]
        return ids, offness[chosen], doubt_m[chosen] <= config.widest_m


def _spread(sums: Sums, x_m: Sums | float, y_m: Sums | float) -> tuple[Sums, Sums, Sums]:
    """Return the variances xx, xy, yy of a point at (x, y), anchor's axes."""
    arm_xx = sums[TURN_YY] - 2.0 * sums[TURN_Y] * y_m + sums[TURN] * y_m * y_m
    arm_yy = sums[TURN_XX] - 2.0 * sums[TURN_X] * x_m + sums[TURN] * x_m * x_m
    arm_xy = sums[TURN_XY] - sums[TURN_X] * y_m - sums[TURN_Y] * x_m + sums[TURN] * x_m * y_m
    return sums[SHIFT] + np.maximum(arm_xx, 0.0), -arm_xy, sums[SHIFT] + np.maximum(arm_yy, 0.0)
