"""The mapping part of the robot: a scan in, a snapshot of the map out. One scan at a time."""

from lemtomap.pipeline import Mapper
from lemtomap.robot.devices.mapped_scan import MappedScan
from lemtomap.robot.exchange import Exchange, NoteLevel, TimedScan
from lemtomap.types import MapView


class MappingStep:
    """Carries the mail between the mailboxes and the mapper."""

    def __init__(self, mapper: Mapper, exchange: Exchange) -> None:
        self.mapper = mapper
        self.scans = 0
        """How many scans went into the map."""
        self._exchange = exchange
        self._published: MapView | None = None
        self._lost = False

    def step(self, timed: TimedScan) -> None:
        """Map one scan and publish what is known now."""
        level, stamp_s = self.mapper.topo.level, timed.scan.stamp_s
        events = () if timed.lifted else tuple(self._exchange.nav_events.drain())
        self._exchange.mapped_scans.put(MappedScan(stamp_s, timed.lifted, events))
        mapped = self.mapper.update(timed.scan, timed.odometry, lifted=timed.lifted, events=events)
        self.scans += mapped.used
        if mapped.displaced:
            self._exchange.note(stamp_s, "mapping", mapped.displaced, NoteLevel.WARN)
        if self.mapper.topo.level != level:
            self._exchange.note(stamp_s, "mapping", f"on level {self.mapper.topo.level} now")
        if mapped.used or self._published is not None:
            self._publish(self.mapper.view())

    def interrupt(self, stamp_s: float, why: str) -> None:
        """Go on in a new part of the map: nobody knows where the robot drove meanwhile."""
        if self.scans:
            self._exchange.note(stamp_s, "mapping", why, NoteLevel.WARN)
            self.mapper.lose()
            self._publish(self.mapper.view())

    def _publish(self, view: MapView) -> None:
        before, self._published = self._published, view
        if view is before:
            return
        self._exchange.map_view.put(view)
        if view.lost != self._lost:
            self._lost = view.lost
            self._tell(view)

    def _tell(self, view: MapView) -> None:
        if view.lost:
            text, level = "lost: looking for the place", NoteLevel.WARN
        elif self.mapper.topo.known_place:
            text, level = "found again", NoteLevel.INFO
        else:
            text, level = "relocalisation failed: starting a separate map component", NoteLevel.WARN
        self._exchange.note(view.stamp_s, "mapping", text, level)

    def close(self) -> None:
        """Write the map to disk."""
        self.mapper.close()
