"""A depth camera as a second source of obstacles: what the planar laser overlooks, chairs' feet and low bars.

Any camera will do that can say, when asked, what it sees as points above the floor around the base: the
simulated one, or a real one whose driver keeps its newest cloud.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from lemtomap.nav.types import ObstacleSighting
from lemtomap.robot.exchange import Exchange

PERIOD_S = 0.2  # at 0.5 m/s the robot moves 0.1 m, two cells of the window, from look to look

Cloud = NDArray[np.floating]
"""(N, 3), metres, base frame with z above the floor; empty when there is nothing new."""


class DepthFeed:
    """Hands clouds to navigation, with the odometry of their time."""

    def __init__(self, look: Callable[[], Cloud], exchange: Exchange, period_s: float = PERIOD_S) -> None:
        self._look, self._exchange, self._period_s = look, exchange, period_s
        self._due_s = -np.inf

    def poll(self, now_s: float) -> None:
        """Look if it is time; call it as often as you like."""
        odometry = self._exchange.odometry.get()
        if odometry is None or now_s < self._due_s:
            return
        self._due_s = now_s + self._period_s - 1e-6
        cloud = self._look()
        if len(cloud):
            self._exchange.sightings.put(ObstacleSighting.from_cloud(now_s, odometry.T_odom_base, cloud))
