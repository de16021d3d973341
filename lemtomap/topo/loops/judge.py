"""What a finished search is worth: a sighting or not, how much it counts, and what contradicts a belief."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lemtomap.se2 import Pose, between, compose, wrap_angle
from lemtomap.topo.graph import Covariance, chain_covariance, reversed_covariance
from lemtomap.topo.loops.cases import Task
from lemtomap.topo.loops.config import LoopConfig
from lemtomap.topo.loops.hypotheses import Sighting
from lemtomap.topo.loops.matcher import SearchBox, SearchMatch
from lemtomap.topo.loops.pictures import Placed, picture_of, told_apart
from lemtomap.topo.loops.places import LocalSubmap, PlaceBook


@dataclass(frozen=True, slots=True)
class Judge:
    """Weighs matches; keeps nothing."""

    config: LoopConfig
    places: PlaceBook

    def company(self, task: Task) -> LocalSubmap | None:
        """Return what is searched: a place with its neighbours; one on trial alone, who knows whose they
        are.
        """
        return self.places.alone(task.node_id) if task.on_trial else self.places.company(task.node_id)

    def is_sighting(self, match: SearchMatch, task: Task) -> bool:
        """Return True if a place was found: most of it seen, little against it, no other pose as good."""
        config = self.config
        company = self.company(task)
        explained = match.explained * match.known * (0 if company is None else len(company.points_node))
        return (
            match.score >= (config.score if task.way_m >= config.gate.least_way_m else config.slip_score)
            and match.explained >= config.explained
            and match.contradicted <= config.contradicted
            and match.known >= config.known
            and match.weakest >= config.weakest
            and match.rival <= config.rival
            and explained >= config.points
        )

    def sighted(self, match: SearchMatch, task: Task) -> SearchMatch | None:
        """Return a place as found, or as it stands where the graph expects it; None if neither fits."""
        return match if self.is_sighting(match, task) else self._as_expected(match, task)

    def _as_expected(self, match: SearchMatch, task: Task) -> SearchMatch | None:
        """Return a place where the graph expects it, if it fits there as well as anywhere, else None.

        Along one wall a search finds a place anywhere, and none of these poses is unique. But where the
        graph knows the place, one needs no proof: that nearest to where it should be.
        The wall says how far it is away and how it turns; the graph says what the wall does not.
        """
        config, here, company = self.config, task.situation, self.company(task)
        if company is None or here.here_id not in here.measured or task.way_m < config.gate.least_way_m:
            return None
        if not task.box.is_known_within(config.expected_sigma_m):
            return None
        fits = [
            task.reference.refine(company.points_node, seed) for seed in self._along_wall(match, task.box)
        ]
        best = max(each.explained for each in fits)
        as_good = [each for each in fits if each.explained >= best - config.expected_slack]
        nearest = min(as_good, key=lambda each: task.box.off_m(each.T_grid_place))
        explained = nearest.explained * nearest.known * len(company.points_node)
        fits_here = (
            self._is_expected(nearest, task.box)
            and nearest.explained >= max(config.explained, match.explained - config.expected_slack)
            and nearest.contradicted <= config.contradicted
            and nearest.known >= config.known
            and explained >= config.points
            and task.reference.found_in(company.points_node, nearest.T_grid_place) >= config.found
        )
        return nearest if fits_here else None

    def _along_wall(self, match: SearchMatch, box: SearchBox) -> list[Pose]:
        """Return poses along the wall on which a place was found, around where the graph expects it."""
        along = _weak_axis(match)
        off = box.expected[:2] - match.T_grid_place[:2]
        middle = match.T_grid_place[:2] + along * float(along @ off)
        steps_m = np.arange(
            -self.config.expected_m, self.config.expected_m + 1e-9, self.config.expected_step_m
        )
        return [np.array([*(middle + step_m * along), match.T_grid_place[2]]) for step_m in steps_m]

    def _is_expected(self, match: SearchMatch, box: SearchBox) -> bool:
        """Return True if a place is where the graph knows it to be: like door frames are further apart."""
        off_rad = abs(float(wrap_angle(match.T_grid_place[2] - box.expected[2])))
        near = box.off_m(match.T_grid_place) <= self.config.expected_m and off_rad <= self.config.expected_rad
        return near and box.is_known_within(self.config.expected_sigma_m)

    def is_alias(self, match: SearchMatch, task: Task) -> bool:
        """Return True if a place found elsewhere than the graph has it only resembles what is known there.

        A corridor of like rooms shows each place again a door further on. Where the robot's own node is not
        sure the search is wide, for the window may have slipped along; but then what the graph has there must
        fit worse: alone, without its neighbour's walls, the place found must explain what is seen.
        """
        here, config = task.situation, self.config
        if here.here_id in here.measured:
            return False
        known = self.places.around(here.here_id, config.alias_way_m, 192)
        expected = known.get(task.node_id)
        if expected is None or _gap_m(compose(here.T_grid_here, expected), match) <= 2.0 * config.agree_m:
            return False
        at = {n: compose(here.T_grid_here, T) for n, T in known.items() if self.places.has(n)}
        nearest = min(at, key=lambda node_id: _gap_m(at[node_id], match), default=0)
        companies = [self.places.company(node_id) for node_id in (task.node_id, nearest)]
        if companies[0] is None or companies[1] is None or _gap_m(at[nearest], match) > config.alias_near_m:
            return False
        points = task.reference.points_grid
        around = points[np.hypot(*(points - match.T_grid_place[:2]).T) <= config.describe_m]
        found = Placed(picture_of(companies[0], config.match), match.T_grid_place)
        thought = Placed(picture_of(companies[1], config.match), at[nearest])
        own, alien = told_apart(around, found, thought)
        return own < config.alias_points + alien

    def sighting(self, task: Task, match: SearchMatch) -> Sighting:
        """Relate the node found to the node the robot was at."""
        here = task.situation
        T_here_node = between(here.T_grid_here, match.T_grid_place)
        covariance = chain_covariance(
            reversed_covariance(here.T_grid_here, here.covariance), match.T_grid_place, match.covariance
        )
        if match.weakest < self.config.corridor:
            covariance = covariance + self._along(match)
        informs = here.here_id in here.measured and here.here_id != task.node_id
        return Sighting(
            task.node_id,
            match,
            here.here_id,
            T_here_node,
            covariance,
            here.travelled_m,
            informs,
            self._evidence(task, match),
        )

    def _along(self, match: SearchMatch) -> Covariance:
        """Return what a match in a corridor is unsure of along it, beyond its own figures."""
        along = np.zeros(3)
        along[:2] = np.linalg.eigh(match.covariance[:2, :2])[1][:, -1]
        return np.asarray(self.config.corridor_sigma_m**2 * np.outer(along, along))

    def _evidence(self, task: Task, match: SearchMatch) -> float:
        """Return how much a sighting counts: less for each reason to think that it may be chance.

        Along a corridor a place is told by a few door frames, and they repeat; the next metre of travel
        sees the same frames again, so that only more of the way can tell. Frames do not repeat within
        `expected_m` of where the graph knows the place to be.
        """
        config = self.config
        company = self.places.company(task.node_id)
        found = 0.0 if company is None else task.reference.found_in(company.points_node, match.T_grid_place)
        is_proven = match.weakest >= config.corridor or self._is_expected(match, task.box)
        along = 1.0 if is_proven else config.corridor_weight
        doubts = [task.box.surprise(match.T_grid_place) > config.surprise, found < config.found]
        return float(along * 0.5 ** sum(doubts))

    def contradicts(self, task: Task) -> bool:
        """Return True if the window shows something else where a belief says that a place must be."""
        company = self.company(task)
        if company is None or task.T_grid_followed is None:
            return False
        match = task.reference.refine(company.points_node, task.T_grid_followed)
        return match.known >= self.config.known and match.contradicted >= self.config.refuted


def _gap_m(T_grid_node: Pose, match: SearchMatch) -> float:
    return float(np.hypot(*(T_grid_node[:2] - match.T_grid_place[:2])))


def _weak_axis(match: SearchMatch) -> NDArray[np.float64]:
    """Return the direction in which a match is least sure, unit vector float64 (2,), grid frame."""
    x, y = np.linalg.eigh(match.covariance[:2, :2])[1][:, -1]
    cos, sin = np.cos(match.T_grid_place[2]), np.sin(match.T_grid_place[2])
    return np.array([cos * x - sin * y, sin * x + cos * y])
