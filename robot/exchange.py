"""What the three parts of the robot hand to one another: immutable snapshots in mailboxes and bounded queues.

base -> scans -> mapping -> map_view -> navigation -> nav_output -> base
"""

import math
from dataclasses import dataclass, field
from enum import StrEnum

from lemtomap.nav.types import Contact, NavOutput, ObstacleSighting
from lemtomap.robot.devices.mapped_scan import MappedScan
from lemtomap.robot.mailbox import BoundedQueue, Latest
from lemtomap.robot.motion.docking import DockingOutput
from lemtomap.robot.motion.safety import Allowed, Reason
from lemtomap.robot.motion.velocity import Wish
from lemtomap.topo.events import NavEvent
from lemtomap.types import MapView, Odometry, Scan

SCANS_WAITING = 4  # a mapper that is later than this gains nothing from older scans
EVENTS_WAITING = 1000
MAPPED_WAITING = 10_000  # scans in some ten minutes of a stalled disk


@dataclass(frozen=True, slots=True)
class TimedScan:
    """One scan with the odometry that belongs to it."""

    scan: Scan
    odometry: Odometry
    """At the stamp of the scan, that is of its first beam."""
    sighting: ObstacleSighting
    """The same scan, de-skewed by odometry, base frame at the stamp."""
    arrival_s: float
    valid_beams: int
    lifted: bool = False
    """A wheel hung in the air: what odometry says is not true."""


@dataclass(frozen=True, slots=True)
class BaseStatus:
    """How the base is, once per base step; for viewers, recorders and reports."""

    stamp_s: float = -math.inf
    odometry: Odometry | None = None
    wish: Wish | None = None
    sent: Allowed = field(default_factory=lambda: Allowed(0.0, 0.0, Reason.NOT_PERMITTED))
    battery_v: float = math.nan
    battery_percent: float = math.nan
    bumped: bool = False
    charging: bool = False


class NoteLevel(StrEnum):
    """How much a note matters."""

    INFO = "INFO"
    WARN = "WARN"
    ERROR = "ERROR"


@dataclass(frozen=True, slots=True)
class Note:
    """One line for the user and the log."""

    stamp_s: float
    source: str
    text: str
    level: NoteLevel = NoteLevel.INFO


class MissionState(StrEnum):
    """How far a mission is."""

    WAITING = "waiting"
    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"

    @property
    def over(self) -> bool:
        """Return True if nothing more will come."""
        return self in {MissionState.DONE, MissionState.FAILED}


@dataclass(frozen=True, slots=True)
class MissionStatus:
    """What the mission does, in words."""

    stamp_s: float
    state: MissionState
    text: str = ""


@dataclass(frozen=True, slots=True)
class Ended:
    """How a run ended."""

    now_s: float
    state: MissionState
    text: str
    interrupted: bool = False
    """Somebody ended it: Ctrl-C, SIGTERM, a closed terminal."""
    fault: str = ""
    """What ended it beside the mission, such as a full disk."""


class Exchange:
    """The mailboxes, by the name of what lies in them."""

    def __init__(self) -> None:
        self.odometry: Latest[Odometry] = Latest()
        self.scans: BoundedQueue[TimedScan] = BoundedQueue("scans for the mapper", SCANS_WAITING)
        self.sightings: BoundedQueue[ObstacleSighting] = BoundedQueue(
            "sightings for navigation", SCANS_WAITING
        )
        self.contacts: BoundedQueue[Contact] = BoundedQueue("contacts for navigation", EVENTS_WAITING)
        self.nav_events: BoundedQueue[NavEvent] = BoundedQueue("events for the mapper", EVENTS_WAITING)
        self.mapped: Latest[float] = Latest()
        """Stamp of the scan that mapping finished last."""
        self.mapped_scans: BoundedQueue[MappedScan] = BoundedQueue(
            "mapped scans for the recorder", MAPPED_WAITING
        )
        self.map_view: Latest[MapView] = Latest()
        self.cycle: Latest[float] = Latest()
        """When navigation began its latest cycle."""
        self.nav_output: Latest[NavOutput] = Latest()
        self.dock: Latest[bool] = Latest()
        """True: drive onto the charging dock."""
        self.docking: Latest[DockingOutput] = Latest()
        """How that stands."""
        self.base_status: Latest[BaseStatus] = Latest()
        self.mission: Latest[MissionStatus] = Latest()
        self.notes: BoundedQueue[Note] = BoundedQueue("notes for the user", EVENTS_WAITING)
        self.last_scan: Latest[TimedScan] = Latest()

    def note(self, stamp_s: float, source: str, text: str, level: NoteLevel = NoteLevel.INFO) -> None:
        """Leave a line for the user."""
        self.notes.put(Note(stamp_s, source, text, level))

    def dropped(self) -> dict[str, int]:
        """Return what each queue has lost because its reader was too slow."""
        queues = (self.scans, self.sightings, self.contacts, self.nav_events, self.notes)
        return {queue.name: queue.dropped for queue in queues}
