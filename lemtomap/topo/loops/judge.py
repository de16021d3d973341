"""What a finished search is worth: a sighting or not, how much it counts, and what contradicts a belief."""

from dataclasses import dataclass

import numpy as np

from lemtomap.se2 import Pose, between, compose
from lemtomap.topo.graph import Covariance, chain_covariance, reversed_covariance
from lemtomap.topo.loops.cases import Task
from lemtomap.topo.loops.config import LoopConfig
from lemtomap.topo.loops.hypotheses import Sighting
from lemtomap.topo.loops.matcher import SearchMatch
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
        sees the same frames again, so that only more of the way can tell.
        """
        config = self.config
        company = self.places.company(task.node_id)
        found = 0.0 if company is None else task.reference.found_in(company.points_node, match.T_grid_place)
        along = config.corridor_weight if match.weakest < config.corridor else 1.0
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
