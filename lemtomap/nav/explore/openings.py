"""Placeholders: openings kept in the frames of nodes, so that they outlive the window (thesis, 7-2)."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lemtomap import se2
from lemtomap.nav.explore.frontier import Opening
from lemtomap.nav.explore.ground import Ground
from lemtomap.se2 import Pose
from lemtomap.topo.events import NavEvent, OpeningDone, OpeningSeen
from lemtomap.topo.graph import OpeningState, Placeholder

SAME_M = 1.0
"""An opening this near to a known one is that one: it recedes while the robot comes nearer."""
NEWS_M = 0.3
"""The map is told again when an opening moved by this much."""
SHAMS = 3
"""An opening that came and went so often at one place is none: what is remembered of the ground there is not
seen from every side, and the robot would turn to and fro between it and where it wants to go."""
SHAM_M = 0.5
"""So near to where one went it is the same place ..."""
RECEDED_S, RECEDED_M = 2.0, 0.25
"""... but one that went so lately and came again so far from there has receded before the robot."""
GONE_KEPT = 1024


@dataclass(slots=True)
class _Kept:
    placeholder: Placeholder
    told: Placeholder | None = None
    failures: int = 0
    gone: int = 0
    """How often an opening at this place was found explored before ..."""
    gone_s: float = 0.0
    """... and when it was, last."""
    not_before_s: float = 0.0
    reopened: bool = False


class Openings:
    """All placeholders, and the events that keep the topological map's copy up to date."""

    def __init__(self, least_size_m: float = 0.0) -> None:
        self._least_size_m = least_size_m
        self._kept: dict[int, _Kept] = {}
        self._gone: dict[int, _Kept] = {}
        """Explored ones, the last of each place."""
        self._next_id = 1
        self._events: list[NavEvent] = []

    def recall(self, known: Iterable[Placeholder]) -> None:
        """Take over what the map remembers; IDs count on from there."""
        for placeholder in known:
            self._next_id = max(self._next_id, placeholder.placeholder_id + 1)
            if placeholder.state != OpeningState.EXPLORED:
                self._kept[placeholder.placeholder_id] = _Kept(placeholder, placeholder)

    def take_events(self) -> list[NavEvent]:
        """Return what the map is to be told since the last call."""
        events, self._events = self._events, []
        return events

    def of_state(self, state: OpeningState) -> list[Placeholder]:
        """Return the placeholders in one state."""
        return [kept.placeholder for kept in self._kept.values() if kept.placeholder.state == state]

    def ready(self, now_s: float) -> list[Placeholder]:
        """Return the open placeholders worth trying now, which lately failed ones are not."""
        return [
            kept.placeholder
            for kept in self._kept.values()
            if kept.placeholder.state == OpeningState.OPEN and kept.not_before_s <= now_s
        ]

    def get(self, placeholder_id: int) -> Placeholder | None:
        """Return a placeholder that is still kept."""
        kept = self._kept.get(placeholder_id)
        return None if kept is None else kept.placeholder

    def match(
        self,
        openings: Sequence[Opening],
        ground: Ground,
        T_grid_node: Mapping[int, Pose],
        here_id: int,
        now_s: float,
    ) -> None:
        """Join the openings in the window now with those known; drop known ones that turn out explored.

        here_id: the node the robot is at. A closed opening seen within reach later on is tried once more.
        """
        places, gone_places = _places(self._kept, T_grid_node), _places(self._gone, T_grid_node)
        free = dict(places)
        for opening in sorted(openings, key=lambda o: -o.size_m):
            number = _same(opening.p_grid, free, ground)
            if number is not None:
                del free[number]
            elif _same(opening.p_grid, places, ground) is not None:
                continue  # a second piece of an opening already matched
            gone = None if number is not None else self._went_here(opening, gone_places, ground, now_s)
            if number is None and self._is_nothing(opening, gone):
                continue
            known_from = here_id
            if number is not None:
                self._reopen(self._kept[number], now_s)
                known_from = self._kept[number].placeholder.node_id
            node_id = ground.node_in_sight(opening.p_grid, T_grid_node, known_from)
            kept = self._keep(number, opening, node_id, T_grid_node[node_id])
            if gone is not None:
                del gone_places[gone]
                kept.gone = self._gone.pop(gone).gone
        for number, place in free.items():
            kept = self._kept[number]
            if kept.placeholder.state == OpeningState.OPEN and not ground.still_open(place):
                self._explored(number, now_s)

    def _went_here(
        self, opening: Opening, gone_places: Mapping[int, Pose], ground: Ground, now_s: float
    ) -> int | None:
        """Return the explored opening that an opening may be, as it comes again at its place."""
        number = _same(opening.p_grid, gone_places, ground, SHAM_M)
        if number is None or now_s - self._gone[number].gone_s > RECEDED_S:
            return number
        receded_m = float(np.hypot(*(gone_places[number] - opening.p_grid)))
        return number if receded_m <= RECEDED_M else None

    def _is_nothing(self, opening: Opening, gone: int | None) -> bool:
        """Return True if an opening is enough to go on with but too little to begin with, or a sham."""
        return opening.size_m < self._least_size_m or (gone is not None and self._gone[gone].gone >= SHAMS)

    def _reopen(self, kept: _Kept, now_s: float) -> None:
        closed = kept.placeholder.state == OpeningState.CLOSED
        if closed and not kept.reopened and now_s >= kept.not_before_s:
            kept.placeholder = replace(kept.placeholder, state=OpeningState.OPEN)
            kept.reopened, kept.told = True, None

    def _keep(self, number: int | None, opening: Opening, node_id: int, T_grid_node: Pose) -> _Kept:
        """Attach an opening to a node, under its old number or a new one."""
        state = OpeningState.OPEN if number is None else self._kept[number].placeholder.state
        if number is None:
            number, self._next_id = self._next_id, self._next_id + 1
        x, y, yaw = se2.between(T_grid_node, [*opening.p_grid, opening.yaw_grid_rad])
        placeholder = Placeholder(number, node_id, float(x), float(y), float(yaw), opening.size_m, state)
        kept = self._kept.setdefault(number, _Kept(placeholder))
        kept.placeholder = placeholder
        told = kept.told
        moved = told is None or told.node_id != node_id or np.hypot(told.x_m - x, told.y_m - y) > NEWS_M
        if moved:
            kept.told = placeholder
            self._events.append(OpeningSeen(number, node_id, float(x), float(y), float(yaw), opening.size_m))
        return kept

    def failed(self, number: int, now_s: float, *, pause_s: float, attempts: int) -> None:
        """An opening could not be reached: leave it for a while, or for good."""
        kept = self._kept.get(number)
        if kept is None:
            return
        kept.failures += 1
        kept.not_before_s = now_s + pause_s
        if kept.failures >= attempts:
            self._shut(number)

    def spend(self, number: int) -> None:
        """There is nothing more to see from an opening: remember it, so that it is not found again."""
        kept = self._kept.get(number)
        if kept is not None:
            self._events.append(OpeningDone(number, closed=False))
            kept.placeholder = replace(kept.placeholder, state=OpeningState.EXPLORED)

    def _shut(self, number: int) -> None:
        """An opening is closed for good."""
        self._events.append(OpeningDone(number, closed=True))
        kept = self._kept[number]
        kept.placeholder = replace(kept.placeholder, state=OpeningState.CLOSED)

    def _explored(self, number: int, now_s: float) -> None:
        """The ground behind an opening was seen."""
        self._events.append(OpeningDone(number, closed=False))
        kept = self._kept.pop(number)
        kept.gone, kept.gone_s = kept.gone + 1, now_s
        self._gone[number] = kept
        if len(self._gone) > GONE_KEPT:
            del self._gone[next(iter(self._gone))]


def _places(kept: Mapping[int, _Kept], T_grid_node: Mapping[int, Pose]) -> dict[int, Pose]:
    """Return where in the window those openings lie whose nodes are in view."""
    return {
        number: se2.transform(T_grid_node[each.placeholder.node_id], _point(each.placeholder))
        for number, each in kept.items()
        if each.placeholder.node_id in T_grid_node
    }


def _point(placeholder: Placeholder) -> tuple[float, float]:
    return placeholder.x_m, placeholder.y_m


def _same(
    p_grid: tuple[float, float], places: Mapping[int, Pose], ground: Ground, within_m: float = SAME_M
) -> int | None:
    """Return the nearest place that an opening may be; one behind a wall is another one."""
    away = {number: float(np.hypot(*(place - p_grid))) for number, place in places.items()}
    near = sorted((number for number in away if away[number] <= within_m), key=lambda n: away[n])
    return next((number for number in near if not ground.walled_off(places[number], p_grid)), None)
