"""ROS map_server maps (YAML beside a PGM or PNG) as worlds: walls merged into few long boxes, extruded."""

import math
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError
from scipy import ndimage

from lemtomap.sim.errors import BadWorld
from lemtomap.sim.raster import (
    SPAWN_CLEARANCE_M,
    boxes_from_raster,
    clearance_m,
    connected,
    find_spawn,
)
from lemtomap.sim.ros_truth import read_truth
from lemtomap.sim.world import Pose2, Raster, World

WALL_HEIGHT_M = 1.0
SOLID_M2 = 0.25  # unmapped ground of that size is what nobody could look into; less is a speck of the mapping
GAP_M = 2.5  # between copies and round them
MAX_SIDE_PX = 20_000  # 1 km at 0.05 m
KNOWN_SPAWNS: dict[str, Pose2] = {
    "willowgarage_perfect": (6.0, -16.0, 0.0)
}  # as in 2014 (ros_lemtomap launch)


def load_ros_map(path: Path) -> World:
    """Read a map_server YAML. Raises BadWorld naming the file and the reason."""
    settings = _read_yaml(path)
    image_path = path.parent / str(settings["image"])
    probability = _read_image(image_path, negate=bool(settings.get("negate", 0)))
    try:
        resolution = float(settings["resolution"])
        x0, y0, turn = (float(value) for value in (*settings["origin"], 0.0)[:3])
        occupied_from = float(settings.get("occupied_thresh", 0.65))
        free_below = float(settings.get("free_thresh", 0.196))
    except (TypeError, ValueError, IndexError) as error:
        raise BadWorld(f"{path}: resolution, origin or thresholds are not numbers ({error})") from error
    if not 0.001 <= resolution <= 1.0:
        raise BadWorld(f"{path}: resolution {resolution} m is outside 0.001 to 1 m")
    if not all(map(math.isfinite, (x0, y0))) or turn != 0.0:
        raise BadWorld(f"{path}: origin must be finite and not turned, is {settings['origin']}")
    occupied = probability >= occupied_from
    free = probability <= free_below
    if not free.any():
        raise BadWorld(f"{image_path}: no free space (no pixel lighter than free_thresh {free_below})")
    occupied |= _edge_of_unmapped(occupied, free, resolution)
    raster = Raster(occupied, free, resolution, (x0, y0))
    spawn = _spawn(raster, path)
    raster = Raster(occupied, connected(raster, spawn[:2]), resolution, (x0, y0))
    return World(
        name=path.stem,
        boxes=boxes_from_raster(raster, WALL_HEIGHT_M),
        raster=raster,
        spawn=spawn,
        truth=read_truth(path.parent, raster),
        description=f"ROS map {path.name}",
    )


def _edge_of_unmapped(
    occupied: NDArray[np.bool_], free: NDArray[np.bool_], resolution_m: float
) -> NDArray[np.bool_]:
    """Return the unmapped cells that border on floor, bool (rows, cols): walls, as nothing is known behind.

    Without them a robot leaves a real plan through glass and gaps, into a plain without end.
    """
    unmapped = ~occupied & ~free
    labels, _ = ndimage.label(unmapped)
    large = np.bincount(labels.ravel()) * resolution_m**2 >= SOLID_M2
    large[0] = False
    return large[labels] & ndimage.binary_dilation(free)


def _read_yaml(path: Path) -> dict[str, Any]:
    try:
        settings = yaml.safe_load(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise BadWorld(f"{path}: no such file") from error
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise BadWorld(f"{path}: not a readable YAML file ({' '.join(str(error).split())})") from error
    if not isinstance(settings, dict):
        raise BadWorld(f"{path}: a map_server YAML holds keys, this holds {type(settings).__name__}")
    for key in ("image", "resolution", "origin"):
        if key not in settings:
            raise BadWorld(f"{path}: key '{key}' is missing")
    return settings


def _read_image(path: Path, *, negate: bool) -> NDArray[np.float64]:
    """Return occupancy probability, float64 (rows, cols), row 0 at least y."""
    try:
        with warnings.catch_warnings(), _opened(path) as image:
            if max(image.size) > MAX_SIDE_PX or min(image.size) < 3:
                raise BadWorld(f"{path}: {image.size[0]} x {image.size[1]} pixels is no floor plan")
            if image.mode not in {"L", "1", "LA", "I;16", "I"}:
                raise BadWorld(f"{path}: image is not grey (mode {image.mode})")
            grey = np.asarray(image.convert("L"), dtype=np.float64)
    except FileNotFoundError as error:
        raise BadWorld(f"{path}: no such image") from error
    except Image.DecompressionBombError as error:
        raise BadWorld(f"{path}: the image is too large") from error
    except (UnidentifiedImageError, OSError, ValueError, SyntaxError) as error:
        raise BadWorld(f"{path}: not a readable image ({error})") from error
    value = grey[::-1] / 255.0
    return value if negate else 1.0 - value


def _opened(path: Path) -> Image.Image:
    warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # large halls are large images
    return Image.open(path)


def _spawn(raster: Raster, path: Path) -> Pose2:
    known = KNOWN_SPAWNS.get(path.stem)
    if known is not None:
        row, col = raster.cell(known[0], known[1])
        rows, cols = raster.free.shape
        if 0 <= row < rows and 0 <= col < cols and clearance_m(raster)[row, col] >= SPAWN_CLEARANCE_M:
            return known
    return find_spawn(raster, str(path))


def side_by_side(world: World, copies: int) -> World:
    """Return so many copies of a map in a row, GAP_M apart, a wall round them all: they look all the same."""
    raster = world.raster
    step = raster.resolution_m
    rows, cols = np.nonzero(raster.occupied)
    gap = round(GAP_M / step)
    building = np.pad(raster.occupied[rows.min() : rows.max() + 1, cols.min() : cols.max() + 1], gap)
    pitch = building.shape[1] - gap
    occupied = np.zeros((building.shape[0], pitch * copies + gap), dtype=np.bool_)
    for index in range(copies):
        occupied[:, index * pitch : index * pitch + building.shape[1]] |= building
    occupied[:2] = occupied[-2:] = True
    occupied[:, :2] = occupied[:, -2:] = True
    x0 = raster.origin_m[0] + (int(cols.min()) - gap) * step
    y0 = raster.origin_m[1] + (int(rows.min()) - gap) * step
    joined = Raster(occupied, ~occupied, step, (x0, y0))
    joined = Raster(occupied, connected(joined, world.spawn[:2]), step, (x0, y0))
    return World(
        name=f"{world.name}@{copies}",
        boxes=boxes_from_raster(joined, WALL_HEIGHT_M),
        raster=joined,
        spawn=world.spawn,
        description=f"{copies} x {world.description}",
    )
