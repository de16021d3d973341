"""Ground truth that lies beside a ROS map, as UT Austin's building maps have it: rooms and doors.

`locations.yaml` holds `locations` (names) and `polygons` (flat lists of pixel x, y, origin at the upper
left); `doors.yaml` holds for each door its two corners in metres and the two rooms it is approached from.
"""

from pathlib import Path
from typing import Any

from lemtomap.sim.errors import BadWorld, shown
from lemtomap.sim.text_file import read_yaml
from lemtomap.sim.world import Door, GroundTruth, Room

Point = tuple[float, float]
FAR = 1e5  # pixels or metres


def read_truth(folder: Path, upper_left_m: Point, resolution_m: float) -> GroundTruth:
    """Return rooms and doors, empty when the files are not there. Raises BadWorld when they are damaged."""
    rooms, doors = folder / "locations.yaml", folder / "doors.yaml"
    if not rooms.exists() or not doors.exists():
        return GroundTruth()
    found = _rooms(rooms, upper_left_m, resolution_m)
    names = {room.name for room in found}
    return GroundTruth(found, tuple(door for door in _doors(doors) if set(door.rooms) <= names))


def _rooms(path: Path, upper_left_m: Point, resolution_m: float) -> tuple[Room, ...]:
    content = read_yaml(path)
    left_m, top_m = upper_left_m
    rooms = []
    try:
        for name, flat in zip(content["locations"], content["polygons"], strict=True):
            corners = [
                (left_m + px * resolution_m, top_m - py * resolution_m) for px, py in _corners(name, flat)
            ]
            rooms.append(Room(str(name), tuple(corners)))
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise BadWorld(f"{path}: locations and polygons do not fit together ({error})") from error
    return tuple(rooms)


def _corners(name: object, flat: Any) -> list[Point]:
    """Return the corners of a room, pixels. Raises ValueError."""
    corners = [(_coordinate(px), _coordinate(py)) for px, py in zip(flat[::2], flat[1::2], strict=True)]
    if len(corners) < 3:
        raise ValueError(f"room {shown(name)} has {len(corners)} corners")
    return corners


def _doors(path: Path) -> list[Door]:
    doors = []
    try:
        for number, entry in enumerate(read_yaml(path)):
            sides = [str(approach["from"]) for approach in entry["approach"]]
            if len(set(sides)) != 2:
                continue  # a lift or an outer door: nothing drawn beyond it
            (ax, ay), (bx, by) = entry["door_corner_pt_1"], entry["door_corner_pt_2"]
            ends = ((_coordinate(ax), _coordinate(ay)), (_coordinate(bx), _coordinate(by)))
            doors.append(Door(str(entry.get("name", number)), ends, (sides[0], sides[1])))
    except (KeyError, TypeError, ValueError, OverflowError, AttributeError) as error:
        raise BadWorld(f"{path}: a door lacks its corners or approaches ({error})") from error
    return doors


def _coordinate(value: Any) -> float:
    number = float(value)
    if not abs(number) <= FAR:
        raise ValueError(f"{shown(value)} is no coordinate of a building")
    return number
