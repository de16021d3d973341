"""What the mapper talks to: places in, closures out (thesis, section 3-3-2: the explicit check)."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from lemtomap.se2 import Pose, between
from lemtomap.topo.graph import Place, chain_covariance
from lemtomap.topo.loops.cases import Closure, Confirmed, Situation, reversed_covariance
from lemtomap.topo.loops.closer import LoopCloser
from lemtomap.topo.loops.config import LoopConfig
from lemtomap.topo.loops.descriptor import describe
from lemtomap.topo.loops.index import PlaceIndex
from lemtomap.topo.loops.locator import Located, Locator, Look

if TYPE_CHECKING:
    from lemtomap.topo.mapper import TopoMapper

HITS_REACH_M = 14.2  # half the diagonal of a 20 m window


class LoopRecogniser:
    """Explicit loop closing for one mapper (its `recogniser`)."""

    def __init__(self, config: LoopConfig | None = None) -> None:
        self.config = config or LoopConfig()
        self.closures: list[tuple[int, Closure]] = []
        """(edge ID, closure) of all that were committed."""
        self.locator: Locator | None = None
        """At work while a part of the map is not joined to the robot's."""
        self.revoked: list[int] = []
        """Edge IDs of those that were taken back."""
        self._closer: LoopCloser | None = None
        self._index: PlaceIndex | None = None
        self._is_behind = True
        self._found: dict[int, Pose] = {}
        self._sure_m = 0.0
        self._lost_m = 0.0

    def describe(self, points_node: NDArray[np.float64]) -> bytes:
        """Return the rotation-invariant descriptor of boundary points, float64 (N, 2), node frame."""
        return describe(points_node)

    def place_taken(self, node_id: int, place: Place) -> None:  # noqa: ARG002 - read again from the file
        """Take note of a node's localisation data, new or renewed."""
        self._is_behind = True
        if self._closer is not None:
            self._closer.place_taken(node_id)

    def lost(self, mapper: "TopoMapper") -> None:
        """Look for the robot in all of the map but what it maps from now on."""
        part_id = mapper.part_id
        self._of(mapper).restart()
        self._found.clear()
        self._lost_m = mapper.travelled_m
        self.locator = self._locator(mapper, lambda node_id: node_id < part_id)

    def window_changed(self, mapper: "TopoMapper") -> None:
        """Drop what was found in a window that is no more, and look anew."""
        if mapper.lost:
            self.lost(mapper)
            return
        self._of(mapper).restart()
        self._found.clear()
        self.locator = None

    def _locator(self, mapper: "TopoMapper", is_known: Callable[[int], bool]) -> Locator:
        return Locator(self.config, mapper.graph, self._index_of(mapper), is_known)

    def at_node(self, mapper: "TopoMapper", *, born: bool) -> None:  # noqa: ARG002
        """Look for known places around a node that was made or became the associated one."""
        self._is_behind = True  # whatever else changed the file is noticed here
        if mapper.lost:
            return
        slam, grid = mapper.now
        here_id = mapper.associated_id
        standing = mapper.local.standings[here_id]
        measured = frozenset(node_id for node_id in mapper.local.standings if self._stands(mapper, node_id))
        if here_id in measured:
            self._sure_m = mapper.travelled_m
        x, y = slam.T_grid_base[:2].tolist()
        situation = Situation(
            here_id,
            standing.T_grid_node,
            standing.covariance,
            slam.T_grid_base,
            mapper.travelled_m,
            grid,
            mapper.travelled_m - self._sure_m,
            measured,
        )
        points = mapper.keeper.hits.around((x, y), HITS_REACH_M, grid, mapper.config.occupied_from)
        self._of(mapper).at_node(situation, points)

    def update(self, mapper: "TopoMapper") -> None:
        """Work a slice after each scan; closes loops."""
        if self._is_behind:
            self._is_behind = not self._index_of(mapper).catch_up()
        if not mapper.lost:
            self._close(mapper)
            self._watch_other_parts(mapper)
        if self.locator is not None:
            self._locate(mapper, self.locator)

    def _watch_other_parts(self, mapper: "TopoMapper") -> None:
        """Look beside the mapping for parts of the map that nothing joins to the robot's yet."""
        closer = self._of(mapper)
        if self.locator is None and closer.sees_parts_apart():
            self.locator = self._locator(mapper, lambda node_id: not closer.is_joined(node_id))

    def _locate(self, mapper: "TopoMapper", locator: Locator) -> None:
        """Look for the robot in the rest of the map; join the two when it is found."""
        if locator.due(mapper.travelled_m, mapper.turned_rad):
            slam, grid = mapper.now
            x, y = slam.T_grid_base[:2].tolist()
            points = mapper.keeper.hits.around((x, y), HITS_REACH_M, grid, mapper.config.occupied_from)
            locator.look(Look(slam.T_grid_base, mapper.travelled_m, mapper.turned_rad, grid, points))
        located = locator.update(self.config.locator.budget if mapper.lost else self.config.budget)
        if located is not None:
            self._join(mapper, located)
        elif mapper.lost and mapper.travelled_m - self._lost_m > self.config.locator.unknown_m:
            mapper.found(known=False)

    def _join(self, mapper: "TopoMapper", located: Located) -> None:
        """Join the robot's part of the map to where it was found, and stand there if it is near."""
        here_id = mapper.associated_id
        here = mapper.local.standings[here_id]
        T_here_node = between(here.T_grid_node, located.T_grid_node)
        doubt = reversed_covariance(here.T_grid_node, here.covariance)
        covariance = chain_covariance(doubt, located.T_grid_node, located.covariance)
        edge = mapper.close_loop(here_id, located.node_id, T_here_node, covariance)
        match, found = located.match, Confirmed(located.node_id, located.T_grid_node, located.covariance)
        evidence = float(self.config.locator.checks)
        closure = Closure(
            here_id,
            located.node_id,
            T_here_node,
            covariance,
            located.T_grid_node,
            match,
            informs=True,
            evidence=evidence,
        )
        self.closures.append((edge.edge_id, closure))
        self._of(mapper).audit.commit([edge], support=evidence)
        if mapper.lost:
            mapper.adopt_level(mapper.graph.node(located.node_id).level)
            self._stand_at(mapper, found)
        self._anchor(mapper, found)
        self._of(mapper).restart()
        self.locator = None
        mapper.found()

    def _close(self, mapper: "TopoMapper") -> None:
        closer = self._of(mapper)
        closer.audit.notice(mapper.graph.edges_of(mapper.associated_id))
        for trial in closer.audit.lost():
            self._revoke(mapper, closer, [edge.edge_id for edge in trial.edges])
        closures = closer.update()
        edges = []
        for closure in closures:
            if closure.informs:
                edge = mapper.close_loop(
                    closure.here_id, closure.node_id, closure.T_here_node, closure.covariance
                )
                edges.append(edge)
                self.closures.append((edge.edge_id, closure))
        if edges:
            closer.audit.commit(edges, support=sum(closure.evidence for closure in closures))
        found = [Confirmed(each.node_id, each.T_grid_node, each.match.covariance) for each in closures]
        for each in found:
            self._anchor(mapper, each)
        if found and not self._stands(mapper, mapper.associated_id):
            nearest = min(found, key=lambda each: _gap_m(mapper, each))
            self._stand_at(mapper, nearest)
            self._anchor(mapper, nearest)
        for confirmed in closer.confirmed:
            self._anchor(mapper, confirmed)
        closer.confirmed.clear()

    def _stand_at(self, mapper: "TopoMapper", found: Confirmed) -> None:
        """Make a node that was found the associated one if the robot is at it.

        From further off an odometry edge would begin there that nobody has driven.
        """
        if _gap_m(mapper, found) <= mapper.config.new_node_distance_m:
            mapper.relocate(found.node_id, found.T_grid_node, found.covariance)

    def _revoke(self, mapper: "TopoMapper", closer: LoopCloser, edge_ids: list[int]) -> None:
        """Take back closures that proved wrong, and what was believed because of them."""
        mapper.revoke(*edge_ids)
        self.closures = [(edge_id, closure) for edge_id, closure in self.closures if edge_id not in edge_ids]
        self.revoked += edge_ids
        self._found.clear()
        closer.start_afresh()

    def _stands(self, mapper: "TopoMapper", node_id: int) -> bool:
        """Tell whether a node's place in the window is sure."""
        each = mapper.local.standings.get(node_id)
        return (
            each is not None and each.anchored and (each.born or self._found.get(node_id) is each.T_grid_node)
        )

    def _anchor(self, mapper: "TopoMapper", confirmed: Confirmed) -> None:
        """Set a node in the window where it was found, unless it was made there."""
        standing = mapper.local.standings.get(confirmed.node_id)
        if standing is None or not (standing.born and standing.anchored):
            mapper.local.anchor(
                confirmed.node_id, confirmed.T_grid_node, confirmed.covariance, seen=confirmed.covariance
            )
            self._found[confirmed.node_id] = confirmed.T_grid_node

    def _of(self, mapper: "TopoMapper") -> LoopCloser:
        if self._closer is None:
            self._closer = LoopCloser(self.config, mapper.graph)
        return self._closer

    def _index_of(self, mapper: "TopoMapper") -> PlaceIndex:
        if self._index is None:
            self._index = PlaceIndex.of_map(mapper.store)
        return self._index


def _gap_m(mapper: "TopoMapper", found: Confirmed) -> float:
    """Return how far the robot is from a node that was found."""
    at = mapper.now[0].T_grid_base
    return float(np.hypot(found.T_grid_node[0] - at[0], found.T_grid_node[1] - at[1]))
