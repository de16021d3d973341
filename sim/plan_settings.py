"""The YAML of a ROS map_server map: image, scale, origin, and what its greys mean."""

import math
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

from lemtomap.sim.errors import BadWorld, shown
from lemtomap.sim.raster import FAR_M
from lemtomap.sim.text_file import read_yaml

YES, NO = {"1", "true", "yes", "on", "y"}, {"0", "false", "no", "off", "n"}


class Mode(StrEnum):
    """How a grey becomes an occupancy (nav2_map_server)."""

    TRINARY = "trinary"
    """By the thresholds; what lies between is unknown."""
    SCALE = "scale"
    """The same, but what lies between them is a probability, and only transparent is unknown."""
    RAW = "raw"
    """0 to 100 are the occupancy in percent, all else is unknown."""


@dataclass(frozen=True, slots=True)
class PlanSettings:
    """What the YAML says."""

    image: Path
    resolution_m: float
    origin: tuple[float, float, float]
    """Pose of the lower left corner of the image: x m, y m, yaw rad."""
    negate: bool
    """Dark is free."""
    occupied_thresh: float
    free_thresh: float
    """Occupancies from 0 to 1: above the first is wall, below the second is floor."""
    mode: Mode


def read_settings(path: Path) -> PlanSettings:
    """Read a map_server YAML. Raises BadWorld naming file, key and reason."""
    values = read_yaml(path)
    if not isinstance(values, dict):
        raise BadWorld(f"{path}: a map_server YAML holds keys, this holds {type(values).__name__}")
    for key in ("image", "resolution", "origin"):
        if key not in values:
            raise BadWorld(f"{path}: key '{key}' is missing")
    occupied, free = (
        _number(path, key, values.get(key, default), 0.0, 1.0)
        for key, default in (("occupied_thresh", 0.65), ("free_thresh", 0.196))
    )
    if occupied <= free:
        raise BadWorld(f"{path}: occupied_thresh {occupied:g} must be above free_thresh {free:g}")
    return PlanSettings(
        image=_image(path, values["image"]),
        resolution_m=_number(path, "resolution", values["resolution"], 0.001, 1.0),
        origin=_origin(path, values["origin"]),
        negate=_truth(path, "negate", values.get("negate", 0)),
        occupied_thresh=occupied,
        free_thresh=free,
        mode=_mode(path, values.get("mode", Mode.TRINARY)),
    )


def _image(path: Path, value: Any) -> Path:
    if not isinstance(value, str) or not value.strip():
        raise BadWorld(f"{path}: 'image' must be the name of a file, is {shown(value)}")
    return path.parent / value


def _number(path: Path, key: str, value: Any, low: float, high: float) -> float:
    """Return a number within limits; YAML takes `5e-2` for a text."""
    try:
        number = math.nan if isinstance(value, bool) else float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not low <= number <= high:
        raise BadWorld(f"{path}: '{key}' must be a number from {low:g} to {high:g}, is {shown(value)}")
    return number


def _origin(path: Path, value: Any) -> tuple[float, float, float]:
    if not isinstance(value, list) or len(value) not in {2, 3}:
        raise BadWorld(f"{path}: 'origin' must be [x, y, yaw], is {shown(value)}")
    x, y = (_number(path, "origin", part, -FAR_M, FAR_M) for part in value[:2])
    yaw = _number(path, "origin", value[2] if len(value) == 3 else 0.0, -100.0, 100.0)
    return x, y, math.remainder(yaw, 2 * math.pi)


def _truth(path: Path, key: str, value: Any) -> bool:
    text = shown(value).strip("'\"").lower()
    if text not in YES | NO:
        raise BadWorld(f"{path}: '{key}' must be 0 or 1, is {shown(value)}")
    return text in YES


def _mode(path: Path, value: Any) -> Mode:
    if value not in list(Mode):
        raise BadWorld(f"{path}: 'mode' must be one of {', '.join(Mode)}, is {shown(value)}")
    return Mode(value)
