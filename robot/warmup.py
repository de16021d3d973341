"""Running every compiled kernel once before the robot may move.

The first use of a kernel on a machine compiles it (later uses load it from the cache); neither may happen
while the loop thread has to stop the robot within milliseconds. So a robot of its own, with a map that is
thrown away, drives through an imagined room first.
"""

import tempfile
from pathlib import Path

import numpy as np

from lemtomap.grid import DEFAULT_SLAM
from lemtomap.nav.types import Contact, ContactKind, Goal
from lemtomap.se2 import Pose
from lemtomap.types import Odometry, Scan
from robot.bridge import deskewed_sighting
from robot.build import build_core
from robot.config import RobotConfig
from robot.exchange import TimedScan
from robot.missions import Explore

ROOM_M = 2.5  # half the side of the imagined room
STEP_M, SCAN_S = 0.12, 0.1
BEAMS, FIRST_RAD = 682, -2.0862138


def warm_up(config: RobotConfig, slam: str = DEFAULT_SLAM) -> None:
    """Compile or load all kernels of mapping, navigation and exploration: some 20 s at first, then 1 s."""
    with tempfile.TemporaryDirectory(prefix="lemtomap-") as folder:
        core = build_core(config, Path(folder) / "warm.lemto", slam=slam, durable=False)
        core.navigation.set_mission(Explore(config.nav))
        for index in range(30):
            now_s = SCAN_S * index
            timed = _imagined_scan(np.array([STEP_M * index - 1.5, 0.0, 0.02 * index]), now_s)
            exchange = core.exchange
            exchange.odometry.put(timed.odometry)
            exchange.scans.put(timed)
            exchange.sightings.put(timed.sighting)
            while core.map_one(0.0):
                pass
            if index == 20:
                core.navigation.navigator.set_goal(Goal(1), now_s)
                exchange.contacts.put(Contact(now_s, ContactKind.BUMPER, 0.0))
            core.navigate(now_s)
        core.close()


def _imagined_scan(T_room_base: Pose, now_s: float) -> TimedScan:
    """Return what a laser would see in a square room with one wall missing."""
    x, y, yaw = T_room_base
    angles = FIRST_RAD + yaw + np.arange(BEAMS) * (2.0 * np.pi / 1024)
    cos, sin = np.cos(angles), np.sin(angles)
    with np.errstate(divide="ignore"):
        to_x = np.where(cos < 0.0, (-ROOM_M - x) / cos, np.inf)
        to_y = (np.sign(sin) * ROOM_M - y) / sin
    ranges = np.minimum(to_x, to_y)
    ranges[ranges > 5.0] = np.inf
    scan = Scan(now_s, ranges.astype(np.float32), FIRST_RAD, 2.0 * np.pi / 1024, 1e-4)
    odometry = Odometry(now_s, T_room_base, STEP_M / SCAN_S, 0.2)
    sighting = deskewed_sighting(scan, np.tile(T_room_base, (BEAMS, 1)))
    return TimedScan(scan, odometry, sighting, now_s, BEAMS)
