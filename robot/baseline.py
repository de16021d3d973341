"""The metric baseline as a robot: AMCL on a saved grid, and the navigator that plans over all of it (T5)."""

from collections.abc import Sequence
from typing import cast

import numpy as np

from lemtomap.baseline.localiser import Amcl
from lemtomap.baseline.whole_grid import GridGraph, WholeGridLook, view_of
from lemtomap.nav.navigator import Navigator
from lemtomap.robot.base import BaseStep
from lemtomap.robot.config import RobotConfig
from lemtomap.robot.core import RobotCore
from lemtomap.robot.exchange import Exchange, TimedScan
from lemtomap.robot.mapping import MappingStep
from lemtomap.robot.navigating import NavigationStep
from lemtomap.se2 import Pose
from lemtomap.types import GridView


class AmclStep:
    """Stands where the mapping part stands: localises on a map that does not change."""

    def __init__(self, amcl: Amcl, grid: GridView, exchange: Exchange) -> None:
        self._amcl, self._grid, self._exchange = amcl, grid, exchange

    def step(self, timed: TimedScan) -> None:
        """Localise with one scan and publish the grid with the pose in it."""
        self._exchange.nav_events.drain()  # closed edges and the like have no place in a grid
        T_grid_odom = self._amcl.update(timed.sighting.hits_base, timed.sighting.T_odom_base)
        view = view_of(self._grid, T_grid_odom, self._amcl.T_grid_base, timed.scan.stamp_s)
        self._exchange.map_view.put(view)

    def close(self) -> None:
        """Nothing to write."""


def build_metric_core(
    config: RobotConfig, grid: GridView, T_grid_base: Pose | Sequence[float], *, seed: int = 0
) -> RobotCore:
    """Return a robot that starts at a known place of a saved grid."""
    exchange = Exchange()
    navigator = Navigator(config.nav, lambda surroundings: WholeGridLook(surroundings, config.nav))
    amcl = Amcl(grid, np.asarray(T_grid_base, dtype=np.float64), config.amcl, seed)
    localising = AmclStep(amcl, grid, exchange)
    navigation = NavigationStep(navigator, exchange, GridGraph)
    mapping = cast("MappingStep", localising)  # as far as the core is concerned
    return RobotCore(exchange, BaseStep(config, exchange), mapping, navigation, config.devices)
