"""Localisation data over a node's life: taken when best known, compared when seen again, renewed if stale."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lemtomap.se2 import Pose, inverse, transform
from lemtomap.topo.align import HitMap, Match, match_place
from lemtomap.topo.config import TopoConfig
from lemtomap.topo.graph import Place
from lemtomap.topo.local import LocalMap, Standing
from lemtomap.topo.paging import PagedGraph
from lemtomap.topo.place import decode_place, encode_place
from lemtomap.types import GridView

AGEING = 0.7  # of the way a measurement stays fresh: then the place is taken, however near the robot stays

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
    surroundings have been seen from all sides and the window still holds them.
    """

    def __init__(self, config: TopoConfig, graph: PagedGraph, describe: Describe | None = None) -> None:
        self.config = config
        self.hits = HitMap()
        self._graph = graph
        self._describe = describe
        self._due: dict[int, None] = {}

    def due(self, node_id: int) -> None:
        """Have a node's data taken when the time has come."""
        self._due[node_id] = None

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
                taken += self._take(node_id, standing, grid, now_s)
                del self._due[node_id]
        return taken

    def take_all(self, standings: dict[int, Standing], grid: GridView, now_s: float) -> list[Taken]:
        """Take what is due now, ripe or not: the drive ends."""
        taken = []
        for node_id in self._due:
            standing = standings.get(node_id)
            if standing is not None and standing.anchored:
                taken += self._take(node_id, standing, grid, now_s)
        self._due.clear()
        return taken

    def align(self, node_id: int, standing: Standing, grid: GridView) -> Match | None:
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

    def compare(self, node_id: int, match: Match) -> None:
        """Note how well a place looked like its data; after several visits that did not, it is taken anew.

        One visit with a person or an open door in view changes nothing.
        """
        node = self._graph.node(node_id)
        doubts = 0 if match.score >= self.config.place_alike_score else node.doubts + 1
        if doubts >= self.config.place_stale_visits:
            self.due(node_id)
            doubts = 0
        if doubts != node.doubts:
            self._graph.put_node(replace(node, doubts=doubts))

    def _take(self, node_id: int, standing: Standing, grid: GridView, now_s: float) -> list[Taken]:
        centre = (float(standing.T_grid_node[0]), float(standing.T_grid_node[1]))
        radius_m = self.config.place_radius_m
        hits = self.hits.faces_around(centre, radius_m * np.sqrt(2.0), grid, self.config.occupied_from)
        points_node = transform(inverse(standing.T_grid_node), hits[:, :2])
        whence_node = transform(np.array([0.0, 0.0, -standing.T_grid_node[2]]), hits[:, 2:])
        seen_node = np.concatenate([points_node, whence_node], axis=1)
        code = encode_place(seen_node, radius_m, self.config.place_byte_budget)
        descriptor = b"" if self._describe is None else self._describe(points_node)
        place = Place(now_s, code, descriptor)
        self._graph.store.put_place(node_id, place)
        return [Taken(node_id, place)]
