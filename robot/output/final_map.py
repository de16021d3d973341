"""The map as one picture: every node and every scan placed in one frame, for export only.

Nothing in here is used while driving: the map itself knows no such frame. What solves it is imported only
then, for it brings sparse matrices with it that a robot has no use for.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lemtomap.se2 import (
    Pose,
    between,
    compose,
    inverse,
)
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.mapper import TopoMapper
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


def final_map(mapper: TopoMapper, *, whole_drive: bool = True) -> FinalMap:
    """Place everything the mapper knows; needs at least one scan.

    `whole_drive`: the map began empty with this drive, so that every scan may be fitted, not only every node.
    """
    from lemtomap.topo.whole.layout import lay_out, trajectory  # noqa: PLC0415 - as above
    from lemtomap.topo.whole.smooth import smooth  # noqa: PLC0415 - as above

    view = mapper.view()
    if whole_drive:
        smoothed = smooth(mapper.store, mapper.trail)
        stamps_s, T_map_base = smoothed.stamps_s, smoothed.T_map_base
        T_map_node = _with_the_rest(mapper.store, smoothed.T_map_node)
    else:
        layout = lay_out(mapper.store)
        T_map_node = layout.T_map_node
        stamps_s, T_map_base = trajectory(layout, mapper.trail)
    here = view.associated_id
    return FinalMap(
        T_map_node=T_map_node,
        edges=[(edge.source_id, edge.target_id, edge.type) for edge in mapper.store.edges()],
        stamps_s=stamps_s,
        T_map_base=T_map_base,
        T_map_grid=compose(T_map_node[here], inverse(view.T_grid_node[here])),
    )


def map_on_path(mapper: TopoMapper, T_grid_base: Pose) -> FinalMap:
    """Place everything on the path of a metric layer that keeps the whole of it and closes its own loops:
    float64 (scans, 3), in the order of the drive.
    """
    records = np.concatenate(list(mapper.trail.records()))
    ids, first = np.unique(records["node_id"], return_index=True)
    nodes = compose(T_grid_base[first], inverse(records["T_node_base"][first]))
    return FinalMap(
        T_map_node=_with_the_rest(mapper.store, dict(zip(ids.tolist(), nodes, strict=True))),
        edges=[(edge.source_id, edge.target_id, edge.type) for edge in mapper.store.edges()],
        stamps_s=records["stamp_s"].copy(),
        T_map_base=T_grid_base,
        T_map_grid=np.zeros(3),
    )


def _with_the_rest(store: TopoStore, placed: Mapping[int, Pose]) -> dict[int, Pose]:
    """Return all nodes of the store: those no scan belongs to follow from the edges."""
    everything = dict(placed)
    ids = [node.node_id for node in store.nodes()]
    if all(node_id in placed for node_id in ids):
        return everything
    from lemtomap.topo.whole.layout import lay_out  # noqa: PLC0415 - as above

    layout = lay_out(store)
    anchors = {layout.component[node_id]: node_id for node_id in placed if node_id in layout.component}
    for node_id in ids:
        anchor = anchors.get(layout.component[node_id])
        if node_id not in placed and anchor is not None:
            T_anchor_node = between(layout.T_map_node[anchor], layout.T_map_node[node_id])
            everything[node_id] = compose(placed[anchor], T_anchor_node)
        elif node_id not in placed:
            everything[node_id] = layout.T_map_node[node_id]
    return everything
