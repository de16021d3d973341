"""Where the robot stood when a map was closed: a node, and the pose relative to it."""

import numpy as np

from lemtomap.se2 import Pose
from lemtomap.topo.store import TopoStore


def last_stand(store: TopoStore) -> tuple[int, Pose] | None:
    """Return the node and T_node_base, float64 (3,); None when the map does not say or the node is gone."""
    node_id, text = store.meta("associated_id"), store.meta("T_node_base")
    if node_id is None or text is None or store.node(int(node_id)) is None:
        return None
    return int(node_id), np.array([float(value) for value in str(text).split()])


def put_last_stand(store: TopoStore, node_id: int, T_node_base: Pose) -> None:
    """Write down where the robot stands."""
    store.set_meta("associated_id", node_id)
    store.set_meta("T_node_base", " ".join(repr(float(value)) for value in T_node_base))
