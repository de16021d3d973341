"""Near-neighbour edges: to every place that can be driven to in a straight line (thesis, section 3-3-2)."""

from collections.abc import Container, Iterator
from dataclasses import replace
from itertools import islice

import numpy as np

from lemtomap.se2 import Pose, between
from lemtomap.topo.config import TopoConfig
from lemtomap.topo.file.paging import PagedGraph, Reached
from lemtomap.topo.graph import Covariance, Edge, chain_covariance
from lemtomap.topo.kernels import sight
from lemtomap.topo.local import LocalMap, NodePoseEstimate
from lemtomap.types import EdgeType, GridView

SEAM_SHARE = 2.0
"""Nodes side by side are apart when the way along the edges is so many times as long as an edge may be."""


OPEN_SIGMAS = 1.5
"""Within so many standard deviations of a doubtful place no wall may stand."""


class NeighbourFinder:
    """Decides which near-neighbour edges a new node gets."""

    def __init__(self, config: TopoConfig) -> None:
        self._config = config

    def edges_for(self, node_id: int, graph: PagedGraph, local: LocalMap, grid: GridView) -> Iterator[Edge]:
        """Iterate over the near-neighbour edges of a node, nearest first; the caller adds each at once.

        A candidate lies within the local radius (D_nn) over edges, stands in the window by measurement or by
        a sure prediction, is on the same level and directly navigable, and the edge shortens the way to it.
        """
        yield from self._edges_to(
            local.standings.keys(), node_id, graph, local, grid, self._config.near_neighbour_sigma_m
        )

    def _edges_to(
        self,
        others: Container[int],
        node_id: int,
        graph: PagedGraph,
        local: LocalMap,
        grid: GridView,
        sigma_m: float,
    ) -> Iterator[Edge]:
        level = graph.node(node_id).level
        here = local.standings[node_id]
        for other_id, line_m in self._candidates(others, node_id, local, sigma_m):
            there = local.standings[other_id]
            if graph.node(other_id).level != level or graph.edge_between(node_id, other_id) is not None:
                continue
            if not self._shortens(node_id, other_id, line_m, graph, local.reached):
                continue
            if directly_navigable(grid, here.T_grid_node, there.T_grid_node, self._config):
                yield self._edge(node_id, other_id, local)

    def seams_at(self, node_id: int, graph: PagedGraph, local: LocalMap, grid: GridView) -> Iterator[Edge]:
        """Give the edge to the nearest node beside a node that is far along the edges, if any.

        Two rounds through one corridor leave two chains of nodes side by side when the second was driven
        before its closure was found, and a bare corridor never tells how far along it the two are apart; nor
        does a hall wider than the laser sees. The robot can go from one to the other all the same; unless an
        edge says so, a route may lead along one chain to its end and back along the other. The edge tells the
        solve nothing: its share is 0.
        """
        config, seam_m = self._config, SEAM_SHARE * self._config.near_neighbour_max_m
        far = {other_id for other_id, reached in local.reached.items() if reached.distance_m > seam_m}
        here = local.standings[node_id]
        if far and _is_sure(here, config.seam_sigma_m):
            edges = self._edges_to(far, node_id, graph, local, grid, config.seam_open_sigma_m)
            seams = (edge for edge in edges if self._is_open(here, local.standings[edge.target_id], grid))
            for seam in islice(seams, 1):
                yield replace(seam, share=0.0)

    def _is_open(self, here: NodePoseEstimate, there: NodePoseEstimate, grid: GridView) -> bool:
        """Return True if the robot could go from one to the other wherever the other may truly be."""
        if _is_sure(there, self._config.seam_sigma_m):
            return True
        wide = replace(self._config, robot_radius_m=self._config.robot_radius_m + OPEN_SIGMAS * there.sigma_m)
        return directly_navigable(grid, here.T_grid_node, there.T_grid_node, wide)

    def _candidates(
        self, others: Container[int], node_id: int, local: LocalMap, sigma_m: float
    ) -> list[tuple[int, float]]:
        x, y = local.standings[node_id].T_grid_node[:2]
        found = []
        for other_id, standing in local.standings.items():
            line_m = round(float(np.hypot(standing.T_grid_node[0] - x, standing.T_grid_node[1] - y)), 6)
            is_near = other_id != node_id and line_m <= self._config.near_neighbour_max_m
            if is_near and other_id in others and _is_sure(standing, sigma_m):
                found.append((other_id, line_m))
        return sorted(found, key=lambda candidate: (candidate[1], candidate[0]))

    def _shortens(
        self, node_id: int, other_id: int, line_m: float, graph: PagedGraph, reached: dict[int, Reached]
    ) -> bool:
        """Return True if the straight line beats the way over edges, those just added included."""
        way_m = reached[other_id].distance_m
        for edge in graph.edges_of(node_id):
            onward = graph.edge_between(edge.other(node_id), other_id)
            if onward is not None:
                way_m = min(way_m, edge.length_m + onward.length_m)
        return way_m > (1.0 + self._config.near_neighbour_gain) * line_m

    def _edge(self, node_id: int, other_id: int, local: LocalMap) -> Edge:
        here, there = local.standings[node_id], local.standings[other_id]
        T_node_other = between(here.T_grid_node, there.T_grid_node)
        covariance = chain_covariance(here.covariance, T_node_other, there.covariance)
        share = independent_share(covariance, _chain(other_id, local.reached)) if there.anchored else 0.0
        return Edge(0, node_id, other_id, T_node_other, covariance, EdgeType.NEAR_NEIGHBOUR, share)


def _is_sure(standing: NodePoseEstimate, sigma_m: float) -> bool:
    """Return True if a node stands in the window by measurement, or is predicted well enough."""
    return standing.anchored or standing.is_within(sigma_m)


def directly_navigable(grid: GridView, start: Pose, end: Pose, config: TopoConfig) -> bool:
    """Return True if the robot can go straight between two places in the window; unknown cells say no."""
    x, y = grid.origin_m
    line = (start[0] - x, start[1] - y, end[0] - x, end[1] - y)
    limits = (config.robot_radius_m, config.occupied_from)
    return bool(sight.line_is_navigable(grid.occupancy, grid.resolution_m, *line, *limits))


def in_sight(grid: GridView, start: Pose, end: Pose, config: TopoConfig) -> bool:
    """Return True if no wall stands between two places in the window."""
    x, y = grid.origin_m
    line = (start[0] - x, start[1] - y, end[0] - x, end[1] - y)
    return bool(sight.line_is_clear(grid.occupancy, grid.resolution_m, *line, config.occupied_from))


def independent_share(measured: Covariance, chain: Covariance) -> float:
    """Return how much of a window measurement the edges between its ends do not already hold, 0..1.

    Both come from the same matches, so only information beyond the chain's may count: the largest s with
    s * measured^-1 <= measured^-1 - chain^-1.
    """
    worst = float(np.max(np.real(np.linalg.eigvals(np.linalg.solve(chain, measured)))))
    return min(1.0, max(0.0, 1.0 - worst))


def _chain(node_id: int, reached: dict[int, Reached]) -> Covariance:
    """Return the covariance of a reached node relative to the start of the search, along the way there."""
    way: list[Edge] = []
    while (via := reached[node_id].via) is not None:
        way.append(via)
        node_id = via.other(node_id)
    covariance = np.zeros((3, 3))
    for edge in reversed(way):
        covariance = chain_covariance(covariance, edge.seen_from(node_id), edge.covariance_from(node_id))
        node_id = edge.other(node_id)
    return covariance
