"""Topological SLAM, one scan at a time (thesis, Figure 3-6): associate, or be born and join."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lemtomap.errors import LemtomapError
from lemtomap.se2 import Pose, adjoint, between
from lemtomap.topo.config import TopoConfig
from lemtomap.topo.graph import Covariance, Edge, chain_covariance
from lemtomap.topo.local import LocalMap, Standing
from lemtomap.topo.neighbours import NeighbourFinder, in_sight
from lemtomap.topo.paging import PagedGraph
from lemtomap.topo.store import TopoStore
from lemtomap.topo.trail import ScanTrail
from lemtomap.types import EdgeType, GridView, MapView, SlamUpdate

COVARIANCE_FLOOR = np.diag([0.002**2, 0.002**2, np.deg2rad(0.1) ** 2])
"""No relation between two places is known better: a tenth of a grid cell's quantisation noise."""


class NotStarted(LemtomapError):
    """A snapshot was asked for before the first scan."""


@dataclass(slots=True)
class _Now:
    """What the last scan said."""

    slam: SlamUpdate
    grid: GridView


class TopoMapper:
    """The topological map as it grows. Owned by the mapping thread; hands out immutable views.

    Holds: exactly one node is associated from the first scan on, and the next one is a new node or one of
    its neighbours.
    """

    def __init__(
        self, config: TopoConfig, store: TopoStore, trail: ScanTrail | None = None, *, level: int = 0
    ) -> None:
        self.config = config
        self.store = store
        self.graph = PagedGraph(store, config.paged_nodes)
        self.local = LocalMap(self.graph, config.local_radius_m, config.local_limit)
        self.trail = ScanTrail.temporary() if trail is None else trail
        self.level = level
        self.lost = False
        self.on_node: list[Callable[[int], None]] = []
        """Called with the ID of each new node."""
        self._neighbours = NeighbourFinder(config)
        self._associated_id = 0
        self._drift: Covariance = np.zeros((3, 3))
        self._now: _Now | None = None
        self._picture: tuple[tuple[int, int], list[tuple[int, int, int, EdgeType]]] = ((-1, -1), [])

    @property
    def associated_id(self) -> int:
        """The node the robot is at; 0 before the first scan."""
        return self._associated_id

    @property
    def T_node_base(self) -> Pose:  # noqa: N802 - a frame's name
        """Where the robot is relative to the associated node."""
        now = self._require()
        return between(self.local.standings[self._associated_id].T_grid_node, now.slam.T_grid_base)

    def update(
        self,
        slam: SlamUpdate,
        grid: GridView,
        points_base: NDArray[np.floating] | None = None,  # noqa: ARG002
    ) -> None:
        """Take in what one scan told the window SLAM.

        `grid` is the window after this scan (an older snapshot will do between integrations);
        `points_base` are the scan's hits, float (N, 2), metres, base frame.
        """
        before, self._now = self._now, _Now(slam, grid)
        if before is None:
            self._start()
        else:
            self._move(before.slam, slam)
            if grid is not before.grid:
                self.local.release_forgotten(grid)
            self._associate_or_create()
        self.trail.append(slam.stamp_s, self._associated_id, self.T_node_base)
        self.store.tick(slam.stamp_s)

    # -- the steps of Figure 3-6 ----------------------------------------------------------------------------

    def _start(self) -> None:
        self._birth()

    def _move(self, before: SlamUpdate, after: SlamUpdate) -> None:
        """Let the covariance of T_node_base grow by the motion since the previous scan."""
        step = between(before.T_grid_base, after.T_grid_base)
        turn = _turned(-step[2])
        self._drift = chain_covariance(self._drift, step, turn @ after.step_covariance @ turn.T)

    def _associate_or_create(self) -> None:
        """Only a neighbour or a new node can come next, and only one that no wall hides.

        The thesis assumes half a metre between robot and wall, so that no node beyond one is ever nearer than
        a metre; Kobuki goes closer, hence the look at the window.
        """
        near, far = self.config.association_margin_m, self.config.new_node_distance_m
        associated_m = self._distance_m(self._associated_id)
        nearest_id = self._nearest_neighbour(associated_m - near)
        if nearest_id:
            self._associate(nearest_id)
        elif associated_m > far or (associated_m > 0.5 * far and not self._sees(self._associated_id)):
            self._create()

    def _nearest_neighbour(self, within_m: float) -> int:
        """Return the nearest neighbour of the associated node in sight; 0 when none is so near."""
        nearest_id, nearest_m = 0, within_m
        for edge in self.graph.edges_of(self._associated_id):
            other_id = edge.other(self._associated_id)
            if other_id not in self.local.standings:
                continue
            other_m = self._distance_m(other_id)
            if other_m < nearest_m and self._sees(other_id):
                nearest_id, nearest_m = other_id, other_m
        return nearest_id

    def _distance_m(self, node_id: int) -> float:
        (x, y, _), (node_x, node_y, _) = self._require().slam.T_grid_base, self._pose_of(node_id)
        return float(np.hypot(node_x - x, node_y - y))

    def _sees(self, node_id: int) -> bool:
        now = self._require()
        return in_sight(now.grid, now.slam.T_grid_base, self._pose_of(node_id), self.config)

    def _pose_of(self, node_id: int) -> Pose:
        return self.local.standings[node_id].T_grid_node

    def _associate(self, node_id: int) -> None:
        """Make an existing neighbour the associated node."""
        now = self._require()
        self._associated_id = node_id
        standing = self.local.standings[node_id]
        T_node_base = between(standing.T_grid_node, now.slam.T_grid_base)
        self._drift = _through_window(standing, T_node_base, now.slam)
        self.local.settle(node_id)

    def _create(self) -> None:
        """Make a node here, with its odometry edge and all near-neighbour edges that help."""
        previous_id, T_previous_new, covariance = self._associated_id, self.T_node_base, self._drift
        node_id = self._birth()
        self._join(previous_id, node_id, T_previous_new, covariance + COVARIANCE_FLOOR, EdgeType.ODOMETRY)
        self.local.settle(node_id)
        grid = self._require().grid
        for edge in self._neighbours.edges_for(node_id, self.graph, self.local, grid):
            self.graph.add_edge(edge)
        for listener in self.on_node:
            listener(node_id)

    def _birth(self) -> int:
        now = self._require()
        area_id = self.graph.node(self._associated_id).area_id if self._associated_id else 1
        node = self.graph.add_node(area_id=area_id, level=self.level, created_s=now.slam.stamp_s)
        turn = _turned(-now.slam.T_grid_base[2])
        covariance = turn @ now.slam.covariance @ turn.T
        self.local.anchor(node.node_id, np.array(now.slam.T_grid_base, dtype=np.float64), covariance)
        self._associated_id = node.node_id
        self._drift = np.zeros((3, 3))
        return node.node_id

    def _join(self, a: int, b: int, T_a_b: Pose, covariance: Covariance, kind: EdgeType) -> Edge:
        return self.graph.add_edge(Edge(0, a, b, T_a_b, covariance, kind))

    def _require(self) -> _Now:
        if self._now is None:
            raise NotStarted("the mapper has seen no scan yet")
        return self._now

    # -- what others see ------------------------------------------------------------------------------------

    def view(self, particles: NDArray[np.float64] | None = None) -> MapView:
        """Return an immutable snapshot of the neighbourhood. Raises NotStarted before the first scan."""
        now = self._require()
        names = self.store.names() if self._associated_id else {}
        poses = {node_id: standing.T_grid_node for node_id, standing in self.local.standings.items()}
        return MapView(
            stamp_s=now.slam.stamp_s,
            grid=now.grid,
            T_grid_odom=now.slam.T_grid_odom,
            T_grid_base=now.slam.T_grid_base,
            associated_id=self._associated_id,
            T_grid_node=poses,
            edges=self._edges_in_view(),
            quality=now.slam.quality,
            diversity=now.slam.diversity,
            lost=self.lost,
            particles=particles,
            names={node_id: name for name, node_id in names.items() if node_id in poses},
        )

    def _edges_in_view(self) -> list[tuple[int, int, int, EdgeType]]:
        key = (self.store.version, self._associated_id)
        if self._picture[0] != key:
            standings = self.local.standings
            edges = [
                (edge.edge_id, edge.source_id, edge.target_id, edge.type)
                for node_id in standings
                for edge in self.graph.edges_of(node_id)
                if edge.source_id == node_id and edge.target_id in standings
            ]
            self._picture = (key, edges)
        return self._picture[1]

    def close(self) -> None:
        """Write everything and close the map file; the trail stays readable."""
        if self._now is not None:
            self.store.set_meta("associated_id", self._associated_id)
            self.store.set_meta("T_node_base", " ".join(repr(float(v)) for v in self.T_node_base))
        self.store.close()


def _turned(yaw_rad: float) -> Covariance:
    return adjoint(np.array([0.0, 0.0, yaw_rad]))


def _through_window(standing: Standing, T_node_base: Pose, slam: SlamUpdate) -> Covariance:
    """Return the covariance of T_node_base when both stand in the same window, axes of base."""
    turn = _turned(-slam.T_grid_base[2])
    return chain_covariance(standing.covariance, T_node_base, turn @ slam.covariance @ turn.T)
