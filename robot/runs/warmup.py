"""Running every compiled kernel once before the robot may move.

The first use of a kernel on a machine compiles it (later uses load it from the cache); neither may happen
while the loop thread has to stop the robot within milliseconds. So a robot of its own, with a map that is
thrown away, drives along an imagined corridor and back first, and is then switched on in it again: it maps,
explores, leaves its window behind, comes back to places it knows, is lost and finds itself.
"""

import gc
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lemtomap.grid import DEFAULT_SLAM
from lemtomap.grid.foreground import is_foreground
from lemtomap.nav.kernels import shapes
from lemtomap.nav.types import Contact, ContactKind, Goal, ObstacleSighting
from lemtomap.robot.build import build_core
from lemtomap.robot.config import RobotConfig
from lemtomap.robot.core import RobotCore
from lemtomap.robot.exchange import TimedScan
from lemtomap.robot.missions.missions import Explore
from lemtomap.se2 import Pose, between
from lemtomap.topo.loops.config import SearchConfig
from lemtomap.topo.loops.pictures import Placed, picture_of, told_apart
from lemtomap.topo.loops.places import LocalSubmap
from lemtomap.types import Odometry, Scan

STEP_M, TURN_RAD, SCAN_S = 0.4, 0.5, 0.1  # a drive that calls every kernel in few scans
ASIDE_M = 0.7  # of the middle: on its way back the robot makes nodes of its own beside the first ones
WAY_M = 14.0  # beyond what the first window holds, and the way after which places are measured again
WALLS = np.array(
    [
        # (x0, y0) to (x1, y1): a corridor whose niches tell one stretch of it from another
        *[(x, -1.5, x + 2.0, -1.5) for x in (-3.0, 0.0, 2.5, 6.5, 9.0, 13.0)],
        *[(x, 1.5, x + 3.0, 1.5) for x in (-3.0, 1.0, 4.5, 10.0, 14.0)],
        *[(x, -2.5, x, -1.5) for x in (-1.0, 0.0, 2.0, 4.5, 6.5, 8.5, 11.0, 13.0)],
        *[(x, 1.5, x, 3.0) for x in (0.0, 1.0, 4.0, 7.5, 10.0)],
        (-3.0, -2.5, 17.0, -2.5),
        (-3.0, 3.0, 17.0, 3.0),
        (-3.0, -1.5, -3.0, 1.5),
    ]
)
BEAMS, FIRST_RAD = 682, -2.0862138  # a URG-04LX
LOST_SCANS = 40
NAVIGATES_EACH, BUMPED_AT = 4, 20  # scans


def warm_up(config: RobotConfig, slam: str = DEFAULT_SLAM) -> None:
    """Compile or load all kernels of mapping, navigation and exploration: a minute at first, then 2 s."""
    with tempfile.TemporaryDirectory(prefix="lemtomap-") as folder:
        path = Path(folder) / "warm.lemto"
        way = _there_and_back()
        for poses in (way, way[:LOST_SCANS]):
            core = build_core(config, path, slam=slam, durable=False)
            core.navigation.set_mission(Explore())
            for index, T_world_base in enumerate(poses):
                before = way[max(0, index - 1)]
                turns = index % NAVIGATES_EACH == 0
                _live(core, T_world_base, before, SCAN_S * index, navigates=turns, bumped=index == BUMPED_AT)
            core.close()
    _tell_rivals_apart()
    shapes.eroded(np.ones((3, 3), np.uint8), 1)  # for nodes out of view, which the imagined robot never has
    is_foreground(np.zeros((3, 2), np.float32))  # for somebody who walks along
    gc.collect()
    gc.freeze()  # what is loaded now stays: a look through all of it for garbage takes tens of milliseconds


def _tell_rivals_apart() -> None:
    """Hold two pictures against each other: no place of the imagined corridor is like another."""
    points = np.zeros((1, 2))
    placed = Placed(picture_of(LocalSubmap(1, points, points), SearchConfig()), np.zeros(3))
    told_apart(points, placed, placed)


def _there_and_back() -> NDArray[np.float64]:
    """Return float64 (N, 3): along one side, back along the other and then on the first way again."""
    along = np.arange(0.0, WAY_M, STEP_M)
    turn = np.arange(0.0, np.pi, TURN_RAD)
    back = np.where(along > 0.5 * WAY_M, -ASIDE_M, ASIDE_M)[::-1]
    legs = [
        (along, np.full(len(along), ASIDE_M), np.zeros(len(along))),
        (np.full(len(turn), WAY_M), ASIDE_M * np.cos(turn), turn),
        (along[::-1], back, np.full(len(along), np.pi)),
    ]
    return np.concatenate([np.stack(leg, axis=-1) for leg in legs])


def _live(
    core: RobotCore, T_world_base: Pose, before: Pose, now_s: float, *, navigates: bool, bumped: bool
) -> None:
    """Let the robot map one scan and navigate."""
    timed, exchange = _imagined_scan(T_world_base, before, now_s), core.exchange
    exchange.odometry.put(timed.odometry)
    exchange.scans.put(timed)
    exchange.sightings.put(timed.sighting)
    while core.map_one(0.0):
        pass
    if not navigates and not bumped:
        return
    if bumped:
        core.navigation.navigator.set_goal(Goal(1), now_s)
        exchange.contacts.put(Contact(now_s, ContactKind.BUMPER, 0.0))
    core.navigate(now_s)


def _imagined_scan(T_world_base: Pose, before: Pose, now_s: float) -> TimedScan:
    """Return what a laser would see between the walls, read-only as a driver's."""
    x, y, yaw = T_world_base
    angles = FIRST_RAD + yaw + np.arange(BEAMS) * (2.0 * np.pi / 1024)
    cos, sin = np.cos(angles)[:, None], np.sin(angles)[:, None]
    x0, y0, x1, y1 = WALLS.T
    across = cos * (y1 - y0) - sin * (x1 - x0)
    with np.errstate(divide="ignore", invalid="ignore"):
        away_m = ((x0 - x) * (y1 - y0) - (y0 - y) * (x1 - x0)) / across
        along = ((x0 - x) * sin - (y0 - y) * cos) / across
    met = (away_m > 0.0) & (along >= 0.0) & (along <= 1.0)
    ranges = np.where(met, away_m, np.inf).min(axis=1).astype(np.float32)
    ranges[ranges > 5.0] = np.inf
    ranges.flags.writeable = False
    scan = Scan(now_s, ranges, FIRST_RAD, 2.0 * np.pi / 1024, 1e-4)
    step = between(before, T_world_base)
    odometry = Odometry(now_s, T_world_base, float(step[0]) / SCAN_S, float(step[2]) / SCAN_S)
    sighting = ObstacleSighting.from_scan(scan, T_world_base)
    return TimedScan(scan, odometry, sighting, now_s, BEAMS)
