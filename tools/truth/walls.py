"""Whether a wall of the true plan stands between two places."""

import math

from lemtomap.kernels.lines import first_on_line
from lemtomap.se2 import Pose
from lemtomap.sim.world import Raster


def wall_between(raster: Raster, a: Pose, b: Pose) -> bool:
    """Return True if a wall lies on the straight line from a to b (x m, y m, ...), world frame."""
    (x0, y0), cell_m = raster.origin_m, raster.resolution_m
    line = ((a[1] - y0) / cell_m, (a[0] - x0) / cell_m, (b[1] - y0) / cell_m, (b[0] - x0) / cell_m)
    return math.isfinite(first_on_line(raster.occupied, *line, 1.0, 0.0))
