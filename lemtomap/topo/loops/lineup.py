"""Which places of a map a lost robot searches first: those that look most alike from where it may stand.

A descriptor that forgets where things stand relative to one another ranks what is seen from one spot little
better than chance among places stored by a robot that drove through (the right one of 740 at rank 75, one in
ten beyond 540). So what the index finds is compared bearing by bearing, at every turn, from a raster of
points round each node: the right neighbourhood then comes first, and one in ten later than second.
"""

from collections import OrderedDict, deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lemtomap.topo.kernels import panorama
from lemtomap.topo.loops.config import LocatorConfig
from lemtomap.topo.loops.index import PlaceIndex
from lemtomap.topo.loops.places import PlaceBook, kept

_STEPS_M = np.array([-1.0, -0.5, 0.0, 0.5, 1.0])  # round a node: the next node is a metre off
STANDPOINTS_M = np.stack(np.meshgrid(_STEPS_M, _STEPS_M), axis=-1).reshape(-1, 2)


@dataclass(frozen=True, slots=True)
class _Trial:
    """When a place was searched last, and how often."""

    travelled_m: float
    turned_rad: float
    times: int


NEVER = _Trial(-np.inf, -np.inf, 0)


class LineUp:
    """Rounds of searches: each ranks the places, a slice at a time, and lines up the most alike."""

    def __init__(
        self,
        config: LocatorConfig,
        index: PlaceIndex,
        places: PlaceBook,
        is_known: Callable[[int], bool],
    ) -> None:
        self._config, self._index, self._places, self._is_known = config, index, places, is_known
        self._panoramas: OrderedDict[int, panorama.Ranges] = OrderedDict()
        self._tried: dict[int, _Trial] = {}
        self._view = np.full(panorama.BEARINGS, panorama.UNSEEN, dtype=np.uint8)
        self._at = (0.0, 0.0)
        self._first: tuple[float, float] | None = None
        self._unranked: deque[int] = deque()
        self._ranked: list[tuple[float, int]] = []
        self._queue: deque[int] = deque()
        self._is_whole = False
        self.heard = False
        """Whether all that looked most alike were searched, by a robot that had looked all round."""

    @property
    def is_over(self) -> bool:
        """Whether this round has nothing left to rank or to search."""
        return not self._unranked and not self._queue

    def begin(
        self, points_base: panorama.Values, descriptor: bytes, travelled_m: float, turned_rad: float
    ) -> None:
        """Begin a round with what the robot sees now: float64 (N, 2) points, metres, base frame."""
        config, self._at = self._config, (travelled_m, turned_rad)
        self._first = self._first or self._at
        moved_m, turned = travelled_m - self._first[0], turned_rad - self._first[1]
        self._is_whole = moved_m >= config.all_round_m or turned >= config.all_round_rad
        self._view = panorama.seen(points_base)
        self._ranked.clear()
        for alike in self._index.nearest(descriptor, config.ranked, leaves=config.leaves):
            if self._is_known(alike.node_id) and self._is_due(alike.node_id):
                self._unranked.append(alike.node_id)
        if not self._unranked:
            self._end_round()

    def rank(self, budget: int) -> int:
        """Rank places for about `budget` of work; return the work done."""
        spent = 0
        while self._unranked and spent < budget:
            node_id = self._unranked.popleft()
            spent += self._config.rank_work if node_id in self._panoramas else self._config.panorama_work
            places = kept(self._panoramas, node_id, self._config.ranked, self._look_from)
            unlike = panorama.unlikeness(self._view, places)
            again = self._config.again_unlike * self._tried.get(node_id, NEVER).times
            self._ranked.append((unlike + again, node_id))
        if not self._unranked:
            self._choose()
        return spent

    def next(self) -> tuple[int, int] | None:
        """Return the next place to search and how often it was searched before; None while there is none."""
        if not self._queue:
            return None
        node_id = self._queue.popleft()
        times = self._tried.get(node_id, NEVER).times
        self._tried[node_id] = _Trial(*self._at, times + 1)
        return node_id, times

    def searched(self) -> None:
        """Take note that the search of the latest place is over."""
        if self.is_over:
            self._end_round()

    def _end_round(self) -> None:
        self.heard = self.heard or self._is_whole

    def _is_due(self, node_id: int) -> bool:
        trial, config = self._tried.get(node_id, NEVER), self._config
        moved_m, turned_rad = self._at[0] - trial.travelled_m, self._at[1] - trial.turned_rad
        return moved_m >= config.again_m or turned_rad >= config.again_rad

    def _look_from(self, node_id: int) -> panorama.Ranges:
        points = self._places.points(node_id)
        return panorama.stored(np.empty((0, 2)) if points is None else points, STANDPOINTS_M)

    def _choose(self) -> None:
        """Line up the places most alike, none beside another."""
        config, covered = self._config, set[int]()
        count = config.candidates if self._is_whole else config.first_candidates
        for _, node_id in sorted(self._ranked):
            if node_id not in covered:
                covered.update(self._places.around(node_id, config.spacing_m, 24))
                self._queue.append(node_id)
                if len(self._queue) == count:
                    break
        self._ranked.clear()
