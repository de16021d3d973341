"""Area segmentation as the map grows (thesis, sections 3-3-1 and 3-3-2): look, weigh, pass, cut, label."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lemtomap.areas import gates
from lemtomap.areas.book import AreaBook
from lemtomap.areas.config import AreaConfig
from lemtomap.areas.gaps import WallGap, gaps_around
from lemtomap.areas.gates import Gate
from lemtomap.areas.labels import Labeller
from lemtomap.areas.model import MappedDoor
from lemtomap.se2 import Pose, between
from lemtomap.topo.file.paging import PagedGraph
from lemtomap.topo.graph import FOR_EVER_S, Edge
from lemtomap.topo.local import NodePoseEstimate
from lemtomap.topo.segmentation import Neighbourhood

JAMB_M = 0.25  # a way this near beside a gap leads through it: there is a wall
PASS_STEP_M = 0.05  # the robot's way is looked at in steps of this size
PASS_LEAP_M = 1.0  # ... and a longer one was not driven: the window began anew
NEAR_M = 6.0  # from the robot: ways further off are too roughly known in the window
LABELLED_M = 9.0
"""Half a window: nodes so near are labelled anew."""


class AreaSegmenter:
    """Finds doors in the window, and keeps the areas between them. Owned by the mapping thread."""

    def __init__(self, config: AreaConfig | None = None) -> None:
        self.config = config or AreaConfig()
        self.area_of: Mapping[int, int] = {}
        """Area of each node around, at the last look."""
        self.doors_grid: Mapping[int, NDArray[np.float64]] = {}
        """Both ends of each door around, float64 (2, 2), metres, in the window at the last look."""
        self._gates: list[Gate] = []
        self._asked: set[int] = set()
        """Nodes around whose doors were read from the map."""
        self._last: Neighbourhood | None = None
        self._last_base: NDArray[np.float64] | None = None
        self._version = -1
        self._near: list[Gate] = []
        """Gates near the robot at the last look."""

    def attach(self, graph: PagedGraph) -> None:
        """Work on this map from now on."""
        self._graph = graph
        self._book = AreaBook(graph.store)
        self._labeller = Labeller(graph, self._book)

    def update(self, around: Neighbourhood) -> None:
        """Take in what one scan brought: mostly nothing but the robot's way."""
        self._pass(around)
        before = self._last
        is_new_place = before is None or around.here_id != before.here_id
        moved_m = 0.0 if before is None else around.travelled_m - before.travelled_m
        waited_s = 0.0 if before is None else around.stamp_s - before.stamp_s
        if not is_new_place and moved_m < self.config.look_every_m and waited_s < self.config.look_every_s:
            return
        self._last = around
        self._recall(around)
        changed = self._look(around, counts=before is None or is_new_place or moved_m > 0.1)
        changed |= self._cut(around)
        if changed or is_new_place or self._graph.store.version != self._version:
            self._label(around)
        self._version = self._graph.store.version
        self._tell(around)

    def _tell(self, around: Neighbourhood) -> None:
        """Note what others see: which area nodes are of, and where doors are."""
        self.area_of = {node_id: self._graph.node(node_id).area_id for node_id in around.standings}
        self.doors_grid = {
            gate.door.door_id: gate.ends_grid()
            for gate in self._near
            if gate.door.door_id and gate.door.is_door and gate.T_grid_gate is not None
        }

    # -- gates ----------------------------------------------------------------------------------------------

    def _recall(self, around: Neighbourhood) -> None:
        """Read the doors of nodes that came near; let go of those whose nodes are far."""
        near = around.standings.keys()
        self._gates = [gate for gate in self._gates if gate.door.node in near]
        self._asked &= near
        fresh = [node_id for node_id in near if node_id not in self._asked]
        if fresh:
            known = {gate.door.door_id for gate in self._gates}
            for door in self._book.gates_at(fresh):
                if door.door_id not in known:
                    sure = self.config.evidence_most
                    self._gates.append(
                        Gate(door, sure, gates.MOST_WEIGHT, door_like=10.0 if door.is_door else -10.0)
                    )
            self._asked.update(fresh)
        for gate in self._gates:
            gates.place(gate, around)
        self._sort_out(around)

    def _sort_out(self, around: Neighbourhood) -> None:
        self._near = [g for g in self._gates if gates.distance_m(g, around.T_grid_base) <= LABELLED_M]

    def _look(self, around: Neighbourhood, *, counts: bool) -> bool:
        """Weigh what the window shows of gates, known and new; returns whether the map's gates changed."""
        gaps = gaps_around(around.grid, around.T_grid_base, around.occupied_from, self.config)
        changed = False
        met: set[int] = set()
        for gap in gaps:
            gate = self._gate_at(gap.T_grid_gap)
            if gate is None and counts:
                gate = self._new_gate(gap, around)
            if gate is None or id(gate) in met:
                continue
            met.add(id(gate))
            if counts:
                was_open = not gate.door.is_shut
                gates.see(gate, gap, around, self.config)
                gates.place(gate, around)
                if not was_open:
                    self._open(gate, around)
                changed |= self._write(gate)
        for gate in list(self._near):
            if id(gate) not in met:
                changed |= self._miss(gate, around, counts=counts)
        return self._merge_twins() or changed

    def _gate_at(self, T_grid_gap: Pose) -> Gate | None:
        same = [gate for gate in self._near if gates.is_same(gate, T_grid_gap, self.config)]
        return min(same, key=lambda gate: gates.distance_m(gate, T_grid_gap), default=None)

    def _new_gate(self, gap: WallGap, around: Neighbourhood) -> Gate | None:
        """Begin to gather evidence for a gap seen for the first time, at the nearest node of this window."""
        T_grid_gap = gap.T_grid_gap
        anchored = [node_id for node_id, standing in around.standings.items() if standing.anchored]
        if not anchored:
            return None
        node_id = min(
            anchored,
            key=lambda k: math.dist(around.standings[k].T_grid_node[:2], T_grid_gap[:2]),
        )
        x, y, yaw = between(around.standings[node_id].T_grid_node, T_grid_gap).tolist()
        gate = Gate(MappedDoor(0, node_id, x, y, yaw, gap.width_m))
        gates.place(gate, around)
        self._gates.append(gate)
        self._near.append(gate)
        return gate

    def _miss(self, gate: Gate, around: Neighbourhood, *, counts: bool) -> bool:
        """Weigh that a gate nearby was not seen: shut, or none at all; returns whether the map changed."""
        config = self.config
        if not gates.is_in_sight(gate, around, config.sure_within_m):
            return False
        closed = gates.closed_share(gate, around)
        if closed is None:
            return False
        if closed >= config.shut_share:
            gate.shut_in_a_row += 1
            if gate.shut_in_a_row >= 2 and gate.door.door_id:
                self._shut(gate, around)
            return False
        gate.shut_in_a_row = 0
        if counts and closed < 0.2:
            gate.log_odds -= config.evidence_gone
            if gate.log_odds < 0.0 and gate.door.passed == 0:
                self._drop(gate)
                if gate.door.door_id:
                    self._book.delete_door(gate.door.door_id)
                    return True
        return False

    def _write(self, gate: Gate) -> bool:
        """Write a gate that the evidence suffices for; returns whether it is new, or of another kind now."""
        if gate.log_odds < self.config.evidence_needed:
            return False
        door, is_door = gate.door, gate.door_like > 0.0
        is_new, changed = door.door_id == 0, door.is_door != is_door
        gate.door = replace(door, is_door=is_door)
        if is_new:
            gate.door = self._book.add_door(gate.door)
        else:
            self._book.put_door(gate.door)
        return is_new or changed

    def _merge_twins(self) -> bool:
        """Make one of two doors at one place: a closure has shown that they are the same."""
        by_age = sorted(self._near, key=lambda gate: gate.door.door_id or 1 << 60)
        for k, gate in enumerate(by_age):
            for other in by_age[k + 1 :]:
                if abs(gate.at[0] - other.at[0]) > self.config.same_door_m or other.T_grid_gate is None:
                    continue
                if gates.is_same(gate, other.T_grid_gate, self.config):
                    self._take_in(gate, other)
                    return True
        return False

    def _drop(self, gate: Gate) -> None:
        self._gates.remove(gate)
        self._near.remove(gate)

    def _take_in(self, gate: Gate, other: Gate) -> None:
        ours, theirs = gate.door, other.door
        gate.door = replace(
            ours,
            edges=tuple(sorted({*ours.edges, *theirs.edges})),
            seen_open=ours.seen_open + theirs.seen_open,
            seen_shut=ours.seen_shut + theirs.seen_shut,
            last_open_s=max(
                (t for t in (ours.last_open_s, theirs.last_open_s) if t is not None), default=None
            ),
            last_shut_s=max(
                (t for t in (ours.last_shut_s, theirs.last_shut_s) if t is not None), default=None
            ),
            passed=ours.passed + theirs.passed,
        )
        gate.log_odds = max(gate.log_odds, other.log_odds)
        self._drop(other)
        if theirs.door_id:
            self._book.delete_door(theirs.door_id)
        if ours.door_id:
            self._book.put_door(gate.door)

    # -- shut, open, passed ---------------------------------------------------------------------------------

    def _shut(self, gate: Gate, around: Neighbourhood) -> None:
        """Close a door's edges for a while: it was seen shut."""
        gate.door = replace(gate.door, seen_shut=gate.door.seen_shut + 1, last_shut_s=around.stamp_s)
        self._book.put_door(gate.door)
        for edge in self._edges(gate.door.edges, around):
            if edge.blocked_until_s < around.stamp_s + 0.5 * self.config.block_s:
                self._graph.put_edge(replace(edge, blocked_until_s=around.stamp_s + self.config.block_s))

    def _open(self, gate: Gate, around: Neighbourhood) -> None:
        """Open the edges of a door that is open again."""
        for edge in self._edges(gate.door.edges, around):
            if around.stamp_s < edge.blocked_until_s < FOR_EVER_S:
                self._graph.put_edge(replace(edge, blocked_until_s=0.0))

    def _edges(self, edge_ids: Iterable[int], around: Neighbourhood) -> list[Edge]:
        wanted = set(edge_ids)
        nodes = around.standings
        found = {e.edge_id: e for k in nodes for e in self._graph.edges_of(k) if e.edge_id in wanted}
        return list(found.values())

    def _pass(self, around: Neighbourhood) -> None:
        """Count the doors that the robot drove through since the scan before."""
        before, here = self._last_base, around.T_grid_base[:2].copy()
        if before is None:
            self._last_base = here
            return
        step_m = math.dist(before, here)
        if step_m < PASS_STEP_M:
            return
        self._last_base = here
        if step_m > PASS_LEAP_M:  # a window begun anew: not driven
            return
        for gate in self._near:
            if (
                gates.distance_m(gate, around.T_grid_base) < 2.0
                and gates.crosses(gate.ends_grid(), before[None], here[None])[0]
            ):
                gate.log_odds = self.config.evidence_most
                gate.door = replace(gate.door, passed=gate.door.passed + 1, last_open_s=around.stamp_s)
                self._write(gate)

    # -- ways and areas -------------------------------------------------------------------------------------

    def _cut(self, around: Neighbourhood) -> bool:
        """Find which ways near the robot lead through which door; returns whether any changed."""
        near = [
            node_id
            for node_id, standing in around.standings.items()
            if _distance_m(standing, around) <= NEAR_M
        ]
        edges = list(
            {
                e.edge_id: e for k in near for e in self._graph.edges_of(k) if e.other(k) in around.standings
            }.values()
        )
        if not edges:
            return False
        starts = np.array([around.standings[edge.source_id].T_grid_node[:2] for edge in edges])
        stops = np.array([around.standings[edge.target_id].T_grid_node[:2] for edge in edges])
        changed = False
        for gate in self._near:
            if gate.door.door_id and gates.distance_m(gate, around.T_grid_base) <= NEAR_M:
                changed |= self._cut_at(gate, edges, starts, stops)
        return changed

    def _cut_at(
        self, gate: Gate, edges: list[Edge], starts: NDArray[np.float64], stops: NDArray[np.float64]
    ) -> bool:
        """Find which ways lead through one door, where that is clear; returns whether any changed."""
        assert gate.T_grid_gate is not None  # noqa: S101 - asked only of gates in the window
        x, y, yaw = gate.T_grid_gate.tolist()
        normal = np.array([np.cos(yaw), np.sin(yaw)])
        through = gates.crosses(gate.ends_grid(JAMB_M), starts, stops)
        off = np.minimum(abs((starts - (x, y)) @ normal), abs((stops - (x, y)) @ normal))
        before = set(gate.door.edges)
        after = set(before)
        for edge, is_through, off_m in zip(edges, through.tolist(), off.tolist(), strict=True):
            if is_through and edge.edge_id not in before:
                after.add(edge.edge_id)
            elif not is_through and edge.edge_id in before and off_m > self.config.settled_m:
                after.discard(edge.edge_id)
        if after == before:
            return False
        gate.door = replace(gate.door, edges=tuple(sorted(after)))
        self._book.put_edges(gate.door)
        return True

    def _label(self, around: Neighbourhood) -> None:
        near = [
            node_id
            for node_id, standing in around.standings.items()
            if _distance_m(standing, around) <= LABELLED_M
        ]
        cut = {edge_id for gate in self._gates for edge_id in gate.door.edges}
        self._labeller.update(near, cut, around.level)


def _distance_m(standing: NodePoseEstimate, around: Neighbourhood) -> float:
    x, y, _ = standing.T_grid_node.tolist()
    return math.hypot(x - float(around.T_grid_base[0]), y - float(around.T_grid_base[1]))
