"""What a picture says of areas and doors, apart from what draws it."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lemtomap.areas.book import AreaBook
from lemtomap.areas.topology import areas_in
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.naming import shown

COLOURS = (
    "#1f77b4", "#ff7f0e", "#2ca02c", "#d62728", "#9467bd", "#8c564b", "#e377c2", "#7f7f7f", "#bcbd22",
    "#17becf", "#393b79", "#637939", "#8c6d31", "#843c39", "#7b4173", "#3182bd", "#e6550d", "#31a354",
    "#756bb1", "#636363",
)  # fmt: skip
STEP = 7  # through the colours: areas that follow one another look different
LABEL = 30  # characters of an area's name in a picture


def colour_of(area_id: int) -> str:
    """Return the colour of an area, the same in every picture; grey for none."""
    return COLOURS[area_id * STEP % len(COLOURS)] if area_id > 0 else "#b0b0b0"


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
