"""The map as one picture: every node and every scan placed in one frame, for export only.

Nothing in here is used while driving: the map itself knows no such frame.
"""

from collections import defaultdict, deque
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lemtomap.se2 import IDENTITY, Pose, compose, inverse
from lemtomap.topo.graph import Edge
from lemtomap.topo.mapper import TopoMapper
from lemtomap.topo.solve import Problem, solve_whole
from lemtomap.topo.store import TopoStore
from lemtomap.types import EdgeType


@dataclass(frozen=True, slots=True)
class FinalMap:
    """All of a drive in one frame: that of the first node."""

    T_map_node: Mapping[int, Pose]
    edges: list[tuple[int, int, EdgeType]]
    stamps_s: NDArray[np.float64]
    """float64 (scans,), in the order of the drive."""
    T_map_base: Pose
    """float64 (scans, 3)."""
    T_map_grid: Pose
    """Where the last window lies, float64 (3,)."""

    def edges_by_type(self) -> dict[str, int]:
        """Return how many edges there are of each type."""
        kinds = [kind for _, _, kind in self.edges]
        return {kind.value: kinds.count(kind) for kind in EdgeType}

    def path_m(self) -> float:
        """Return the length of the driven path, metres."""
        steps = np.diff(self.T_map_base[:, :2], axis=0)
        return float(np.hypot(steps[:, 0], steps[:, 1]).sum())


def final_map(mapper: TopoMapper) -> FinalMap:
    """Place everything the mapper knows; needs at least one scan."""
    T_map_node = place_nodes(mapper.store)
    records = np.concatenate(list(mapper.trail.records()))
    anchors = np.array([T_map_node[int(node_id)] for node_id in records["node_id"]])
    view = mapper.view()
    T_grid_here = view.T_grid_node[view.associated_id]
    return FinalMap(
        T_map_node=T_map_node,
        edges=[(edge.source_id, edge.target_id, edge.type) for edge in mapper.store.edges()],
        stamps_s=records["stamp_s"].copy(),
        T_map_base=compose(anchors, records["T_node_base"]),
        T_map_grid=compose(T_map_node[view.associated_id], inverse(T_grid_here)),
    )


def place_nodes(store: TopoStore) -> dict[int, Pose]:
    """Return T_map_node of every node by one full solve; each component's first at the origin."""
    edges = list(store.edges())
    placed, roots = _chained([node.node_id for node in store.nodes()], edges)
    ids = list(placed)
    index = {node_id: k for k, node_id in enumerate(ids)}
    start = np.array([placed[node_id] for node_id in ids]).reshape(-1, 3)
    problem = Problem.of_edges(edges, index)
    if len(problem.ends) < len(ids):  # a tree holds nothing that could disagree
        return placed
    solution = solve_whole(problem, start, np.isin(ids, list(roots)))
    return dict(zip(ids, solution.poses, strict=True))


def _chained(ids: list[int], edges: list[Edge]) -> tuple[dict[int, Pose], set[int]]:
    """Return poses along driven edges as far as they go, then any; and each component's first node."""
    at: defaultdict[int, list[Edge]] = defaultdict(list)
    for edge in sorted(edges, key=lambda edge: edge.type is not EdgeType.ODOMETRY):
        at[edge.source_id].append(edge)
        at[edge.target_id].append(edge)
    placed: dict[int, Pose] = {}
    roots: set[int] = set()
    for root in ids:
        if root in placed:
            continue
        placed[root] = IDENTITY
        roots.add(root)
        queue = deque([root])
        while queue:
            here = queue.popleft()
            for edge in at[here]:
                other = edge.other(here)
                if other not in placed:
                    placed[other] = compose(placed[here], edge.seen_from(here))
                    queue.append(other)
    return placed, roots
