"""What the mapper tells whoever divides the map into areas (thesis, section 3-3-2, area segmentation)."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lemtomap.se2 import Pose
from lemtomap.topo.file.paging import PagedGraph
from lemtomap.topo.local import NodePoseEstimate
from lemtomap.types import GridView

UNASSIGNED = 0
"""Area of a node between its birth and the same scan's segmentation."""


@dataclass(frozen=True, slots=True)
class Neighbourhood:
    """Where the robot and the nodes around it are in the window, after one scan."""

    here_id: int
    """The associated node."""
    T_grid_base: Pose
    travelled_m: float
    stamp_s: float
    grid: GridView
    standings: Mapping[int, NodePoseEstimate]
    occupied_from: int
    """Occupancy of `grid` that counts as an obstacle."""
    level: int


class Segmenter(Protocol):
    """Divides the map into areas as it grows."""

    def attach(self, graph: PagedGraph) -> None:
        """Work on this map from now on."""
        ...

    def update(self, around: Neighbourhood) -> None:
        """Look at the surroundings after a scan, and give nodes their areas."""
        ...

    area_of: Mapping[int, int]
    """Area of each node around, at the last look."""
    doors_grid: Mapping[int, NDArray[np.float64]]
    """Both ends of each door around, float64 (2, 2), metres, in the window at the last look."""
