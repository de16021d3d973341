"""What only a simulator can show: the building as it is, the robot's true track and the believed one."""

import math
from collections.abc import Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from lemtomap import se2

WALL_COLOUR, TRUE_COLOUR, BELIEVED_COLOUR = [150, 156, 166], [67, 170, 139], [249, 132, 74]
POINT_EVERY_M = 0.15  # of both trails, as finely as they are seen apart
TRAIL_PERIOD_S = 3.0  # the whole trail is sent each time


class TruthView:
    """Logs below `truth/`, in the world's frame. The estimate is laid on the truth where the run began."""

    def __init__(self, stream: rr.RecordingStream, outlines: Sequence[NDArray[np.float64]]) -> None:
        self._stream = stream
        self._trails: tuple[list[tuple[float, float]], list[tuple[float, float]]] = ([], [])
        self._T_world_grid: se2.Pose | None = None
        self._trail_due_s = -math.inf
        points = np.concatenate(list(outlines))
        self.middle_m = (points.min(axis=0) + points.max(axis=0)) / 2
        self.extent_m = float((points.max(axis=0) - points.min(axis=0)).max())
        self._outlines = [_flat(outline) for outline in outlines]
        self.begin()

    def begin(self) -> None:
        """Log the building; once in each part of the recording."""
        walls = rr.LineStrips3D(self._outlines, colors=WALL_COLOUR, radii=0.02)
        self._stream.log("truth/walls", walls, static=True)

    def show(self, now_s: float, T_world_base: se2.Pose, T_grid_base: se2.Pose) -> None:
        """Show both poses and, now and then, both trails."""
        if self._T_world_grid is None:
            self._T_world_grid = se2.compose(T_world_base, se2.inverse(T_grid_base))
        believed = se2.compose(self._T_world_grid, T_grid_base)
        names = ("true", "believed")
        for name, pose, colour in zip(
            names, (T_world_base, believed), (TRUE_COLOUR, BELIEVED_COLOUR), strict=True
        ):
            x, y, yaw = (float(value) for value in pose)
            vector = [[0.45 * math.cos(yaw), 0.45 * math.sin(yaw), 0.0]]
            arrow = rr.Arrows3D(vectors=vector, origins=[[x, y, 0.1]], radii=0.06, colors=colour)
            self._stream.log(f"truth/{name}/pose", arrow)
        error_m = float(np.hypot(*(believed[:2] - np.asarray(T_world_base)[:2])))
        self._stream.log("health/error_m", rr.Scalars(error_m))
        self._extend(now_s, T_world_base, believed)

    def _extend(self, now_s: float, true: se2.Pose, believed: se2.Pose) -> None:
        place = (float(true[0]), float(true[1]))
        if not self._trails[0] or math.dist(place, self._trails[0][-1]) >= POINT_EVERY_M:
            self._trails[0].append(place)
            self._trails[1].append((float(believed[0]), float(believed[1])))
        if now_s < self._trail_due_s or len(self._trails[0]) < 2:
            return
        self._trail_due_s = now_s + TRAIL_PERIOD_S
        for name, trail, colour in zip(
            ("true", "believed"), self._trails, (TRUE_COLOUR, BELIEVED_COLOUR), strict=True
        ):
            strip = rr.LineStrips3D([_flat(np.array(trail))], colors=colour, radii=0.03)
            self._stream.log(f"truth/{name}/trail", strip)


def _flat(points: NDArray[np.float64]) -> NDArray[np.float32]:
    return np.column_stack([points, np.zeros(len(points))]).astype(np.float32)
