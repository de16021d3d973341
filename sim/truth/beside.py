"""Ground truth that lies beside a ROS map.

`locations.yaml` holds `locations` (names) and `polygons` (flat lists of pixel x, y, origin at the upper
left), or `rooms.png` is an image of labels, 0 for no room; `rooms.json` tells their types. `doors.yaml` holds
each door's two corners in metres and the two rooms it joins; `places.yaml` named points and lifts.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from lemtomap.sim.errors import BadWorld, shown
from lemtomap.sim.plan_image import read_labels
from lemtomap.sim.text_file import read_text, read_yaml
from lemtomap.sim.truth.model import Doorway, GroundTruth, LabelImage, Lift, Point, Room

T = TypeVar("T")
FAR = 1e5  # pixels or metres
DAMAGE = (KeyError, TypeError, ValueError, OverflowError, AttributeError, IndexError)


@dataclass(frozen=True, slots=True)
class PlanFrame:
    """How the image of a plan lies in the world before it is turned."""

    lower_left_m: Point
    resolution_m: float
    rows: int
    cols: int

    def point(self, px: float, py: float) -> Point:
        """Return a pixel's place in metres; pixels count from the upper left."""
        (left_m, low_m), step = self.lower_left_m, self.resolution_m
        return left_m + px * step, low_m + (self.rows - py) * step


def read_truth(folder: Path, frame: PlanFrame) -> GroundTruth:
    """Return what is known of a plan, empty where no files are.

    A damaged file stops no drive, which needs no truth: `damage` then says which and why, and nothing of the
    rest is kept, as half a truth would be measured against as if it were whole.
    """
    try:
        return _read(folder, frame)
    except BadWorld as error:
        return GroundTruth(damage=(str(error),))


def _read(folder: Path, frame: PlanFrame) -> GroundTruth:
    outlines, labels = folder / "locations.yaml", folder / "rooms.png"
    rooms: tuple[Room, ...] = ()
    image = None
    if outlines.exists():
        rooms = _outlined(outlines, frame)
    elif labels.exists():
        image = _label_image(labels, frame)
        rooms = tuple(Room(str(label)) for label in np.unique(image.labels) if label)
    rooms = _typed(folder / "rooms.json", rooms)
    doors = _entries(folder / "doors.yaml", _doorway, "a door lacks its corners or rooms")
    lifts, places = _places(folder / "places.yaml")
    return GroundTruth(rooms, doors, lifts, places, image)


def _outlined(path: Path, frame: PlanFrame) -> tuple[Room, ...]:
    content = read_yaml(path)
    rooms = []
    try:
        for name, flat in zip(content["locations"], content["polygons"], strict=True):
            corners = tuple(frame.point(px, py) for px, py in _corners(name, flat))
            rooms.append(Room(str(name), corners))
    except DAMAGE as error:
        raise BadWorld(f"{path}: locations and polygons do not fit together ({error})") from error
    return tuple(rooms)


def _corners(name: object, flat: Any) -> list[Point]:
    """Return the corners of a room, pixels. Raises ValueError."""
    corners = [(_coordinate(px), _coordinate(py)) for px, py in zip(flat[::2], flat[1::2], strict=True)]
    if len(corners) < 3:
        raise ValueError(f"room {shown(name)} has {len(corners)} corners")
    return corners


def _label_image(path: Path, frame: PlanFrame) -> LabelImage:
    labels = read_labels(path)
    if labels.shape != (frame.rows, frame.cols):
        rows, cols = labels.shape
        raise BadWorld(f"{path}: {cols} x {rows} pixels, but the plan has {frame.cols} x {frame.rows}")
    return LabelImage(labels[::-1], frame.resolution_m, frame.lower_left_m)


def _typed(path: Path, rooms: tuple[Room, ...]) -> tuple[Room, ...]:
    """Return rooms with the types that a file gives them."""
    if not path.exists():
        return rooms
    try:
        kinds = {str(name): str(entry["type"]) for name, entry in json.loads(read_text(path)).items()}
    except (*DAMAGE, RecursionError) as error:
        raise BadWorld(f"{path}: not a table of rooms with a type each ({error})") from error
    return tuple(replace(room, kind=kinds.get(room.name, room.kind)) for room in rooms)


def _entries(path: Path, make: Callable[[int, Any], T], damage: str) -> tuple[T, ...]:
    """Return what a list in a file describes. Raises BadWorld naming the entry."""
    if not path.exists():
        return ()
    content = read_yaml(path)
    if not isinstance(content, list):
        raise BadWorld(f"{path}: not a list")
    found = []
    for number, entry in enumerate(content):
        try:
            found.append(make(number, entry))
        except DAMAGE as error:
            raise BadWorld(f"{path}: entry {number + 1}: {damage} ({error})") from error
    return tuple(found)


def _doorway(number: int, entry: Any) -> Doorway:
    if "rooms" in entry:
        a, b = (str(room) for room in entry["rooms"])
    else:
        a, b = (str(approach["from"]) for approach in entry["approach"])
    (ax, ay), (bx, by) = entry["door_corner_pt_1"], entry["door_corner_pt_2"]
    ends = ((_coordinate(ax), _coordinate(ay)), (_coordinate(bx), _coordinate(by)))
    width = entry.get("width_m")
    return Doorway(
        str(entry.get("name", number)),
        ends,
        (a, b),
        str(entry.get("kind", "hinged")),
        None if width is None else _size(width),
    )


def _places(path: Path) -> tuple[tuple[Lift, ...], tuple[tuple[str, Point], ...]]:
    if not path.exists():
        return (), ()
    content = read_yaml(path)
    try:
        lifts = tuple(_lift(entry) for entry in content.get("lifts") or ())
        places = tuple((str(entry["name"]), _point(entry["at"])) for entry in content.get("places") or ())
    except DAMAGE as error:
        raise BadWorld(f"{path}: a place or a lift lacks something ({error})") from error
    return lifts, places


def _lift(entry: Any) -> Lift:
    levels = tuple(str(level) for level in entry["levels"])
    size = _size(entry["width"]), _size(entry["depth"])
    return Lift(str(entry["name"]), _point(entry["centre"]), *size, levels)


def _point(pair: Any) -> Point:
    x, y = pair
    return _coordinate(x), _coordinate(y)


def _size(value: Any) -> float:
    number = _coordinate(value)
    if number <= 0.0:
        raise ValueError(f"{shown(value)} is no size")
    return number


def _coordinate(value: Any) -> float:
    number = float(value)
    if not abs(number) <= FAR:
        raise ValueError(f"{shown(value)} is no coordinate of a building")
    return number
