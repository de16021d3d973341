"""The mapping part of the robot: a scan in, a snapshot of the map out. One scan at a time."""

from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lemtomap.topo.events import LevelChanged
from lemtomap.topo.mapper import TopoMapper
from lemtomap.topo.whereabouts import Watch
from lemtomap.types import GridView, MapView, Odometry, Scan, SlamUpdate
from robot.exchange import Exchange, Level, TimedScan
from robot.mapped import MappedScan


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
    """Rolling-window SLAM, then topological SLAM; a new window and a new part of the map when carried."""

    def __init__(self, make_slam: Callable[[], GridSlam], mapper: TopoMapper, exchange: Exchange) -> None:
        self.slam, self.mapper = make_slam(), mapper
        self.scans = 0
        """How many scans went into the map."""
        self._make_slam = make_slam
        self._exchange = exchange
        self._watch = Watch(mapper.config.watch)
        self._lifted_since_s: float | None = None
        self._lost = False
        self._associated_id = 0

    def step(self, timed: TimedScan) -> None:
        """Map one scan and publish what is known now; a robot in the air maps nothing."""
        stamp_s = timed.scan.stamp_s
        events = () if timed.lifted else tuple(self._exchange.nav_events.drain())
        self._exchange.mapped.put(MappedScan(stamp_s, timed.lifted, events))
        if timed.lifted:
            self._hold(stamp_s)
            return
        if self._lifted_since_s is not None:
            carried = stamp_s - self._lifted_since_s >= self._watch.config.carried_s
            self._lifted_since_s = None
            if carried:
                self._lose(stamp_s, "carried elsewhere, or put back: wheels hung in the air")
        for event in events:
            if isinstance(event, LevelChanged):
                self._change_level(stamp_s, event.level)
            else:
                self.mapper.apply(event)
        update = self.slam.update(timed.scan, timed.odometry)
        moved = self._watch.displaced(update, timed.odometry, timed.sighting.hits_base)
        if moved:  # this scan may show both places: the new window begins with the next
            self._lose(stamp_s, moved)
            return
        self.mapper.fit = self._watch.fit
        self.mapper.update(update, self.slam.view(), timed.sighting.hits_base)
        self.scans += 1
        self._publish(self.mapper.view(self.slam.particles()))

    def interrupt(self, stamp_s: float, why: str) -> None:
        """Go on in a new part of the map: nobody knows where the robot drove meanwhile."""
        if self.scans:
            self._lose(stamp_s, why)

    def _hold(self, stamp_s: float) -> None:
        """Wait in the air; whoever looks at the map is told that the pose is worth nothing."""
        if self._lifted_since_s is not None:
            return
        self._lifted_since_s = stamp_s
        self._disown()

    def _disown(self) -> None:
        """Say that the pose published last is worth nothing any more; there is no other yet."""
        view = self._exchange.map_view.get()
        if view is not None:
            self._exchange.map_view.put(replace(view, quality=0.0))

    def _lose(self, stamp_s: float, why: str) -> None:
        """Begin with an empty window, in a part of the map of its own."""
        self._exchange.note(stamp_s, "mapping", why, Level.WARN)
        self._disown()
        self._begin_window()
        self.mapper.lose()

    def _change_level(self, stamp_s: float, level: int) -> None:
        """Begin with an empty window on another level, in the same part of the map."""
        if level == self.mapper.level:
            return
        self._exchange.note(stamp_s, "mapping", f"on level {level} now")
        self._begin_window()
        self.mapper.change_level(level)

    def _begin_window(self) -> None:
        self.slam = self._make_slam()
        self._watch.restart()

    def _publish(self, view: MapView) -> None:
        if view.associated_id != self._associated_id:
            self._associated_id = view.associated_id
            self.mapper.store.commit()  # who plans from a node must find it and its edges in the file
        self._exchange.map_view.put(view)
        if view.lost != self._lost:
            self._lost = view.lost
            self._tell(view)

    def _tell(self, view: MapView) -> None:
        if view.lost:
            text, level = "lost: looking for the place", Level.WARN
        elif self.mapper.known_place:
            text, level = "found again", Level.INFO
        else:
            text, level = "nothing here looks like the map: mapping on as a new part of it", Level.WARN
        self._exchange.note(view.stamp_s, "mapping", text, level)

    def close(self) -> None:
        """Write the map to disk."""
        self.mapper.close()
