"""What a map's places are, in lines for a person who was not there: areas, doors, named nodes."""

from collections.abc import Iterator

import numpy as np

from lemtomap.areas.book import AreaBook
from lemtomap.areas.model import MappedDoor
from lemtomap.areas.topology import AreaSummary, areas_in, kind_of
from lemtomap.se2 import Pose
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.naming import listed
from lemtomap.topo.whole.layout import lay_out

SHOWN = 12  # numbers in one line


def places(store: TopoStore) -> Iterator[str]:
    """Yield a line for each area, then for each door, then the named nodes."""
    areas, doors = areas_in(store), AreaBook(store).doors()
    if not areas:
        yield "no areas yet: `lemtomap edit MAP area find`, or the next drive, finds them"
    at = lay_out(store).T_map_node
    for each in areas:
        yield _area(each, at)
    for door in doors:
        yield _door(door, areas)
    for name, node_id in sorted(store.names().items()):
        yield f"node {node_id:<5} {listed(name)}"


def _area(each: AreaSummary, at: dict[int, Pose]) -> str:
    area = each.area
    points = np.array([at[k][:2] for k in each.nodes])
    width, depth = np.ptp(points, axis=0).tolist()
    told = [
        f"area {area.area_id:<5} {listed(area.name) if area.name else '-'}",
        f"{kind_of(area, at, each.nodes)}, level {area.level}, driven {width:.0f} x {depth:.0f} m",
        f"doors {_some(each.doors)}",
        f"next to {_some(each.neighbours)}",
        f"nodes {_some(each.nodes)}",
    ]
    also = [*map(listed, area.other_names), *map(str, area.aliases)]
    return "; ".join(told + ([f"was also {', '.join(also)}"] if also else []))


def _door(door: MappedDoor, areas: list[AreaSummary]) -> str:
    beside = [each.area.area_id for each in areas if door.door_id in each.doors]
    state = "shut when last seen" if door.is_shut else "open"
    told = f"door {door.door_id:<5} {door.width_m:.2f} m wide, at node {door.node}; between {_some(beside)}"
    return f"{told}; {state}; seen open {door.seen_open} times, shut {door.seen_shut}, passed {door.passed}"


def _some(numbers: tuple[int, ...] | list[int]) -> str:
    if not numbers:
        return "none"
    more = f" and {len(numbers) - SHOWN} more" if len(numbers) > SHOWN else ""
    return ", ".join(map(str, numbers[:SHOWN])) + more
