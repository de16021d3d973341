"""The whole map laid out in one frame, by one full solve: for exports and pictures, never for driving.

Each connected component is laid out around its own first node; components that were never joined have no
relation, so the second and later ones are set beside the first.
"""

from collections import defaultdict, deque
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lemtomap.se2 import IDENTITY, Pose, compose
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.graph import Edge
from lemtomap.topo.solve import Problem, Solution
from lemtomap.topo.solve.whole import solve_whole
from lemtomap.topo.whole.trail import ScanTrail
from lemtomap.types import EdgeType

GAP_M = 10.0  # between components laid side by side


@dataclass(frozen=True, slots=True)
class Layout:
    """Every node in one frame, that of the first node; approximate beyond the reach of a local solve."""

    T_map_node: dict[int, Pose]
    component: dict[int, int]
    """First node of the component each node belongs to."""
    chi2: float


def lay_out(store: TopoStore) -> Layout:
    """Place all nodes so that the edges fit best."""
    return lay_out_edges((node.node_id for node in store.nodes()), list(store.edges()))


def lay_out_edges(node_ids: Iterable[int], edges: list[Edge]) -> Layout:
    """Place nodes so that these edges fit best. Holds: where no edges disagree, the edges fit exactly."""
    start, component = _along_tree(list(node_ids), edges)
    ids = list(start)
    index = {node_id: k for k, node_id in enumerate(ids)}
    poses = np.array([start[node_id] for node_id in ids]).reshape(-1, 3)
    held = np.array([component[node_id] == node_id for node_id in ids], dtype=bool)
    solution = _solved(edges, index, poses, held)
    placed = _side_by_side(np.array([component[node_id] for node_id in ids]), solution.poses)
    return Layout(dict(zip(ids, placed, strict=True)), component, solution.chi2)


def _solved(edges: list[Edge], index: dict[int, int], poses: Pose, held: NDArray[np.bool_]) -> Solution:
    """Return the better of two robust solutions: from the driven way, and from all edges believed at once.

    Metres of drift make true closures look like wrong ones from the first start, one wrong closure spoils
    the second; neither start is right for every map.
    """
    problem = Problem.of_edges(edges, index)
    if not len(problem.ends):
        return Solution(poses, 0.0, 0, True)
    believed = solve_whole(Problem.of_edges(edges, index, robust=False), poses, held).poses
    return min((solve_whole(problem, start, held) for start in (poses, believed)), key=lambda s: s.chi2)


def trajectory(layout: Layout, trail: ScanTrail) -> tuple[NDArray[np.float64], Pose]:
    """Return stamps, float64 (N,), s, and T_map_base, float64 (N, 3), of every scan in the order it came."""
    stamps, poses = [np.zeros(0)], [np.zeros((0, 3))]
    for records in trail.records():
        nodes = np.array([layout.T_map_node[node_id] for node_id in records["node_id"].tolist()])
        stamps.append(records["stamp_s"])
        poses.append(compose(nodes, records["T_node_base"]))
    return np.concatenate(stamps), np.concatenate(poses)


def _along_tree(node_ids: list[int], edges: list[Edge]) -> tuple[dict[int, Pose], dict[int, int]]:
    """Return poses along driven edges as far as they go, then along any, and each node's component."""
    at: defaultdict[int, list[Edge]] = defaultdict(list)
    for edge in edges:
        at[edge.source_id].append(edge)
        at[edge.target_id].append(edge)
    poses: dict[int, Pose] = {}
    component: dict[int, int] = {}
    for root in node_ids:
        if root in poses:
            continue
        poses[root], component[root] = IDENTITY, root
        driven, reached = deque([root]), deque([root])
        while driven or reached:
            only_driven = bool(driven)
            here = driven.popleft() if only_driven else reached.popleft()
            for edge in at[here]:
                other = edge.other(here)
                if other in poses or (only_driven and edge.type is not EdgeType.ODOMETRY):
                    continue
                poses[other] = compose(poses[here], edge.seen_from(here))
                component[other] = root
                driven.append(other)
                reached.append(other)
    return poses, component


def _side_by_side(component: NDArray[np.int64], poses: Pose) -> Pose:
    placed = np.array(poses)
    right_m: float | None = None
    for root in dict.fromkeys(component.tolist()):
        mine = component == root
        if right_m is not None:
            placed[mine, 0] += right_m + GAP_M - placed[mine, 0].min()
        right_m = float(placed[mine, 0].max())
    return placed
