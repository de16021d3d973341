"""overview.png: what a person needs to judge a map at a glance."""

import pickle
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lemtomap import se2
from lemtomap.areas.painting import Painting
from lemtomap.robot.child import python
from lemtomap.robot.output.files import write_whole
from lemtomap.se2 import Pose
from lemtomap.types import EdgeType, GridView

PAINT_LIMIT_S = 60.0  # a picture takes a second or two


class WallSketch:
    """Beam ends of evenly chosen scans, for the picture of the walls: bounded, however long the drive.

    When full, every second scan kept is dropped and from then on only every second one is taken.
    """

    def __init__(self, capacity: int = 6000) -> None:
        self._capacity, self._stride, self._seen = capacity, 1, 0
        self._kept: list[tuple[float, NDArray[np.float32]]] = []

    def add(self, key: float, points_base: NDArray[np.floating]) -> None:
        """Take a scan's beam ends, (N, 2) metres, base frame; `key` tells which scan it was."""
        self._seen += 1
        if self._seen % self._stride:
            return
        self._kept.append((key, points_base.astype(np.float32)))
        if len(self._kept) >= self._capacity:
            self._kept, self._stride = self._kept[::2], self._stride * 2

    def points(self, T_map_base: Mapping[float, Pose]) -> NDArray[np.float32]:
        """Return all beam ends, float32 (N, 2), metres, by each scan's final pose (none: left out)."""
        known = [(T_map_base[key], points) for key, points in self._kept if key in T_map_base]
        placed = np.empty((sum(len(points) for _, points in known), 2), np.float32)
        begin = 0
        for pose, points in known:
            placed[begin : begin + len(points)] = se2.transform(pose, points)
            begin += len(points)
        return placed


@dataclass(frozen=True)
class Overview:
    """Everything the picture shows, in one map frame (metres)."""

    T_map_node: Mapping[int, Pose]
    edges: Sequence[tuple[int, int, EdgeType]]
    trajectory: Pose
    """float64 (N, 3), T_map_base."""
    walls: NDArray[np.floating]
    """(N, 2), beam ends."""
    grid: GridView
    T_map_grid: Pose
    names: Mapping[int, str] = field(default_factory=dict)
    painting: Painting | None = None
    """Areas and doors; None: they are not known."""
    title: str = ""
    facts: Sequence[str] = ()


def draw(path: Path, overview: Overview) -> None:
    """Draw the picture, 1800 x 1200 pixels, whole or not at all.

    A process of its own paints it, so that what paints takes no memory here. Raises OSError, also when that
    process fails.
    """
    plain = replace(overview, T_map_node=dict(overview.T_map_node), names=dict(overview.names))
    command = python("-m", "lemtomap.robot.output.painting")
    with tempfile.TemporaryFile() as told:
        pickle.dump(plain, told, protocol=pickle.HIGHEST_PROTOCOL)  # piece by piece, not all of it at once
        told.seek(0)
        try:
            painter = subprocess.run(  # noqa: S603 - our own interpreter and module
                command,
                stdin=told,
                capture_output=True,
                check=False,
                timeout=PAINT_LIMIT_S,
                start_new_session=True,  # a Ctrl-C that ends the run does not end the picture
            )
        except subprocess.TimeoutExpired as late:
            raise OSError(f"{path}: not painted within {PAINT_LIMIT_S:.0f} s") from late
    if painter.returncode:
        said = painter.stderr.decode(errors="replace").strip().splitlines()
        raise OSError(f"{path}: the painter failed: {said[-1] if said else painter.returncode}")
    write_whole(path, painter.stdout)
