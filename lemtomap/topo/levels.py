"""Levels of a building: a lift or ramp is an odometry edge between nodes of two levels."""

from dataclasses import dataclass, replace
from typing import Self

from lemtomap.se2 import (
    Pose,
    between,
    compose,
    inverse,
)
from lemtomap.topo.file.paging import PagedGraph
from lemtomap.topo.graph import Covariance, Edge
from lemtomap.types import EdgeType, SlamUpdate


@dataclass(frozen=True, slots=True)
class LevelDeparture:
    """Where the robot left a level; odometry goes on while the window begins anew."""

    node_id: int
    T_node_odom: Pose
    covariance: Covariance
    """Of T_node_base there, float64 (3, 3), axes of the base."""

    @classmethod
    def left(cls, node_id: int, T_node_base: Pose, covariance: Covariance, slam: SlamUpdate) -> Self:
        """Leave a level from beside a node."""
        return cls(node_id, compose(T_node_base, inverse(_odometry(slam))), covariance)

    def edge_to(self, node_id: int, slam: SlamUpdate, floor: Covariance) -> Edge:
        """Return the edge to the first node of the other level, made where the robot is at this scan."""
        T_lift_new = compose(self.T_node_odom, _odometry(slam))
        return Edge(0, self.node_id, node_id, T_lift_new, self.covariance + floor, EdgeType.ODOMETRY)


def put_on_level(graph: PagedGraph, since_id: int, level: int) -> None:
    """Put a node and all made after it on a level."""
    for node in list(graph.store.nodes(since_id)):
        graph.put_node(replace(node, level=level))


def _odometry(slam: SlamUpdate) -> Pose:
    """Return T_odom_base."""
    return between(slam.T_grid_odom, slam.T_grid_base)
