"""Worlds by name or by file: `names()` lists the built-in ones, `load` takes a name or a file."""

from collections.abc import Callable
from pathlib import Path

from sim.errors import BadWorld
from sim.office import office
from sim.ros_map import load_ros_map
from sim.world import World

BUILT_IN: dict[str, Callable[[], World]] = {"office": office}


def names() -> list[str]:
    """Return the built-in worlds, the default first."""
    return list(BUILT_IN)


def load(name_or_path: str | Path) -> World:
    """Return a world. Raises BadWorld in one line when the name is unknown or the file unusable."""
    builder = BUILT_IN.get(str(name_or_path))
    if builder is not None:
        return builder()
    path = Path(name_or_path)
    if path.suffix in {".yaml", ".yml"}:
        return load_ros_map(path)
    raise BadWorld(f"{name_or_path}: no such world; known are {', '.join(names())}, or a ROS map .yaml")
