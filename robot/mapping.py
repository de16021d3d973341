"""The mapping part of the robot: a scan in, a snapshot of the map out. One scan at a time."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lemtomap.topo.mapper import TopoMapper
from lemtomap.types import GridView, Odometry, Scan, SlamUpdate
from robot.exchange import Exchange, Level, TimedScan


class GridSlam(Protocol):
    """Any of the window or grid SLAMs."""

    def update(self, scan: Scan, odometry: Odometry) -> SlamUpdate:
        """Take one scan."""
        ...

    def view(self) -> GridView:
        """Return the best window."""
        ...

    def particles(self) -> NDArray[np.float64]:
        """Return float64 (N, 3), T_grid_base of each particle."""
        ...


class MappingStep:
    """Rolling-window SLAM, then topological SLAM."""

    def __init__(self, slam: GridSlam, mapper: TopoMapper, exchange: Exchange) -> None:
        self.slam, self.mapper = slam, mapper
        self.scans = 0
        """How many scans went into the map."""
        self._exchange = exchange
        self._lost = False
        self._associated_id = 0

    def step(self, timed: TimedScan) -> None:
        """Map one scan and publish what is known now."""
        for event in self._exchange.nav_events.drain():
            self.mapper.apply(event)
        update = self.slam.update(timed.scan, timed.odometry)
        self.mapper.update(update, self.slam.view(), timed.sighting.hits_base)
        self.scans += 1
        view = self.mapper.view(self.slam.particles())
        if view.associated_id != self._associated_id:
            self._associated_id = view.associated_id
            self.mapper.store.commit()  # who plans from a node must find it and its edges in the file
        self._exchange.map_view.put(view)
        if view.lost != self._lost:
            self._lost = view.lost
            text, level = (
                ("lost: looking for the place", Level.WARN) if view.lost else ("found again", Level.INFO)
            )
            self._exchange.note(update.stamp_s, "mapping", text, level)

    def close(self) -> None:
        """Write the map to disk."""
        self.mapper.close()
