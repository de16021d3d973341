"""Pictures of worlds from above: walls, furniture, rooms, doors, spawn, dock, and a track.

python -m lemtomap.sim.picture OUT_DIR [WORLD ...]     one PNG each, all built-in worlds by default
"""

import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lemtomap.sim import worlds
from lemtomap.sim.errors import BadWorld
from lemtomap.sim.world import Box, Surface, World

COLOURS = {
    Surface.WALL: "#333333",
    Surface.FURNITURE: "#b08d57",
    Surface.DARK: "#6b2d2d",
    Surface.GLASS: "#7fd0ee",
    Surface.PERSON: "#c0392b",
    Surface.FLOOR: "#dfe8d8",
}
INCHES_LONG = 8.0
LABEL: dict[str, Any] = {
    "ha": "center",
    "va": "center",
    "fontsize": 6,
    "color": "#2c6e49",
    "clip_on": True,
    "parse_math": False,  # a name may hold any signs
}


def save_picture(world: World, path: Path, track: NDArray[np.float64] | None = None) -> None:
    """Draw a world, and a true track float64 (N, 2+) over it, into a PNG."""
    import matplotlib as mpl  # noqa: PLC0415 - heavy, and only for pictures

    mpl.use("Agg")
    from matplotlib import pyplot as plt  # noqa: PLC0415

    raster = world.raster
    rows, cols = raster.free.shape
    scale = INCHES_LONG / max(rows, cols)
    with mpl.rc_context({"text.parse_math": False}):  # a room's name is no formula
        figure, axis = plt.subplots(
            figsize=(max(cols * scale, 2.5), max(rows * scale, 1.5) + 0.4), layout="constrained"
        )
        draw(world, axis, track)
        figure.savefig(path, dpi=100)
        plt.close(figure)


def draw(world: World, axis: Any, track: NDArray[np.float64] | None = None) -> None:
    """Draw a world on matplotlib axes."""
    raster = world.raster
    rows, cols = raster.free.shape
    x0, y0 = raster.origin_m
    extent = (x0, x0 + cols * raster.resolution_m, y0, y0 + rows * raster.resolution_m)
    axis.imshow(np.where(raster.free, 1.0, 0.85), origin="lower", extent=extent, cmap="gray", vmin=0, vmax=1)
    for surface, colour in COLOURS.items():
        outlines = [_outline(box) for box in world.boxes if box.surface is surface and _is_drawn(box)]
        if outlines:
            axis.add_collection(_polygons(outlines, colour))
    for room in world.truth.rooms if len(world.truth.rooms) <= 30 else ():
        if room.level == 0:
            corners = np.array(room.outline)
            axis.text(*corners.mean(axis=0), room.name, **LABEL)
    for door in world.truth.doors:
        (ax, ay), (bx, by) = door.ends
        axis.plot([ax, bx], [ay, by], color="#2c6e49", lw=1)
    x, y, yaw = world.spawn
    axis.plot(x, y, "o", color="#d1495b", ms=5)
    axis.plot([x, x + 0.5 * math.cos(yaw)], [y, y + 0.5 * math.sin(yaw)], color="#d1495b")
    if world.dock is not None:
        axis.plot(*world.dock[:2], "s", color="#edae49", ms=5)
    if track is not None:
        axis.plot(track[:, 0], track[:, 1], color="#1f77b4", lw=0.8)
    axis.set_aspect("equal")
    axis.set_title(f"{world.name}: {world.description}", fontsize=8, parse_math=False)
    axis.tick_params(labelsize=6)


def outlines(world: World) -> list[NDArray[np.float64]]:
    """Return what belongs into a plan as closed outlines, float64 (5, 2) each, metres, world frame."""
    drawn = [box for box in world.boxes if _is_drawn(box)]
    return [np.concatenate([corners, corners[:1]]) for corners in map(_outline, drawn)]


def _is_drawn(box: Box) -> bool:
    """Return True if a box belongs into a plan: no ceilings; of the floor only ramps."""
    return box.centre[2] < 1.5 and (box.surface is not Surface.FLOOR or box.pitch_rad != 0.0)


def _outline(box: Box) -> NDArray[np.float64]:
    cos, sin = math.cos(box.yaw_rad), math.sin(box.yaw_rad)
    corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * box.half[:2]
    return np.asarray(corners @ np.array([[cos, sin], [-sin, cos]]) + box.centre[:2])


def _polygons(outlines: list[NDArray[np.float64]], colour: str) -> Any:
    from matplotlib.collections import PolyCollection  # noqa: PLC0415

    return PolyCollection(outlines, facecolors=colour, edgecolors=colour, linewidths=0.5)


def main(arguments: list[str]) -> int:
    """Draw the worlds asked for."""
    if not arguments:
        sys.stderr.write(f"{__doc__}\n")
        return 2
    folder = Path(arguments[0])
    folder.mkdir(parents=True, exist_ok=True)
    for name in arguments[1:] or worlds.names():
        try:
            world = worlds.load(name)
        except BadWorld as error:
            sys.stderr.write(f"{error}\n")
            return 2
        path = folder / f"{Path(name).stem.replace(':', '-')}.png"
        save_picture(world, path)
        sys.stdout.write(f"{path}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
