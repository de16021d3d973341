"""Whether the places that a mission names are in the map: asked before anything is opened or moves."""

from collections.abc import Callable, Container, Iterator, Mapping
from pathlib import Path

from lemtomap.areas.book import AreaBook
from lemtomap.errors import BadSetting
from lemtomap.topo import naming
from lemtomap.topo.file.store import TopoStore

GOTO, AREA = "goto:", "area:"
ALWAYS_THERE = ("here", "start", "far")
MAKES_NODES = ("explore", "tour")  # missions on which the map may grow


def check_places(mission: str, map_path: Path | None) -> None:
    """Raise BadSetting when a mission goes to a place that its map does not have, BadMap for a bad map.

    None, or a file that is not there yet: a new map, which has no names. What a mission explores before it
    goes somewhere may bring any number, but no name.
    """
    if map_path is None or not map_path.exists():
        _check(mission, "a new map", {}, lambda _: False)
        return
    with TopoStore.view(map_path) as store:
        names = store.names() | AreaBook(store).names()
        areas = {f"{AREA}{area}": area for area in AreaBook(store).numbers()}
        _check(mission, str(map_path), names, lambda node_id: store.node(node_id) is not None, areas)


def mission_from(mission: str, map_path: Path | None) -> str:
    """Return what to do in a simulated building: on no map, see it before going anywhere in it."""
    return f"explore,{mission}" if mission.startswith(GOTO) and map_path is None else mission


def _check(
    mission: str,
    where: str,
    names: Mapping[str, int],
    has_node: Callable[[int], bool],
    areas: Container[str] = (),
) -> None:
    for place, explored in _places(mission):
        number = naming.number(place.removeprefix(AREA))
        will_be_there = place in ALWAYS_THERE or (explored and number is not None)
        is_node = number is not None and not place.startswith(AREA) and has_node(number)
        if not (will_be_there or is_node or place in names or place in areas):
            instead = naming.told_instead(place, names)
            raise BadSetting(f"{where}: there is no place '{naming.shown(place)}' ({instead})")


def _places(mission: str) -> Iterator[tuple[str, bool]]:
    """Iterate over the places a mission goes to, and whether it may have made nodes before."""
    explored = False
    for part in (each.strip() for each in mission.split(",")):
        explored = explored or part in MAKES_NODES
        if part.startswith(GOTO) and part != GOTO:
            yield part.removeprefix(GOTO), explored
