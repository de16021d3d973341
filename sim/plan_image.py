"""The image of a ROS map: which of its cells are wall, floor, or not known.

nav2's map_server is the reference. Beyond it, for the maps people have: what is not opaque is unknown in each
mode, and so is the grey 205 of the map savers whatever the thresholds say.
"""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from lemtomap.sim.errors import BadWorld
from lemtomap.sim.plan_settings import Mode, PlanSettings
from lemtomap.sim.text_file import require_file

T = TypeVar("T")
MAX_PIXELS = 25_000_000  # 250 m x 250 m at 0.05 m
MAX_PLAIN_PIXELS = 4_000_000  # of PGM as text: read at a million a second
FORMATS = ("PNG", "PPM", "BMP", "JPEG", "GIF", "TIFF")  # others start programs, or are no drawings
SAVED_UNKNOWN = 50  # 255 - 205: occupancy of what map savers draw for unknown, of 255
NEAR = 10  # greys on either side that a distinct peak stands out from
PEAK = 5  # times the highest of them
PEAK_M2 = 0.25  # less of it is no ground nobody has seen


@dataclass(frozen=True, slots=True)
class Drawing:
    """What an image says about each cell; what is neither is not known."""

    wall: NDArray[np.bool_]
    """bool (rows, cols), row 0 at least y."""
    floor: NDArray[np.bool_]
    remarks: tuple[str, ...] = ()


def read_drawing(settings: PlanSettings) -> Drawing:
    """Read the image and sort its cells. Raises BadWorld naming the file and the reason."""
    shade, opaque = _read_image(settings.image)
    shade, opaque = shade[::-1], opaque[::-1]
    if settings.mode is Mode.RAW:
        percent = np.rint(shade * 255)
        opaque = opaque & (percent <= 100)
        wall = opaque & (percent >= settings.occupied_thresh * 100)
        return Drawing(wall, opaque & (percent <= settings.free_thresh * 100))
    occupancy = shade if settings.negate else 1.0 - shade
    wall = opaque & (occupancy > settings.occupied_thresh)
    floor = opaque & (occupancy < settings.free_thresh)
    saved_unknown = np.rint(occupancy * 255) == SAVED_UNKNOWN
    if not _is_peak(occupancy[floor], int(np.count_nonzero(saved_unknown & floor)), settings.resolution_m):
        return Drawing(wall, floor)
    grey = SAVED_UNKNOWN if settings.negate else 255 - SAVED_UNKNOWN
    remark = (
        f"{settings.image}: grey {grey} counts as unknown, as map savers mean it, though free_thresh "
        f"{settings.free_thresh:g} calls it free"
    )
    return Drawing(wall, floor & ~saved_unknown, (remark,))


def _is_peak(floor: NDArray[np.float32], count: int, resolution_m: float) -> bool:
    """Return whether what map savers draw for unknown stands out of the greys called free.

    Floor of that one grey is floor: somebody drew it so.
    """
    if count * resolution_m**2 < PEAK_M2 or count == len(floor):
        return False
    histogram = np.bincount(np.rint(floor * 255).astype(np.uint8), minlength=256)
    histogram[SAVED_UNKNOWN] = 0
    return count > PEAK * int(histogram[SAVED_UNKNOWN - NEAR : SAVED_UNKNOWN + NEAR + 1].max())


def _read_image(path: Path) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return brightness from 0 to 1, float32 (rows, cols), top row first, and which pixels are opaque."""
    return _decoded(path, _brightness)


def read_labels(path: Path) -> NDArray[np.int32]:
    """Return the numbers in an image of labels, int32 (rows, cols), top row first. Raises BadWorld."""
    return _decoded(path, _numbers)


def _numbers(path: Path, image: Image.Image) -> NDArray[np.int32]:
    if image.mode not in {"1", "L", "P"} and not image.mode.startswith("I"):
        raise BadWorld(f"{path}: labels must be numbers, 8 or 16 bits a pixel, not {image.mode}")
    return np.asarray(image).astype(np.int32)


def _decoded(path: Path, take: Callable[[Path, Image.Image], T]) -> T:
    """Return what `take` makes of an image within limits. Raises BadWorld."""
    require_file(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of broken metadata; of size, which has its own limit here
            with Image.open(path, formats=FORMATS) as image:
                _check_size(path, image)
                return take(path, image)
    except (Image.DecompressionBombError, MemoryError) as error:
        raise BadWorld(f"{path}: the image is too large") from error
    except UnidentifiedImageError as error:
        raise BadWorld(f"{path}: not a readable image (none of {', '.join(FORMATS)})") from error
    except BadWorld:
        raise
    except Exception as error:  # Pillow's decoders let through whatever a damaged file makes them raise
        raise BadWorld(f"{path}: not a readable image ({error})") from error


def _check_size(path: Path, image: Image.Image) -> None:
    cols, rows = image.size
    if min(cols, rows) < 3:
        raise BadWorld(f"{path}: {cols} x {rows} pixels is no floor plan")
    if cols * rows > MAX_PIXELS:
        raise BadWorld(f"{path}: {cols} x {rows} pixels are too many, at most {MAX_PIXELS / 1e6:g} million")
    decoders = [tile[0] for tile in getattr(image, "tile", ())]
    if cols * rows > MAX_PLAIN_PIXELS and "ppm_plain" in decoders:
        raise BadWorld(f"{path}: {cols} x {rows} pixels as text take too long; save it as binary PGM or PNG")


def _brightness(path: Path, image: Image.Image) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    if image.mode.startswith("I"):
        return _sixteen_bits(path, image)
    if image.mode == "F":
        raise BadWorld(f"{path}: pixels are floating point numbers; save it with 8 or 16 bits a channel")
    if image.mode == "1":
        image = image.convert("L")
    if image.mode != "L" or "transparency" in image.info:
        image = image.convert("RGBA" if image.has_transparency_data else "RGB")
    pixels = np.asarray(image)
    if pixels.ndim == 2:
        return pixels.astype(np.float32) / np.float32(255), np.ones(pixels.shape, dtype=np.bool_)
    shade = (pixels[..., 0].astype(np.float32) + pixels[..., 1] + pixels[..., 2]) / np.float32(765)
    opaque = pixels[..., 3] == 255 if pixels.shape[2] == 4 else np.ones(shade.shape, dtype=np.bool_)
    return shade, opaque


def _sixteen_bits(path: Path, image: Image.Image) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    pixels = np.asarray(image)
    if pixels.min() < 0 or pixels.max() > 65535:
        raise BadWorld(f"{path}: pixels have more than 16 bits")
    opaque = pixels != image.info.get("transparency", -1)
    return pixels.astype(np.float32) / np.float32(65535), opaque
