"""Stored places as the search wants them: decoded, joined with the places around them, thinned."""

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from lemtomap.se2 import Pose, transform
from lemtomap.topo.cells import thinned
from lemtomap.topo.file.paging import PagedGraph, chain
from lemtomap.topo.loops.descriptor import BYTES, unpack
from lemtomap.topo.place import decode_place

T = TypeVar("T")
Points = NDArray[np.float64]
RASTER_M = 0.1  # of joined places: as fine as they are stored
COMPANIES_KEPT = 64  # some 30 kB each: more than one event searches
DESCRIPTORS_KEPT = 8192  # a fifth of a kilobyte each


@dataclass(frozen=True, slots=True)
class LocalSubmap:
    """A place with its neighbours, all in the frame of its node."""

    node_id: int
    points_node: Points
    """float64 (N, 2), metres."""
    search_points: Points
    """An even choice of them."""


class PlaceBook:
    """Localisation data by node, decoded when asked for, the last few hundred kept."""

    def __init__(self, graph: PagedGraph, company_m: float, search_points: int, kept: int = 256) -> None:
        self._graph = graph
        self._company_m = company_m
        self._search_points = search_points
        self._kept = kept
        self._points: OrderedDict[int, Points | None] = OrderedDict()
        self._companies: OrderedDict[int, LocalSubmap | None] = OrderedDict()
        self._descriptors: OrderedDict[int, NDArray[np.float32] | None] = OrderedDict()

    def points(self, node_id: int) -> Points | None:
        """Return a node's obstacle points in its own frame, None when it has no localisation data."""
        return kept(self._points, node_id, self._kept, self._decode)

    def company(self, node_id: int) -> LocalSubmap | None:
        """Return a node's place joined with those around it; None when the node itself has none."""
        return kept(self._companies, node_id, COMPANIES_KEPT, self._join)

    def descriptor(self, node_id: int) -> NDArray[np.float32] | None:
        """Return what a node's place looks like, float32 (20,); None when it has no localisation data."""
        return kept(self._descriptors, node_id, DESCRIPTORS_KEPT, self._describe)

    def has(self, node_id: int) -> bool:
        """Return True if a node has localisation data to be known again by."""
        return self.descriptor(node_id) is not None

    def alone(self, node_id: int) -> LocalSubmap | None:
        """Return a node's place without its neighbours; None when it has none."""
        own = self.points(node_id)
        return None if own is None or len(own) == 0 else LocalSubmap(node_id, own, self._chosen(own))

    def forget(self, *node_ids: int) -> None:
        """Read these nodes afresh (and all companies, which they may belong to)."""
        for node_id in node_ids:
            self._points.pop(node_id, None)
            self._descriptors.pop(node_id, None)
        self._companies.clear()

    def around(self, node_id: int, way_m: float, limit: int = 64) -> dict[int, Pose]:
        """Return T_node_other of the nodes within a way of one node, by the edges of the shortest way."""
        return chain(self._graph.reach(node_id, way_m, limit))

    def _decode(self, node_id: int) -> Points | None:
        place = self._graph.store.place(node_id)
        return None if place is None else decode_place(place.boundary).points.astype(np.float64)

    def _describe(self, node_id: int) -> NDArray[np.float32] | None:
        place = self._graph.store.place(node_id)
        return None if place is None or len(place.descriptor) != BYTES else unpack(place.descriptor)[0]

    def _join(self, node_id: int) -> LocalSubmap | None:
        own = self.points(node_id)
        if own is None or len(own) == 0:
            return None
        parts, level = [own], self._graph.node(node_id).level
        for other_id, T_node_other in self.around(node_id, self._company_m, 32).items():
            points = self.points(other_id)
            alike = other_id != node_id and self._graph.node(other_id).level == level
            if alike and points is not None and len(points):
                parts.append(transform(T_node_other, points))
        joined = np.concatenate(parts)
        joined = joined[np.hypot(joined[:, 0], joined[:, 1]) <= self._company_m]
        joined = thinned(joined, RASTER_M)
        return LocalSubmap(node_id, joined, self._chosen(joined))

    def _chosen(self, points: Points) -> Points:
        """Return an even choice of points, as many as a search needs."""
        stride = max(1.0, len(points) / self._search_points)
        rows = np.minimum(np.arange(0, len(points), stride), len(points) - 1).astype(np.int64)
        return np.ascontiguousarray(points[np.unique(rows)])


def kept(cache: OrderedDict[int, T], key: int, size: int, make: Callable[[int], T]) -> T:
    """Return what a cache of the last few things asked for holds, made anew when it does not."""
    if key not in cache:
        cache[key] = make(key)
        if len(cache) > size:
            cache.popitem(last=False)
    else:
        cache.move_to_end(key)
    return cache[key]
