"""Topological localisation (thesis, Figure 3-4): at a node, and at a pose relative to it.

The pose relative to the node follows from the local grid map transform, that is from where the associated
node stands in the window: known all along since its birth, or measured by matching its localisation data.
"""

import math
from dataclasses import dataclass

import numpy as np

from lemtomap.displacement import WatchConfig, pose_quality
from lemtomap.errors import NotStarted
from lemtomap.se2 import Pose, between
from lemtomap.topo.config import TopoConfig
from lemtomap.topo.doubt import COVARIANCE_FLOOR, relative_to_window
from lemtomap.topo.graph import Covariance, chain_covariance
from lemtomap.topo.keeper import PlaceKeeper
from lemtomap.topo.kernels import poses as kernels
from lemtomap.topo.local import LocalMap
from lemtomap.topo.neighbours import in_sight
from lemtomap.types import GridView, SlamUpdate


@dataclass(frozen=True, slots=True)
class Transform:
    """How the local grid map transform of the associated node is known (thesis, section 3-3-2)."""

    measured: bool
    """False: the graph's prediction stands in."""
    covariance: Covariance
    """float64 (3, 3), axes of the node."""
    score: float = 1.0
    reason: str = ""
    """Why it is not measured."""


@dataclass(slots=True)
class Now:
    """What the last scan said."""

    slam: SlamUpdate
    grid: GridView
    fit: float
    """How well it fits the window, as a share of what is usual."""


class Localisation:
    """The associated node and the robot's pose relative to it."""

    def __init__(self, config: TopoConfig, local: LocalMap, keeper: PlaceKeeper) -> None:
        self.associated_id = 0
        """The node the robot is at; 0 before the first scan."""
        self.transform = Transform(measured=True, covariance=np.zeros((3, 3)))
        """How the associated node's pose in the window is known."""
        self.covariance: Covariance = np.zeros((3, 3))
        """float64 (3, 3) of T_node_base, axes of the base."""
        self.travelled_m = 0.0
        """Way of the base since the start, metres."""
        self.turned_rad = 0.0
        """Turning of the base since the start, either way."""
        self.last: Now | None = None
        """None before the first scan of a window."""
        self._config, self._local, self._keeper = config, local, keeper
        self._tried_m = 0.0

    @property
    def now(self) -> Now:
        """What the last scan said. Raises NotStarted."""
        if self.last is None:
            raise NotStarted("the mapper has seen no scan yet")
        return self.last

    @property
    def T_node_base(self) -> Pose:  # noqa: N802 - a frame's name
        """Where the robot is relative to the associated node."""
        return between(self._pose_of(self.associated_id), self.now.slam.T_grid_base)

    def distance_m(self, node_id: int) -> float:
        """Return how far a node of the neighbourhood is from the robot."""
        return self.gap_m(self._pose_of(node_id))

    def gap_m(self, T_grid_node: Pose) -> float:
        """Return how far a pose in the window is from the robot."""
        x, y, _ = (T_grid_node - self.now.slam.T_grid_base).tolist()
        return math.hypot(x, y)

    def sees(self, node_id: int) -> bool:
        """Return True if no wall hides a node of the neighbourhood from the robot."""
        now = self.now
        return in_sight(now.grid, now.slam.T_grid_base, self._pose_of(node_id), self._config)

    def move(self, before: SlamUpdate) -> None:
        """Let the doubt about T_node_base grow by the motion since the previous scan."""
        slam = self.now.slam
        from_base, to_base = before.T_grid_base, slam.T_grid_base
        self.covariance = kernels.drifted(self.covariance, from_base, to_base, slam.step_covariance)
        self.travelled_m += math.hypot(to_base[0] - from_base[0], to_base[1] - from_base[1])
        self.turned_rad += abs(math.remainder(to_base[2] - from_base[2], math.tau))
        self._local.way_m = self.travelled_m

    def begin_at(self, node_id: int) -> None:
        """Stand at a node that is made where the robot is now."""
        slam = self.now.slam
        covariance = relative_to_window(slam)
        T_grid_node = np.array(slam.T_grid_base, dtype=np.float64)
        self._local.anchor(node_id, T_grid_node, covariance, born=True, seen=COVARIANCE_FLOOR)
        self.associated_id = node_id
        self.covariance = np.zeros((3, 3))
        self.transform = Transform(measured=True, covariance=covariance)

    def stand_at(self, node_id: int) -> None:
        """Stand at a known node; measure its place in the window, unless that has known it all along."""
        self.associated_id = node_id
        standing = self._local.standings[node_id]
        self._tried_m = self.travelled_m
        if standing.anchored:
            self.transform = Transform(measured=True, covariance=standing.covariance)
        else:
            self.transform = self._measured(node_id)
            if not self.transform.measured:
                self._local.doubt(node_id)
        standing = self._local.standings[node_id]
        seen = relative_to_window(self.now.slam)
        self.covariance = chain_covariance(standing.covariance, self.T_node_base, seen)
        self._local.settle(node_id)

    def try_again(self) -> None:
        """Measure the place of the associated node once more, some way after a match was refused."""
        way_m = self.travelled_m - self._tried_m
        if not self.transform.measured and way_m > self._config.align_again_m:
            self.stand_at(self.associated_id)

    def anchor_beside(self) -> None:
        """Match the nearest well-predicted node that the window does not hold, so that edges may join it."""
        at, config = self.now.slam.T_grid_base, self._config
        beside_id = self._local.predicted_near(at, config.near_neighbour_max_m, config.implicit_sigma_m)
        if beside_id and self._measured(beside_id).measured:
            self._local.settle(self.associated_id)

    def own_nearest(self) -> int:
        """Return the nearest node born in this window, 0 when it holds none."""
        own = [n for n, standing in self._local.standings.items() if standing.born and standing.anchored]
        return min(own, key=self.distance_m, default=0)

    def quality(self, config: WatchConfig) -> float:
        """Return how likely T_node_base is right, 0 to 1."""
        born, measured = self._local.standings[self.associated_id].born, self.transform.measured
        return pose_quality(self.covariance, self.now.fit, born=born, measured=measured, config=config)

    def _measured(self, node_id: int) -> Transform:
        """Match one node's localisation data with the window and anchor it there when it fits."""
        standing = self._local.standings[node_id]
        match = self._keeper.align(node_id, standing, self.now.grid)
        if match is None:
            return Transform(measured=False, covariance=standing.covariance, score=0.0, reason="no data")
        if match.refused:
            return Transform(False, standing.covariance, match.score, match.refused)
        self._local.anchor(node_id, match.T_grid_node, match.covariance)
        return Transform(measured=True, covariance=match.covariance, score=match.score)

    def _pose_of(self, node_id: int) -> Pose:
        return self._local.standings[node_id].T_grid_node
