"""Where in a known map is this? Start anywhere, carried elsewhere, lost (thesis, section 7-2).

The robot maps on as if the place were new; meanwhile what it sees is searched for in the places of the rest
of the map, those most alike first (panorama), a slice per scan. Each pose found is a guess that stands in the
window, and is looked at again as the robot moves: does everything seen lie on what is stored, and does
nothing stored lie where the robot looked through? The one guess that keeps fitting where all others fail, or
that explains what others never make up for, is where it is.
Two that fit alike are two: then the robot stays lost, for a wrong answer is worse than none.
"""

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import NDArray

from lemtomap.se2 import (
    Pose,
    between,
    compose,
    inverse,
    transform,
)
from lemtomap.topo.file.paging import PagedGraph, chain
from lemtomap.topo.kernels import fitting
from lemtomap.topo.loops.config import LocatorConfig, LoopConfig
from lemtomap.topo.loops.descriptor import describe
from lemtomap.topo.loops.index import PlaceIndex
from lemtomap.topo.loops.lineup import LineUp
from lemtomap.topo.loops.matcher import (
    Reference,
    Search,
    SearchBox,
    SearchMatch,
)
from lemtomap.topo.loops.pictures import Placed, picture_of, told_apart
from lemtomap.topo.loops.places import LocalSubmap, PlaceBook, kept
from lemtomap.topo.recognition import Found, Situation
from lemtomap.types import GridView

Points = NDArray[np.float64]
RECENT = 3  # checks that tell how well a guess fits
PICTURES_KEPT = 16  # 0.3 MB each


@dataclass(frozen=True, slots=True)
class WindowSnapshot:
    """What the robot sees at one moment."""

    T_grid_base: Pose
    travelled_m: float
    turned_rad: float
    grid: GridView
    points_grid: Points
    """Averaged hits in the window, float64 (N, 2), metres."""

    @classmethod
    def of(cls, situation: Situation) -> Self:
        """Look round in a situation."""
        return cls(
            situation.T_grid_base,
            situation.travelled_m,
            situation.turned_rad,
            situation.grid,
            situation.points_grid(),
        )


@dataclass(slots=True, eq=False)
class Guess:
    """One belief about where this is: a known node, and where in the window it stands then."""

    node_id: int
    T_grid_node: Pose
    fits: list[float] = field(default_factory=list)
    """How well each check bore it out, 1 for a perfect fit."""
    match: SearchMatch | None = None
    from_m: float = 0.0
    """Way of the robot at the first check."""
    from_rad: float = 0.0

    @property
    def fit(self) -> float:
        """Mean fit of the latest checks: what is seen now decides, most was seen from there too."""
        return float(np.mean(self.fits[-RECENT:]))


class Locator:
    """Finds one robot that does not know where it is. Thrown away once it has."""

    def __init__(
        self, config: LoopConfig, graph: PagedGraph, index: PlaceIndex, is_known: Callable[[int], bool]
    ) -> None:
        """`is_known` tells the nodes of the map's other parts from those made since the robot got lost."""
        self.config: LocatorConfig = config.locator
        self._loops = config
        self._graph = graph
        self.places = PlaceBook(graph, config.company_m, config.search_points, kept=128)
        self.guesses: list[Guess] = []
        self.searched = 0
        self.line_up = LineUp(self.config, index, self.places, is_known)
        self._search: tuple[int, _View, Search] | None = None
        self._pictures: OrderedDict[int, Reference] = OrderedDict()
        self._view: _View | None = None

    def due(self, travelled_m: float, turned_rad: float) -> bool:
        """Return True if the robot has moved enough for another look."""
        seen = None if self._view is None else self._view.look
        return seen is None or (
            travelled_m - seen.travelled_m >= self.config.look_m
            or turned_rad - seen.turned_rad >= self.config.look_rad
        )

    def look(self, look: WindowSnapshot) -> None:
        """Check all guesses against what is seen now, and line up the places to search."""
        self._view = view = _View(look, self._loops, self.config)
        for guess in self.guesses:
            self._check(guess, view)
        self.guesses = [guess for guess in self.guesses if guess.fit >= self.config.alive]
        self._unite()
        if view.has_structure and self.line_up.is_over and self._search is None:
            self.line_up.begin(view.all_round_base, view.descriptor, look.travelled_m, look.turned_rad)

    def update(self, budget: int) -> Found | None:
        """Search on for a slice (bound evaluations); return where the robot is once that is certain."""
        while budget > 0 and (self._search is not None or not self.line_up.is_over):
            budget -= self._work(budget)
        return self._certain()

    # -- searching
    # --------------------------------------------------------------------------------------------

    def _work(self, budget: int) -> int:
        """Do a slice of the search under way, or begin the next; return the work spent."""
        if self._search is None:
            return self._begin_search() or self.line_up.rank(budget)
        node_id, view, search = self._search
        before = search.work
        if search.advance(budget):
            self._search = None
            self._take(node_id, view, search)
            self.line_up.searched()
        return max(1, search.work - before)

    def _begin_search(self) -> int:
        """Take up the next place lined up; return the work of reading it, 0 when none is."""
        chosen, view = self.line_up.next(), self._view
        if chosen is None or view is None:
            return 0
        node_id, times = chosen
        company = self.places.company(node_id)
        if company is None or len(company.points_node) < self._loops.points:
            self.line_up.searched()
            return 1
        half_m = self.config.box_m
        box = SearchBox(np.zeros(3), half_m, half_m, np.pi)
        least = 0.0 if times else self.config.first_score
        self._search = node_id, view, Search(self._picture(company), view.search_points, box, least)
        self.searched += 1
        return self.config.picture_work

    def _picture(self, company: LocalSubmap) -> Reference:
        """Return a stored place as the fixed side of a search: walls, and nothing known of the rest."""
        return kept(
            self._pictures, company.node_id, PICTURES_KEPT, lambda _: picture_of(company, self.config.match)
        )

    def _take(self, node_id: int, view: "_View", search: Search) -> None:
        """Make guesses of the best pose of a search and of its runner-up."""
        if search.match is None:
            return
        found = [search.match.T_grid_place]
        if search.rival is not None:
            found.append(search.rival)
        for T_node_base in found:
            T_grid_node = compose(view.look.T_grid_base, inverse(T_node_base))
            guess = Guess(node_id, T_grid_node, [], None, view.look.travelled_m, view.look.turned_rad)
            self._check(guess, view)
            if guess.fit >= self.config.plausible:
                self._enter(guess, self.guesses)

    # -- guesses
    # ----------------------------------------------------------------------------------------------

    def _check(self, guess: Guess, view: "_View") -> None:
        """Go over to the known node nearest to the robot, align it, and see how well all fits."""
        near = self._nearest(guess, view)
        if near is not None:
            guess.node_id, guess.T_grid_node = near
        company = self.places.company(guess.node_id)
        if company is None:
            guess.fits.append(0.0)
            return
        match = view.reference.refine(company.points_node, guess.T_grid_node)
        off = between(guess.T_grid_node, match.T_grid_place)
        steady = np.hypot(off[0], off[1]) <= self._loops.agree_m and abs(off[2]) <= self._loops.agree_rad
        if steady:
            guess.match, guess.T_grid_node = match, match.T_grid_place
        fit = view.explained_by(self._picture(company), guess.T_grid_node) - match.contradicted
        guess.fits.append(fit if steady else 0.5 * fit)

    def _nearest(self, guess: Guess, view: "_View") -> tuple[int, Pose] | None:
        """Return the known node nearest to the robot under this guess, and where it stands."""
        near = self._nearest_within(guess, view, self.config.follow_m, 48)
        if near is None or _gap_m(near[1], view) > self.config.near_m:
            near = self._nearest_within(guess, view, self.config.far_m, 192) or near
        return near

    def _nearest_within(
        self, guess: Guess, view: "_View", way_m: float, limit: int
    ) -> tuple[int, Pose] | None:
        best: tuple[int, Pose] | None = None
        best_m = np.inf
        for node_id, T_node_other in self.places.around(guess.node_id, way_m, limit).items():
            at = compose(guess.T_grid_node, T_node_other)
            gap_m = _gap_m(at, view)
            if gap_m < best_m and self.places.descriptor(node_id) is not None:
                best, best_m = (node_id, at), gap_m
        return best

    def _enter(self, guess: Guess, guesses: list[Guess]) -> None:
        """Add a guess, unless one that has been checked longer and fits about as well is the same place.

        One that fits clearly better takes its place, and has all checks before it: the other may stand on the
        far face of a wall, from where no alignment moves it.
        """
        alike = [other for other in guesses if self._same(guess, other)]
        if all(guess.fit - other.fit >= self.config.margin for other in alike):
            guesses[:] = [*(other for other in guesses if other not in alike), guess]

    def _same(self, a: Guess, b: Guess) -> bool:
        """Return True if two guesses put the robot at the same place of the map."""
        T_a_b = self.places.around(a.node_id, self.config.follow_m, 48).get(b.node_id)
        if T_a_b is None:
            return False
        off = between(compose(a.T_grid_node, T_a_b), b.T_grid_node)
        return bool(
            np.hypot(off[0], off[1]) <= 2.0 * self._loops.agree_m
            and abs(off[2]) <= 2.0 * self._loops.agree_rad
        )

    def _same_by_far(self, best: Guess, other: Guess) -> bool:
        """Return True if a guess as good as the best is the same place, mapped twice and not yet joined.

        The graph then puts both nodes where the guesses do, up to the drift on the way from one to the other.
        """
        if other.fit <= best.fit - self.config.margin:
            return False
        reached = self._graph.reach(best.node_id, self.config.drift_way_m, self.config.drift_nodes)
        if other.node_id not in reached:
            return False
        way_m = reached[other.node_id].distance_m
        expected = compose(best.T_grid_node, chain(reached)[other.node_id])
        off = between(expected, other.T_grid_node)
        off_m, off_rad = float(np.hypot(off[0], off[1])), abs(float(off[2]))
        slack_m = 2.0 * self._loops.agree_m + self.config.drift_m_per_m * way_m
        slack_rad = 2.0 * self._loops.agree_rad + self.config.drift_rad_per_m * way_m
        return off_m <= slack_m and off_rad <= slack_rad

    def _unite(self) -> None:
        """Keep the best guesses, each place once."""
        kept: list[Guess] = []
        for guess in sorted(self.guesses, key=lambda each: (-len(each.fits), -each.fit)):
            self._enter(guess, kept)
        self.guesses = sorted(kept, key=lambda each: -each.fit)[: self.config.guesses]

    def _certain(self) -> Found | None:
        """Return the guess that keeps fitting while no other does; None while there is doubt."""
        config, view = self.config, self._view
        if view is None or not self.guesses or not self.line_up.heard:
            return None
        best, *others = sorted(self.guesses, key=lambda guess: -guess.fit)
        rivals = [other for other in others if not self._same_by_far(best, other)]
        lead = min((best.fit - rival.fit for rival in rivals), default=1.0)
        weakest = self._loops.weakest * (0.5 if lead >= config.margin else 1.0)
        if best.match is None or not self._is_sound(best, best.match, view, weakest):
            return None
        if not all(self._beats(best, rival, view) for rival in rivals):
            return None
        needed_m = config.moved_m * (0.5 if lead >= config.clear_margin else 1.0)
        moved_m = view.look.travelled_m - best.from_m
        if moved_m < needed_m and view.look.turned_rad - best.from_rad < config.moved_rad:
            return None
        return Found(best.node_id, best.T_grid_node, best.match.covariance)

    def _beats(self, best: Guess, rival: Guess, view: "_View") -> bool:
        """Return True if a guess fits clearly better, or alone explains what the other never makes up for."""
        if best.fit - rival.fit >= self.config.margin:
            return True
        one, other = self._seen_in(best), self._seen_in(rival)
        if one is None or other is None:
            return False
        own, alien = told_apart(transform(view.look.T_grid_base, view.points_base), one, other)
        return own >= self.config.alone and own >= self.config.alone_times * alien

    def _seen_in(self, guess: Guess) -> Placed | None:
        company = self.places.company(guess.node_id)
        return None if company is None else Placed(self._picture(company), guess.T_grid_node)

    def _is_sound(self, guess: Guess, match: SearchMatch, view: "_View", weakest: float) -> bool:
        """Return True if a guess has borne every check of late, on walls that hold it in every direction.

        weakest: share of the strongest direction's information on the weakest, at least. Along a corridor
        little more than door posts hold it; where another place would have fitted, it was a guess as well.
        """
        return (
            len(guess.fits) >= self.config.checks
            and min(guess.fits[-RECENT:]) >= self.config.fit
            and match.weakest >= weakest
            and match.explained * match.known * len(view.points_base) >= self._loops.points
        )


class _View:
    """One look, made ready: the window as a reference, and what stands around the robot in its frame."""

    def __init__(self, look: WindowSnapshot, loops: LoopConfig, config: LocatorConfig) -> None:
        self.look = look
        self.reference = Reference(look.grid, look.points_grid, loops.match)
        points = transform(inverse(look.T_grid_base), look.points_grid)
        self.all_round_base: Points = np.ascontiguousarray(points)
        self.points_base: Points = points[np.hypot(points[:, 0], points[:, 1]) <= config.view_m]
        self.search_points = np.ascontiguousarray(self.points_base[_every(len(self.points_base), config)])
        around = np.abs(points).max(axis=1, initial=0.0) <= loops.describe_m
        self.descriptor = describe(points[around])
        self.has_structure = len(self.points_base) >= loops.points

    def explained_by(self, picture: Reference, T_grid_node: Pose) -> float:
        """Return the share of what is seen that lies on the walls of a stored place."""
        T_node_base = between(T_grid_node, self.look.T_grid_base)
        origin_m, points = picture.grid.origin_m, self.search_points
        hit, _, _ = fitting.tally(points, T_node_base, picture.field, *origin_m, picture.cell_m)
        return float(hit / max(1, len(points)))


def _gap_m(T_grid_node: Pose, view: _View) -> float:
    x_m, y_m, _ = (T_grid_node - view.look.T_grid_base).tolist()
    return float(np.hypot(x_m, y_m))


def _every(count: int, config: LocatorConfig) -> NDArray[np.int64]:
    stride = max(1.0, count / config.view_points)
    return np.unique(np.minimum(np.arange(0.0, count, stride), count - 1).astype(np.int64))
