"""A scan made ready for the mapper: de-skewed points in base, hits apart from beams that only prove free
space.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lemtomap.deskew import motion_during
from lemtomap.grid.kernels import scan as kernels
from lemtomap.types import Odometry, Scan


@dataclass(frozen=True, slots=True)
class Beams:
    """One prepared scan, base frame at the scan's stamp."""

    hits: NDArray[np.float32]
    """float32 (M, 2), metres."""
    normals_rad: NDArray[np.float32]
    """float32 (M,): direction across the surface at each hit, 0..pi; NaN where none is seen."""
    cuts: NDArray[np.float32]
    """float32 (C, 2), metres: where beams that saw nothing near are cut."""
    laser_base: NDArray[np.float64]
    """float64 (3,), T_base_laser."""


class ScanPreparer:
    """Turns Scan into Beams; remembers the beams' directions, so that scans may change their geometry."""

    def __init__(self) -> None:
        self._geometry = (0, 0.0, 0.0)
        self._directions = np.empty((0, 2), dtype=np.float64)

    def __call__(self, scan: Scan, odometry: Odometry, usable_range_m: float) -> Beams:
        """Return the beams, de-skewed. Raises BadSample."""
        geometry = (len(scan.ranges_m), scan.angle_min_rad, scan.angle_step_rad)
        if geometry != self._geometry:
            angles = scan.angle_min_rad + scan.angle_step_rad * np.arange(len(scan.ranges_m))
            self._directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
            self._geometry = geometry
        points = np.empty((2, len(scan.ranges_m), 2), dtype=np.float32)
        hits, cuts = kernels.prepare_scan(
            scan.ranges_m,
            self._directions,
            scan.T_base_laser,
            motion_during(scan, odometry),
            (scan.range_min_m, math.nextafter(usable_range_m, math.inf), scan.silent_free_m),
            points[0],
            points[1],
        )
        normals_rad = np.empty(hits, dtype=np.float32)
        kernels.surface_normals(points[0, :hits], normals_rad)
        return Beams(points[0, :hits], normals_rad, points[1, :cuts], scan.T_base_laser)
