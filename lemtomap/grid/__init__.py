"""Rolling-window SLAM (thesis 3-4): `update = slam.update(scan, odometry)` for every scan."""

from lemtomap.grid.config import SlamConfig
from lemtomap.grid.gmapping import RollingGmapping
from lemtomap.grid.growing import GrowingGmapping
from lemtomap.grid.mapper import GridSlam, WindowMatcher

__all__ = ["GridSlam", "GrowingGmapping", "RollingGmapping", "SlamConfig", "WindowMatcher"]
