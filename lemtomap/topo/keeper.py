"""Localisation data over a node's life: taken when best known, compared when seen again, renewed if stale."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lemtomap.se2 import Pose, inverse, transform
from lemtomap.topo.config import TopoConfig
from lemtomap.topo.file.paging import PagedGraph
from lemtomap.topo.graph import Place
from lemtomap.topo.kernels import fitting
from lemtomap.topo.local import LocalMap, NodePoseEstimate
from lemtomap.topo.place import decode_place, encode_place
from lemtomap.topo.place.align import PlaceMatch, match_place
from lemtomap.topo.place.hits import HitMap
from lemtomap.types import GridView

AGEING = 0.7  # of the way a measurement stays fresh: then the place is taken, however near the robot stays

SIDES = 12
"""Bearings from a node are told apart by 30 degrees."""
SIDE_POINTS = 3
UNSEEN_SIDES = 3
"""A laser that sees 240 degrees leaves four behind it."""

Points = NDArray[np.float64]
Describe = Callable[[NDArray[np.float64]], bytes]
"""Boundary points around a node, float64 (N, 2), node frame → its rotation-invariant descriptor."""


@dataclass(frozen=True, slots=True)
class Taken:
    """Localisation data was written for a node."""

    node_id: int
    place: Place


class PlaceKeeper:
    """Decides when a node's localisation data is taken, and by what it is recognised.

    A node is *due* from its birth until its data was taken from a robot that has left it: then the
    surroundings have been seen from all sides and the window still holds them. A node seen again is looked
    over at the same moment.
    """

    def __init__(self, config: TopoConfig, graph: PagedGraph, describe: Describe | None = None) -> None:
        self.config = config
        self.hits = HitMap()
        self._graph = graph
        self._describe = describe
        self._due: dict[int, bool] = {}

    def due(self, node_id: int) -> None:
        """Have a node's data taken when the time has come."""
        self._due[node_id] = True

    def review(self, node_id: int) -> None:
        """Have a node that the robot is at again looked over when the time has come."""
        self._due.setdefault(node_id, False)

    def observe(self, T_grid_base: Pose, points_base: NDArray[np.floating] | None) -> None:
        """Take in a scan's hits, float (N, 2), metres, base frame."""
        if points_base is not None and len(points_base):
            self.hits.add(T_grid_base, points_base)

    def forget_window(self) -> None:
        """Begin with an empty window: the robot is somewhere else."""
        self.hits = HitMap()
        self._due.clear()

    def take_ripe(self, local: LocalMap, T_grid_base: Pose, grid: GridView, now_s: float) -> list[Taken]:
        """Take the data of due nodes that the robot has left behind or that soon must be measured again."""
        taken = []
        for node_id in list(self._due):
            standing = local.standings.get(node_id)
            if standing is None or not standing.anchored:
                del self._due[node_id]  # forgotten before it was ripe
                continue
            away_m = float(np.hypot(*(standing.T_grid_node[:2] - T_grid_base[:2])))
            age_m = local.way_m - standing.measured_m
            if away_m >= self.config.place_taken_at_m or age_m >= AGEING * self.config.fresh_m:
                taken += self._take(node_id, standing, grid, now_s, anyway=self._due.pop(node_id))
        return taken

    def take_all(
        self, standings: Mapping[int, NodePoseEstimate], grid: GridView, now_s: float
    ) -> list[Taken]:
        """Take what is due now, ripe or not: the drive ends."""
        taken = []
        for node_id, anyway in self._due.items():
            standing = standings.get(node_id)
            if standing is not None and standing.anchored:
                taken += self._take(node_id, standing, grid, now_s, anyway=anyway)
        self._due.clear()
        return taken

    def align(self, node_id: int, standing: NodePoseEstimate, grid: GridView) -> PlaceMatch | None:
        """Match a node's data with the window around its predicted pose; None when it has none."""
        place = self._graph.store.place(node_id)
        if place is None:
            return None
        boundary = decode_place(place.boundary)
        centre = (float(standing.T_grid_node[0]), float(standing.T_grid_node[1]))
        radius_m = boundary.radius_m + 1.0
        hits = self.hits.faces_around(centre, radius_m, grid, self.config.occupied_from)
        predicted = (standing.T_grid_node, standing.covariance)
        return match_place(boundary, hits, grid, predicted, self.config.match)

    def _is_stale(
        self, node_id: int, standing: NodePoseEstimate, points_node: Points, grid: GridView
    ) -> bool:
        """Compare what surrounds a node now with its data; after several visits that differ, tell so.

        One visit with a person or an open door in view changes nothing; one that shows a side never seen
        before (behind the robot where the map began) does.
        """
        place, config = self._graph.store.place(node_id), self.config
        if place is None:
            return True
        stored = decode_place(place.boundary).points.astype(np.float64)
        near = points_node[np.hypot(points_node[:, 0], points_node[:, 1]) <= config.place_new_within_m]
        if _unseen_sides(stored, near) >= UNSEEN_SIDES:
            return True
        stored_grid = transform(standing.T_grid_node, stored)
        bare = stored[_is_free(stored_grid, grid, config.occupied_from // 2)]
        changes = _without(near, stored, config) + _without(bare, points_node, config)
        node = self._graph.node(node_id)
        doubts = node.doubts + 1 if changes >= config.place_changes else 0
        stale = doubts >= config.place_stale_visits
        doubts = 0 if stale else doubts
        if doubts != node.doubts:
            self._graph.put_node(replace(node, doubts=doubts))
        return stale

    def _take(
        self, node_id: int, standing: NodePoseEstimate, grid: GridView, now_s: float, *, anyway: bool
    ) -> list[Taken]:
        """Write a node's data: of one seen before only when it proves stale."""
        centre = (float(standing.T_grid_node[0]), float(standing.T_grid_node[1]))
        radius_m = self.config.place_radius_m
        hits = self.hits.faces_around(centre, radius_m * np.sqrt(2.0), grid, self.config.occupied_from)
        points_node = transform(inverse(standing.T_grid_node), hits[:, :2])
        if not anyway and not self._is_stale(node_id, standing, points_node, grid):
            return []
        whence_node = transform(np.array([0.0, 0.0, -standing.T_grid_node[2]]), hits[:, 2:])
        seen_node = np.concatenate([points_node, whence_node], axis=1)
        code = encode_place(seen_node, radius_m, self.config.place_byte_budget)
        descriptor = b"" if self._describe is None else self._describe(points_node)
        place = Place(now_s, code, descriptor)
        self._graph.store.put_place(node_id, place)
        return [Taken(node_id, place)]


def _is_free(points_grid: Points, grid: GridView, free_below: int) -> NDArray[np.bool_]:
    """Return which points, float64 (N, 2), the window has seen to be free, bool (N,)."""
    cells = np.floor((points_grid - np.array(grid.origin_m)) / grid.resolution_m).astype(np.int64)
    rows, cols = grid.occupancy.shape
    inside = (cells >= 0).all(axis=1) & (cells[:, 0] < cols) & (cells[:, 1] < rows)
    occupancy = np.full(len(cells), -1, dtype=np.int64)
    occupancy[inside] = grid.occupancy[cells[inside, 1], cells[inside, 0]]
    return (occupancy >= 0) & (occupancy < free_below)


def _unseen_sides(stored_node: Points, seen_node: Points) -> int:
    """Count the bearings in which something is seen now and nothing at all is stored."""

    def count(points: Points) -> NDArray[np.int64]:
        bearing = np.arctan2(points[:, 1], points[:, 0]) / math.tau % 1.0
        return np.bincount(np.minimum((SIDES * bearing).astype(np.int64), SIDES - 1), minlength=SIDES)

    return int(((count(seen_node) >= SIDE_POINTS) & (count(stored_node) == 0)).sum())


def _without(points: Points, others: Points, config: TopoConfig) -> int:
    """Count the points that have none of the others near."""
    reach_m = np.sqrt(2.0) * config.place_radius_m
    share = fitting.share_near(np.ascontiguousarray(points), others, reach_m, config.place_apart_m)
    return round((1.0 - share) * len(points))
