"""The mapping half of the thesis' figure 3-1: a scan meets the window, then the topological map.

scan, odometry -> window SLAM -> was the robot moved? -> topological SLAM -> recognised places -> map view
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Self

from lemtomap.areas.segmentation import AreaSegmenter
from lemtomap.displacement import Watch
from lemtomap.grid import DEFAULT_SLAM, SLAMS, GridSlam, SlamConfig
from lemtomap.samples import as_finite, as_whole, check_kind
from lemtomap.topo.config import TopoConfig
from lemtomap.topo.events import LevelChanged, NavEvent
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.loops import LoopRecogniser
from lemtomap.topo.loops.config import LoopConfig
from lemtomap.topo.mapper import TopoMapper
from lemtomap.types import (
    GridView,
    MapView,
    Odometry,
    Scan,
    SlamUpdate,
)


@dataclass(frozen=True, slots=True)
class Mapped:
    """What became of one scan."""

    slam: SlamUpdate | None = None
    """What it told the window SLAM; None for one taken in the air."""
    displaced: str = ""
    """Why somebody must have moved the robot, empty when nobody has: the map goes on in a part of its own."""
    used: bool = False
    """Whether it went into the map."""


class Mapper:
    """Scan and odometry in, map view out. Owned by the mapping thread.

    Holds: a robot that was carried or pushed away begins with an empty window, in a part of the map that only
    a recognised place joins to the rest.
    """

    def __init__(self, make_slam: Callable[[], GridSlam], topo: TopoMapper, *, watched: bool = True) -> None:
        """`make_slam` makes a window SLAM, one for each window begun anew. `watched`: where wheels and laser
        say different things, somebody may have moved the robot. Not so on a recorded drive whose wheels leap
        and whose scans are stamped late (in ACES and Killian Court laser and wheels differ by up to 0.2 rad
        from one scan to the next), nor in a metric layer that keeps all of its grid.
        """
        self.topo = topo
        self._make_slam = make_slam
        self._slam = make_slam()
        self._watch = Watch(topo.config.watch)
        self._is_watched = watched
        self._grid: GridView | None = None
        self._disowned: MapView | None = None
        """The last view, worth nothing any more, until there is another."""

    @classmethod
    def open(
        cls,
        path: Path | str,
        *,
        slam: SlamConfig | None = None,
        topo: TopoConfig | None = None,
        loops: LoopConfig | None = None,
        seed: int = 0,
        watched: bool = True,
    ) -> Self:
        """Map into a file with the default window SLAM: a new one, or a map to go on with.

        In a map to go on with the robot may stand anywhere; it is `lost` until it recognises a place. `seed`:
        of all that is random; the same samples and seed make the same map. `watched`: as in the constructor.
        Raises BadMap, BadSetting, and BadSample for arguments that are none.
        """
        check_kind("Mapper.open: path", path, str, Path)
        as_whole("Mapper.open: seed", seed)
        check_kind("Mapper.open: slam", slam, SlamConfig, type(None))
        check_kind("Mapper.open: topo", topo, TopoConfig, type(None))
        check_kind("Mapper.open: loops", loops, LoopConfig, type(None))
        known = Path(path).exists()
        store = (TopoStore.open if known else TopoStore.create)(path)
        make_slam = partial(SLAMS[DEFAULT_SLAM], slam or SlamConfig(), seed)
        recogniser, areas = LoopRecogniser(loops), AreaSegmenter()
        mapper = TopoMapper(topo or TopoConfig(), store, recogniser=recogniser, areas=areas)
        return cls(make_slam, mapper, watched=watched)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        """Write everything, also what an exception leaves half way."""
        self.close()

    def update(
        self,
        scan: Scan,
        odometry: Odometry,
        *,
        lifted: bool = False,
        events: Iterable[NavEvent] = (),
    ) -> Mapped:
        """Use one scan; odometry is the base at the scan's stamp, and at each beam where that is known.

        lifted: the wheels hang in the air; events: what navigation found out since the scan before.
        Raises BadSample for what is no scan or no odometry, and a pose that is not finite.
        """
        check_kind("Mapper.update: scan", scan, Scan)
        check_kind("Mapper.update: odometry", odometry, Odometry)
        as_finite("Odometry.T_odom_base", odometry.T_odom_base)
        if lifted:  # nothing is mapped there
            self._watch.lift(scan.stamp_s)
            self._disown()
            return Mapped()
        carried = self._watch.put_down(scan.stamp_s)
        if carried:
            self.lose()
        for event in events:
            self._apply(event)
        slam = self._slam.update(scan, odometry)
        hits = self._slam.points_base()
        moved = self._watch.displaced(slam, odometry, hits) if self._is_watched else ""
        if moved:  # this scan may show both places: the new window begins with the next
            self.lose()
            return Mapped(slam, moved)
        if self._grid is None or slam.integrated:
            self._grid = self._slam.view()  # between integrations the window does not change
        self.topo.update(slam, self._grid, hits, self._watch.fit)
        self._disowned = None
        return Mapped(slam, carried, used=True)

    def view(self) -> MapView:
        """Return an immutable snapshot, of quality 0 while the robot is in the air or was just moved.

        Raises NotStarted before the first scan.
        """
        return self._disowned or self.topo.view(self._slam.particles())

    def close(self) -> None:
        """Write everything and close the map file."""
        self.topo.close()

    def _apply(self, event: NavEvent) -> None:
        if not isinstance(event, LevelChanged):
            self.topo.apply(event)
        elif event.level != self.topo.level:
            self._begin_window()
            self.topo.change_level(event.level)

    def lose(self) -> None:
        """Begin with an empty window, in a part of the map of its own."""
        self._disown()
        self._begin_window()
        self.topo.lose()

    def _disown(self) -> None:
        if self._disowned is None and self.topo.started:
            self._disowned = replace(self.view(), quality=0.0)

    def _begin_window(self) -> None:
        self._slam, self._grid = self._make_slam(), None
        self._watch.restart()
