"""What a picture says of areas and doors, apart from what draws it."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lemtomap.areas.book import AreaBook
from lemtomap.areas.topology import areas_in
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.naming import shown

LABEL = 30  # characters of an area's name in a picture


@dataclass(frozen=True, slots=True)
class Painting:
    """What a picture says of areas."""

    area_of: Mapping[int, int]
    """Area of each node."""
    labels: Mapping[int, str]
    """What stands at each area that has nodes: its ID, and its name if it has one."""
    doors: Mapping[int, tuple[int, NDArray[np.float64], bool]]
    """Of each door its node, both ends in that node's frame, float64 (2, 2), and whether it was shut."""

    @classmethod
    def of(cls, store: TopoStore) -> "Painting":
        """Return what is to be painted of a map; nothing for one without areas."""
        areas = areas_in(store)
        return cls(
            {node_id: each.area.area_id for each in areas for node_id in each.nodes},
            {
                each.area.area_id: shown(f"{each.area.area_id} {each.area.name}".strip(), LABEL)
                for each in areas
            },
            {door.door_id: (door.node, door.ends(), door.is_shut) for door in AreaBook(store).doors()},
        )
