"""Ground truth that lies beside a ROS map, as UT Austin's building maps have it: rooms and doors.

`locations.yaml` holds `locations` (names) and `polygons` (flat lists of pixel x, y, origin at the upper
left); `doors.yaml` holds for each door its two corners in metres and the two rooms it is approached from.
"""

from pathlib import Path
from typing import Any

import yaml

from lemtomap.sim.errors import BadWorld
from lemtomap.sim.world import (
    Door,
    GroundTruth,
    Raster,
    Room,
)


def read_truth(folder: Path, raster: Raster) -> GroundTruth:
    """Return rooms and doors, empty when the files are not there. Raises BadWorld when they are damaged."""
    rooms, doors = folder / "locations.yaml", folder / "doors.yaml"
    if not rooms.exists() or not doors.exists():
        return GroundTruth()
    found = _rooms(rooms, raster)
    names = {room.name for room in found}
    return GroundTruth(found, tuple(door for door in _doors(doors) if set(door.rooms) <= names))


def _read(path: Path) -> Any:
    try:
        return yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise BadWorld(f"{path}: not a readable YAML file ({' '.join(str(error).split())})") from error


def _rooms(path: Path, raster: Raster) -> tuple[Room, ...]:
    content = _read(path)
    x0, y0 = raster.origin_m
    top_m = y0 + raster.occupied.shape[0] * raster.resolution_m
    rooms = []
    try:
        for name, flat in zip(content["locations"], content["polygons"], strict=True):
            corners = tuple(
                (x0 + float(px) * raster.resolution_m, top_m - float(py) * raster.resolution_m)
                for px, py in zip(flat[::2], flat[1::2], strict=True)
            )
            rooms.append(Room(str(name), corners))
    except (KeyError, TypeError, ValueError) as error:
        raise BadWorld(f"{path}: locations and polygons do not fit together ({error})") from error
    return tuple(rooms)


def _doors(path: Path) -> list[Door]:
    doors = []
    try:
        for number, entry in enumerate(_read(path)):
            sides = [str(approach["from"]) for approach in entry["approach"]]
            if len(set(sides)) != 2:
                continue  # a lift or an outer door: nothing drawn beyond it
            (ax, ay), (bx, by) = entry["door_corner_pt_1"], entry["door_corner_pt_2"]
            ends = ((float(ax), float(ay)), (float(bx), float(by)))
            doors.append(Door(str(entry.get("name", number)), ends, (sides[0], sides[1])))
    except (KeyError, TypeError, ValueError) as error:
        raise BadWorld(f"{path}: a door lacks its corners or approaches ({error})") from error
    return doors
