"""A depth camera with Kinect's geometry: it sees what the planar laser overlooks.

Depth is the distance along the optical axis; nearer than 0.8 m, beyond 4 m and through glass there is none.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lemtomap.sim.body import BodyState
from lemtomap.sim.scene import Scene


@dataclass(frozen=True, slots=True)
class DepthConfig:
    """Where the camera sits and how well it sees."""

    x_m: float = -0.087
    """Ahead of the wheels' axis; TurtleBot 2 carries its Kinect at the back (turtlebot_description)."""
    height_m: float = 0.29
    pitch_rad: float = 0.0
    """Nose-up."""
    width_rad: float = math.radians(57.0)
    height_rad: float = math.radians(43.0)
    columns: int = 80
    rows: int = 60
    near_m: float = 0.8
    far_m: float = 4.0
    noise_per_m2: float = 0.001425
    """Standard deviation is this times depth squared (Khoshelham 2012)."""


class DepthCamera:
    """One camera in one scene."""

    def __init__(self, scene: Scene, config: DepthConfig, rng: np.random.Generator) -> None:
        self._scene = scene
        self._config = config
        self._rng = rng
        across = math.tan(config.width_rad / 2) * np.linspace(1.0, -1.0, config.columns)
        down = math.tan(config.height_rad / 2) * np.linspace(1.0, -1.0, config.rows)
        left, up = np.meshgrid(across, down)
        self._rays = np.stack([np.ones_like(left), left, up], axis=-1).reshape(-1, 3)

    def capture(self, state: BodyState) -> NDArray[np.float32]:
        """Return one image, float32 (rows, columns), metres along the axis, NaN where nothing is measured.

        Row 0 is the upper edge, column 0 the left one.
        """
        config = self._config
        rays = self._rays @ _rotation(state.yaw, state.pitch + config.pitch_rad).T
        cos, sin = math.cos(state.yaw), math.sin(state.yaw)
        eye = (state.x + cos * config.x_m, state.y + sin * config.x_m, state.height_m + config.height_m)
        starts = np.tile(eye, (len(rays), 1))
        hits = self._scene.cast(starts, starts + rays * config.far_m)
        depth = np.where(hits.body >= 0, hits.share * config.far_m, np.nan)
        depth = self._add_floor(depth, eye[2] - state.height_m, rays)
        depth[depth < config.near_m] = np.nan
        depth += config.noise_per_m2 * depth**2 * self._rng.standard_normal(len(depth))
        return depth.reshape(config.rows, config.columns).astype(np.float32)

    def _add_floor(
        self, depth: NDArray[np.float64], eye_m: float, rays: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Flat worlds have no floor body: it is the plane z = 0."""
        if not self._scene.flat:
            return depth
        down = np.minimum(rays[:, 2], -1e-9)
        floor = np.where(eye_m / -down <= self._config.far_m, eye_m / -down, np.nan)
        return np.asarray(np.fmin(depth, floor))

    def points_base(self, image: NDArray[np.float32]) -> NDArray[np.float64]:
        """Return the measured points, float64 (N, 3), metres, base frame with z above the floor."""
        depth = image.reshape(-1).astype(np.float64)
        seen = np.isfinite(depth)
        rays = self._rays[seen] @ _rotation(0.0, self._config.pitch_rad).T
        return np.asarray(rays * depth[seen, None] + [self._config.x_m, 0.0, self._config.height_m])


def _rotation(yaw: float, pitch: float) -> NDArray[np.float64]:
    """Return the matrix of nose-up pitch, then yaw."""
    cy, sy, cp, sp = math.cos(yaw), math.sin(yaw), math.cos(pitch), math.sin(pitch)
    return np.array([[cy * cp, -sy, -cy * sp], [sy * cp, cy, -sy * sp], [sp, 0.0, cp]])
