"""The robot-centric map: where the nodes near the associated node lie in the window's frame.

A node is *anchored* while the window still holds what was around it when its pose in the window was
measured (at its birth, or by a match of its localisation data). The rest follow from the edges. Nothing here
is ever stored: it is the window's view of the graph, gone with the window.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from lemtomap.se2 import Pose, between, compose
from lemtomap.topo.config import TopoConfig
from lemtomap.topo.file.paging import PagedGraph, Reached
from lemtomap.topo.graph import Covariance, Edge
from lemtomap.topo.kernels import poses as kernels
from lemtomap.topo.solve import Problem, solve_local
from lemtomap.types import GridView

EDGE_MARGIN_M = 1.0  # a node nearer to the window's border than this has lost its surroundings

AGREE_CHI2 = 1e-3  # edges that disagree by less than this need no solve
SOLVE_ITERATIONS = 20  # far more than a warm start takes


@dataclass(frozen=True, slots=True)
class NodePoseEstimate:
    """Where a node stands in the window."""

    T_grid_node: Pose
    covariance: Covariance
    """float64 (3, 3), relative to the window, axes of the node."""
    anchored: bool
    """Measured in this window, rather than predicted by the graph."""
    born: bool = False
    """Made in this window: no match stands behind its pose."""
    found: bool = False
    """Found in this window by a search that did not rely on where the graph has it."""
    measured_m: float = 0.0
    """Way of the robot when it was measured: the longer ago, the more the window drifted since."""
    seen: Covariance | None = None
    """What the window alone says of the pose, the graph's prediction apart; None when it says nothing."""

    def is_within(self, sigma_m: float) -> bool:
        """Return True if its place is known this well in every direction, one standard deviation."""
        return self.sigma_m <= sigma_m

    @property
    def sure(self) -> bool:
        """Whether its place in the window owes nothing to the graph."""
        return self.anchored and (self.born or self.found)

    @property
    def sigma_m(self) -> float:
        """How well its place is known in the worst direction, one standard deviation."""
        return math.sqrt(max(0.0, float(np.linalg.eigvalsh(self.covariance[:2, :2])[-1])))


class LocalMap:
    """Poses of nearby nodes in the grid frame, anchored at the associated node."""

    def __init__(self, graph: PagedGraph, config: TopoConfig) -> None:
        self._graph = graph
        self._config = config
        self._standings: dict[int, NodePoseEstimate] = {}
        self._sure: frozenset[int] | None = None
        """None: a standing has changed since it was asked for."""
        self.reached: dict[int, Reached] = {}
        self.way_m = 0.0
        """Way of the robot so far."""

    @property
    def standings(self) -> Mapping[int, NodePoseEstimate]:
        """Where the nodes of the neighbourhood stand; changed by the methods of this class alone."""
        return self._standings

    def _put(self, node_id: int, standing: NodePoseEstimate) -> None:
        self._standings[node_id] = standing
        self._sure = None

    def forget_all(self) -> None:
        """Begin anew, in another window."""
        self._standings.clear()
        self._sure = None

    def anchor(
        self,
        node_id: int,
        T_grid_node: Pose,
        covariance: Covariance,
        *,
        born: bool = False,
        seen: Covariance | None = None,
    ) -> None:
        """Set a node's pose as measured in this window; `seen` is the covariance of the measurement alone."""
        standing = NodePoseEstimate(
            T_grid_node, covariance, anchored=True, born=born, measured_m=self.way_m, seen=seen
        )
        self._put(node_id, standing)

    def anchor_found(self, node_id: int, T_grid_node: Pose, covariance: Covariance) -> None:
        """Set a node where it was found in this window, unless it was made there."""
        known = self.standings.get(node_id)
        if known is None or not (known.born and known.anchored):
            self.anchor(node_id, T_grid_node, covariance, seen=covariance)
            self._put(node_id, replace(self._standings[node_id], found=True))

    def sure(self) -> frozenset[int]:
        """Return the nodes whose place in the window owes nothing to the graph."""
        if self._sure is None:
            self._sure = frozenset(n for n, standing in self._standings.items() if standing.sure)
        return self._sure

    def doubt(self, node_id: int) -> None:
        """Believe a prediction less: the window did not bear it out.

        Place and heading each have their bound: a place known to a centimetre is doubted many times before it
        comes to its own, and whatever follows along the edges would swing about a heading doubted as often.
        """
        config, standing = self._config, self.standings[node_id]
        place = float(np.trace(standing.covariance[:2, :2])) < 2.0 * config.align_widest_m**2
        heading = float(standing.covariance[2, 2]) < config.align_widest_rad**2
        grown = np.where([place, place, heading], math.sqrt(config.align_widen), 1.0)
        self._put(node_id, replace(standing, covariance=standing.covariance * np.outer(grown, grown)))

    def predicted_near(self, T_grid_base: Pose, within_m: float, sigma_m: float) -> int:
        """Return the nearest node that the graph predicts this well and the window does not hold; 0: none."""
        x, y, _ = T_grid_base.tolist()
        away = [
            (math.hypot(standing.T_grid_node[0] - x, standing.T_grid_node[1] - y), node_id)
            for node_id, standing in self.standings.items()
            if not standing.anchored
        ]
        for away_m, node_id in sorted(away):
            if away_m > within_m:
                break
            if self.standings[node_id].is_within(sigma_m):
                return node_id
        return 0

    def release_matched(self) -> None:
        """Let go of all nodes whose poses rest on matches and closures (one of them proved wrong)."""
        for node_id, standing in self.standings.items():
            if not standing.born:
                self._put(node_id, replace(standing, anchored=False))

    def release_forgotten(self, grid: GridView) -> None:
        """Let go of nodes whose surroundings the window has forgotten."""
        rows, cols = grid.occupancy.shape
        low_x, low_y = (at_m + EDGE_MARGIN_M for at_m in grid.origin_m)
        high_x = grid.origin_m[0] + cols * grid.resolution_m - EDGE_MARGIN_M
        high_y = grid.origin_m[1] + rows * grid.resolution_m - EDGE_MARGIN_M
        for node_id, standing in self.standings.items():
            if not standing.anchored:
                continue
            x, y, _ = standing.T_grid_node.tolist()
            if not (low_x <= x <= high_x and low_y <= y <= high_y):
                self._put(node_id, replace(standing, anchored=False))

    def settle(self, associated_id: int) -> None:
        """Find all nodes within the local radius again and place those that are not anchored by the edges.

        The associated node must stand already. Holds: afterwards `standings` has exactly the nodes reached.
        """
        config = self._config
        self.reached = self._graph.reach(associated_id, config.local_radius_m, config.local_limit)
        settled: dict[int, NodePoseEstimate] = {}
        for node_id, reached in self.reached.items():
            known = self.standings.get(node_id)
            if known is not None and (reached.via is None or (known.anchored and self._is_fresh(known))):
                settled[node_id] = known
            elif reached.via is not None:
                from_id = reached.via.other(node_id)
                before = settled[from_id]
                T_grid_node, covariance = kernels.carried(
                    before.T_grid_node,
                    before.covariance,
                    reached.via.T_source_target,
                    reached.via.covariance,
                    int(reached.via.target_id == from_id),
                )
                settled[node_id] = NodePoseEstimate(T_grid_node, covariance, anchored=False)
        self._standings, self._sure = self._solved(settled), None

    def _is_fresh(self, standing: NodePoseEstimate) -> bool:
        """Return True if a node was measured so lately that the window cannot have drifted away from it."""
        return self.way_m - standing.measured_m <= self._config.fresh_m

    def _solved(self, settled: dict[int, NodePoseEstimate]) -> dict[int, NodePoseEstimate]:
        """Fit the nodes that are not anchored to all edges among them (thesis, Figure 3-7c).

        Composed along the shortest ways they start near the answer; where the edges agree nothing is solved.
        All is done in the frame of the associated node: where the window's frame lies must not show.
        """
        free = [not standing.anchored for standing in settled.values()]
        free[0] = False  # the associated node: the anchor of the whole
        if not any(free):
            return settled
        index = {node_id: k for k, node_id in enumerate(settled)}
        problem = Problem.of_edges(self._edges_among(settled), index)
        grid_poses = np.array([standing.T_grid_node for standing in settled.values()])
        poses = between(grid_poses[0], grid_poses)
        if len(problem.ends) == 0 or problem.chi2(poses) < AGREE_CHI2:
            return settled
        solution = solve_local(problem, poses, ~np.array(free), SOLVE_ITERATIONS)
        solved = compose(grid_poses[0], solution.poses)
        return {
            node_id: NodePoseEstimate(pose, standing.covariance, anchored=False) if loose else standing
            for (node_id, standing), pose, loose in zip(settled.items(), solved, free, strict=True)
        }

    def _edges_among(self, settled: dict[int, NodePoseEstimate]) -> list[Edge]:
        return [
            edge
            for node_id in settled
            for edge in self._graph.edges_of(node_id)
            if edge.source_id == node_id and edge.target_id in settled
        ]
