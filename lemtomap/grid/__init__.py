"""Rolling-window SLAM (thesis 3-4): `update = slam.update(scan, odometry)` for every scan."""

from collections.abc import Callable

from lemtomap.grid.config import SlamConfig
from lemtomap.grid.gmapping import RollingGmapping
from lemtomap.grid.growing import GrowingGmapping
from lemtomap.grid.mapper import GridSlam, WindowMatcher

SLAMS: dict[str, Callable[[SlamConfig, int], GridSlam]] = {
    "window": WindowMatcher,
    "rolling": RollingGmapping,
    "gmapping": GrowingGmapping,
}
"""The metric layers by the name that the user gives."""

DEFAULT_SLAM = "window"
"""As accurate as 5 particles on every recorded log at full range and at 5.6 m, for a quarter of the CPU
(`lemtomap bench slam logs`): particles are more than a window needs, as thesis 7-1-3 suspected."""

__all__ = [
    "DEFAULT_SLAM",
    "SLAMS",
    "GridSlam",
    "GrowingGmapping",
    "RollingGmapping",
    "SlamConfig",
    "WindowMatcher",
]
