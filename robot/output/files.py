"""The files a run leaves: trajectory, grid and summary, each written whole or not at all."""

import json
import math
import resource
import shutil
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
import psutil
from numpy.typing import NDArray

from lemtomap.errors import BadSetting
from lemtomap.robot.runs.folder import RunFolder
from lemtomap.se2 import Pose, compose
from lemtomap.types import GridView

# Grey levels and thresholds of ROS map_server; 205 decodes to 0.19608, so a free_thresh above it
# would turn unknown into free.
GREY_FREE, GREY_OCCUPIED, GREY_UNKNOWN = 254, 0, 205
FREE_THRESHOLD, OCCUPIED_THRESHOLD = 0.196, 0.65
FREE_PERCENT, OCCUPIED_PERCENT = (
    25,
    65,
)  # nav2_map_server, map_io.cpp: what a trinary save calls free, occupied


GRID_COMMENT = (
    "# The grid at the end of the drive. The origin (x, y in metres, yaw in radians) is the pose of\n"
    "# the image's lower left corner in the frame of trajectory.tum; read without its yaw it lies turned.\n"
)


@contextmanager
def staged(out: Path) -> Iterator[Path]:
    """Give a private directory beside `out`; its files move into `out` only when the body ends well.

    Raises BadSetting if `out` is no directory, cannot be made, or a run writes there.
    """
    if out.exists() and not out.is_dir():
        raise BadSetting(f"{out}: is a file; --out needs a directory")
    claimed = RunFolder(out) if out.exists() else None
    missing = [folder for folder in (out.parent, *out.parent.parents) if not folder.exists()]
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        stage = Path(tempfile.mkdtemp(prefix=f".{out.name}-", dir=out.parent))
    except OSError as error:
        if claimed is not None:
            claimed.close()
        raise BadSetting(f"{out}: cannot write there ({error.strerror})") from error
    try:
        yield stage
        out.mkdir(exist_ok=True)
        for file in sorted(stage.iterdir()):
            file.replace(out / file.name)
    finally:
        if claimed is not None:
            claimed.close()
        shutil.rmtree(stage, ignore_errors=True)
        with suppress(OSError):  # not empty: something of value stands there
            for folder in missing:
                folder.rmdir()


def write_whole(path: Path, data: bytes) -> None:
    """Write a file so that a reader sees the old content or the new, never a part."""
    partial = path.with_name(f".{path.name}.part")
    partial.write_bytes(data)
    partial.replace(path)


def write_trajectory(path: Path, stamps_s: Iterable[float], T_map_base: Pose) -> None:
    """Write a TUM trajectory: `stamp x y z qx qy qz qw`, one line per scan in the order given.

    T_map_base: float64 (N, 3), poses in the frame of a solved map.
    """
    still = "0.000000 0.000000 0.000000"  # z, qx, qy: the robot stays upright
    lines = (
        f"{stamp:.6f} {x:.6f} {y:.6f} {still} {math.sin(yaw / 2):.8f} {math.cos(yaw / 2):.8f}\n"
        for stamp, (x, y, yaw) in zip(stamps_s, np.asarray(T_map_base).reshape(-1, 3).tolist(), strict=True)
    )
    write_whole(path, "".join(lines).encode())


def grey_levels(occupancy: NDArray[np.int8]) -> NDArray[np.uint8]:
    """Turn occupancy (-1 unknown, 0..100; rows grow with y) into map_server's three greys, top row first."""
    grey = np.full(occupancy.shape, GREY_UNKNOWN, np.uint8)
    grey[(occupancy >= 0) & (occupancy <= FREE_PERCENT)] = GREY_FREE
    grey[occupancy >= OCCUPIED_PERCENT] = GREY_OCCUPIED
    return np.flipud(grey)


def write_grid(directory: Path, grid: GridView, T_map_grid: Pose) -> None:
    """Write grid.pgm and grid.yaml, readable by ROS map_server.

    T_map_grid: where the grid's own frame lies in that of trajectory.tum. The image keeps the grid's axes;
    the origin in grid.yaml, the pose of its lower left corner, lays it over the trajectory.
    """
    image = grey_levels(grid.occupancy)
    rows, cols = image.shape
    x_m, y_m, yaw_rad = compose(T_map_grid, [*grid.origin_m, 0.0]).tolist()
    write_whole(directory / "grid.pgm", f"P5\n{cols} {rows}\n255\n".encode() + image.tobytes())
    text = (
        f"{GRID_COMMENT}image: grid.pgm\nmode: trinary\n"
        f"resolution: {grid.resolution_m:.6g}\norigin: [{x_m:.6f}, {y_m:.6f}, {yaw_rad:.6f}]\n"
        f"negate: 0\noccupied_thresh: {OCCUPIED_THRESHOLD}\nfree_thresh: {FREE_THRESHOLD}\n"
    )
    write_whole(directory / "grid.yaml", text.encode())


def told_of_grid(directory: Path, grid: GridView, T_map_grid: Pose) -> str:
    """Return a line that tells the user what the grid shows, and in which frame."""
    rows, cols = grid.occupancy.shape
    width_m, height_m = cols * grid.resolution_m, rows * grid.resolution_m
    turned_deg = math.degrees(float(T_map_grid[2]))
    return (
        f"{directory / 'grid.yaml'}: the grid at the end, {width_m:.0f} m x {height_m:.0f} m; its origin, "
        f"turned by {turned_deg:.1f} degrees, lays it into the frame of trajectory.tum"
    )


def write_summary(path: Path, summary: Mapping[str, Any]) -> None:
    """Write summary.json; numbers keep at most six decimals, NaN becomes null."""
    write_whole(path, (json.dumps(_plain(summary), indent=2) + "\n").encode())


def _plain(value: Any) -> Any:
    """Return `value` as JSON knows it."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [_plain(item) for item in value]
    if isinstance(value, bool | int | None) or value is None:
        return value
    if isinstance(value, float | np.floating):
        return round(float(value), 6) if math.isfinite(value) else None
    return int(value) if isinstance(value, np.integer) else str(value)


def peak_rss_mb() -> float:
    """Return the most memory this process has held, in MB (10^6 bytes)."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1e6 if sys.platform == "darwin" else peak * 1024 / 1e6


def rss_mb() -> float:
    """Return the memory this process holds now, in MB (10^6 bytes)."""
    return float(psutil.Process().memory_info().rss) / 1e6


def versions() -> dict[str, str]:
    """Return what made the result: Python, this package and the libraries that move numbers."""
    found = {}
    for name in ("lemtomap", "numpy", "scipy", "numba", "rerun-sdk", "pybullet"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found | {"python": sys.version.split()[0]}


def file_bytes(path: Path) -> int:
    """Return a file's size, 0 if there is none."""
    return path.stat().st_size if path.exists() else 0
