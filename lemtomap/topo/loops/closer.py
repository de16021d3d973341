"""Explicit topological loop closing (thesis, section 3-3-2), in slices beside the mapping.

At each new or re-entered node: which known places may lie here, given how unsure the graph is (outlook) and
what the surroundings look like (descriptors)? Each is searched in a snapshot of the window, a slice per
update. What is found is a sighting; sightings gather into hypotheses; a certain one becomes a closure.
"""

from collections import deque
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from lemtomap.se2 import Pose, between, compose
from lemtomap.topo.file.paging import PagedGraph, chain
from lemtomap.topo.loops.audit import Audit
from lemtomap.topo.loops.candidates import (
    ranked,
    search_box,
    spaced,
    way_m,
)
from lemtomap.topo.loops.cases import Task
from lemtomap.topo.loops.config import LoopConfig
from lemtomap.topo.loops.hypotheses import Hypotheses, Hypothesis
from lemtomap.topo.loops.judge import Judge
from lemtomap.topo.loops.matcher import (
    Reference,
    Search,
    SearchBox,
    SearchMatch,
)
from lemtomap.topo.loops.outlook import GraphUncertainty
from lemtomap.topo.loops.places import PlaceBook
from lemtomap.topo.recognition import (
    Closed,
    Closure,
    Confirmed,
    Found,
    Situation,
)
from lemtomap.types import EdgeType

TRIALS_KEPT = 4096


class LoopCloser:
    """Finds where the robot has been before. Owned by the mapping thread."""

    def __init__(self, config: LoopConfig, graph: PagedGraph) -> None:
        self.config = config
        self.graph = graph
        self.places = PlaceBook(graph, config.company_m, config.search_points)
        self.hypotheses = Hypotheses(config, lambda node_id: self.places.around(node_id, 20.0, 96))
        self._judge = Judge(config, self.places)
        self.audit = Audit(graph, config.audit, config.gate)
        self.searched = 0
        self.work = 0
        self.confirmed: list[Confirmed] = []
        self._outlook: GraphUncertainty | None = None
        self._counted: GraphUncertainty | None = None
        self._apart = False
        self._since_outlook = 0
        self._tasks: deque[Task] = deque()
        self._tried: dict[int, float] = {}
        self._heard: dict[int, float] = {}
        self.log: Callable[[str], None] | None = None

    def place_taken(self, node_id: int) -> None:
        """Take note that a node's localisation data is new or renewed."""
        self.places.forget(node_id)

    def restart(self) -> None:
        """Begin anew: the robot is in another part of the graph now, or two parts were joined."""
        self.hypotheses.alive.clear()
        self._tasks.clear()
        self._tried.clear()
        self._outlook = None
        self.places.forget()

    def is_joined(self, node_id: int) -> bool:
        """Return True if a node hangs together with the robot's; True while that is not known."""
        outlook = self._outlook
        return outlook is None or not outlook.done or node_id in outlook

    def sees_parts_apart(self) -> bool:
        """Return True if the map has parts not joined to the robot's; asked once for each outlook."""
        outlook = self._outlook
        if outlook is None or not outlook.done or len(outlook) >= self.config.gate.outlook_nodes:
            return False
        if self._counted is not outlook:
            self._counted = outlook
            self._apart = self.graph.store.count("node") > len(outlook)
        return self._apart

    def at_node(self, situation: Situation) -> None:
        """Look for known places here: call when a node was made or became the associated one."""
        points_grid = situation.points_grid()
        self._renew_outlook(situation.here_id)
        self.hypotheses.drop_old(situation.travelled_m)
        chosen = self._candidates(situation, points_grid)
        if situation.here_id not in situation.measured and self.places.has(situation.here_id):
            chosen.insert(0, situation.here_id)
        self._call_witness(situation, points_grid)
        if not chosen and not self.hypotheses.alive:
            return
        reference: Reference | None = None
        followed = self._followed(situation)
        for node_id in dict.fromkeys([*followed, *chosen]):
            self._note_trial(node_id, situation.travelled_m)
            box = self._box(situation, node_id)
            if box is None:
                continue
            reference = reference or Reference(situation.grid, points_grid, self.config.match)
            over_edges_m = way_m(self._outlook, situation.here_id, node_id)
            task = Task(node_id, situation, reference, box, over_edges_m)
            task.follows, task.T_grid_followed = followed.get(node_id, (None, None))
            self._tasks.append(task)
        while len(self._tasks) > 4 * self.config.hearing:
            self._tasks.popleft()

    def update(self) -> Closed | None:
        """Work a slice; return the closures that became certain."""
        if self._outlook is not None:
            self._outlook.advance(self.config.gate.outlook_per_update)
        self.audit.advance(self.config.gate.outlook_per_update)
        budget = self.config.budget
        while self._tasks and budget > 0:
            budget -= self._work(self._tasks[0], budget)
        hypothesis = self.hypotheses.certain()
        return None if hypothesis is None else self._commit(hypothesis)

    def _call_witness(self, situation: Situation, points_grid: NDArray[np.float64]) -> None:
        """Search a place that must be near the robot by closures alone."""
        audit, here_id = self.config.audit, situation.here_id
        if here_id not in situation.measured:
            return
        reached = self.graph.reach(here_id, audit.way_m, 96)
        if all(each.via is None or each.via.type is not EdgeType.LOOP_CLOSING for each in reached.values()):
            return
        best_id, best_m, witnesses = 0, audit.near_m, []
        for node_id, T_here_node in chain(reached).items():
            if node_id in situation.measured or not self.places.has(node_id):
                continue
            at = compose(situation.T_grid_here, T_here_node)
            gap_m = float(np.hypot(*(at[:2] - situation.T_grid_base[:2])))
            if gap_m < best_m and (crossed := self.audit.crossed(reached, node_id)):
                best_id, best_m, witnesses, T_grid_best = node_id, gap_m, crossed, at
        if not best_id or situation.travelled_m - self._heard.get(best_id, -np.inf) < audit.apart_m:
            return
        self._heard[best_id] = situation.travelled_m
        gate = self.config.gate
        box = SearchBox(T_grid_best, gate.least_box_m, gate.least_box_m, gate.least_box_rad)
        reference = Reference(situation.grid, points_grid, self.config.match)
        task = Task(best_id, situation, reference, box, 0.0)
        task.on_trial, task.T_grid_followed = tuple(witnesses), T_grid_best
        self._tasks.append(task)

    # -- which places
    # -----------------------------------------------------------------------------------------

    def _renew_outlook(self, here_id: int) -> None:
        self._since_outlook += 1
        outlook = self._outlook
        if outlook is None or self._since_outlook > self.config.gate.renew_after:
            self._outlook = GraphUncertainty(self.graph, here_id, self.config.gate)
            self._since_outlook = 0
            self._outlook.advance(200)
        elif here_id not in outlook:
            outlook.extend(here_id)

    def _candidates(self, situation: Situation, points_grid: NDArray[np.float64]) -> list[int]:
        """Return the places worth a search here, most promising first."""
        config, outlook, now_m = self.config, self._outlook, situation.travelled_m
        if outlook is None:
            return []
        sure, unsure = self._ranked(outlook, situation, points_grid)
        sure = [n for n in sure if now_m - self._tried.get(n, -np.inf) >= config.again_after_m]
        chosen = spaced(outlook, situation.here_id, sure, config.candidates, config.spacing_m, config.gate)
        if unsure:
            tried = [n for n, at_m in self._tried.items() if now_m - at_m < config.gate.widest_m]
            chosen += spaced(
                outlook,
                situation.here_id,
                unsure,
                config.candidates,
                config.gate.reach_m,
                config.gate,
                tried,
            )
        return chosen

    def _ranked(
        self, outlook: GraphUncertainty, situation: Situation, points_grid: NDArray[np.float64]
    ) -> list[list[int]]:
        """Return the known places on this level that may lie here: sure ones, and unsure ones."""
        level = self.graph.node(situation.here_id).level
        found = ranked(outlook, situation, points_grid, self.places, self.config)
        return [[n for n in node_ids if self.graph.node(n).level == level] for node_ids in found]

    def _note_trial(self, node_id: int, travelled_m: float) -> None:
        """Remember when a place was tried, for as long as that keeps it from being tried again."""
        self._tried[node_id] = travelled_m
        if len(self._tried) > TRIALS_KEPT:
            since_m = travelled_m - max(self.config.again_after_m, self.config.gate.widest_m)
            self._tried = {tried_id: at_m for tried_id, at_m in self._tried.items() if at_m > since_m}

    def _followed(self, situation: Situation) -> dict[int, tuple[Hypothesis, Pose]]:
        """Return the known node that should be nearest to the robot by each hypothesis, and where in the
        window.
        """
        chosen: dict[int, tuple[Hypothesis, Pose]] = {}
        for hypothesis in self.hypotheses.alive:
            seen = hypothesis.latest
            base = situation.T_grid_base
            best, best_m, T_grid_best = 0, np.inf, base
            for node_id, T_seen_node in self.places.around(seen.node_id, 12.0, 48).items():
                at = compose(seen.match.T_grid_place, T_seen_node)
                gap_m = float(np.hypot(at[0] - base[0], at[1] - base[1]))
                if gap_m < best_m and node_id not in situation.measured and self.places.has(node_id):
                    best, best_m, T_grid_best = node_id, gap_m, at
            if best and situation.travelled_m - self._tried.get(best, -np.inf) >= 0.5 * self.config.apart_m:
                chosen.setdefault(best, (hypothesis, T_grid_best))
        return chosen

    def _box(self, situation: Situation, node_id: int) -> SearchBox | None:
        """Return where to search a node in the window; None where that is nowhere."""
        outlook = self._outlook
        return None if outlook is None else search_box(outlook, situation, node_id, self.config.gate)

    # -- searching
    # --------------------------------------------------------------------------------------------

    def _work(self, task: Task, budget: int) -> int:
        """Do a slice of the first task; return the work spent."""
        if task.search is None:
            company = self._judge.company(task)
            if company is None:
                self._tasks.popleft()
                return 1
            task.search = Search(task.reference, company.search_points, task.box)
            self.searched += 1
        before = task.search.work
        done = task.search.advance(budget)
        spent = task.search.work - before
        self.work += spent
        if done:
            self._tasks.popleft()
            self._conclude(task)
        return max(1, spent)

    def _conclude(self, task: Task) -> None:
        """Make a sighting of what a finished search found, and hear the others when it is a new belief."""
        match = task.search.match if task.search is not None else None
        if task.on_trial:
            self._testify(task, match)
            return
        hypothesis = None
        match = None if match is None else self._judge.sighted(match, task)
        if match is not None and self._is_news(match, task):
            hypothesis = self.hypotheses.add(self._judge.sighting(task, match))
            if self.log:
                self.log(
                    f"sighting {task.situation.here_id}->{task.node_id} n={len(hypothesis.sightings)} {match}"
                )
            if len(hypothesis.sightings) == 1:
                hypothesis.needed = self.config.sightings + int(task.box.is_cut)
                self._hear(task, hypothesis)
        if task.follows is not None and hypothesis is not task.follows and self._judge.contradicts(task):
            task.follows.rejected += 1
        if task.hearing_for is not None and not any(t.hearing_for is task.hearing_for for t in self._tasks):
            task.hearing_for.heard = True

    def _is_news(self, match: SearchMatch, task: Task) -> bool:
        """Return True if a place stands where the mapper does not have it anyway."""
        return not self._confirms(match, task) and not self._judge.is_alias(match, task)

    def _testify(self, task: Task, match: SearchMatch | None) -> None:
        """Let a place speak for or against the closures by which it must be here; silent when unsure."""
        if match is not None and self._judge.is_sighting(match, task):
            if match.weakest >= self.config.corridor:
                self.audit.hear(task.on_trial, agrees=True)
        elif self._judge.contradicts(task):
            if self.log:
                self.log(f"witness against {task.situation.here_id}~{task.node_id} {match}")
            self.audit.hear(task.on_trial, agrees=False)

    def _confirms(self, match: SearchMatch, task: Task) -> bool:
        """Take a search for the associated node that found it where it was thought to be."""
        situation = task.situation
        if task.node_id != situation.here_id:
            return False
        off = between(situation.T_grid_here, match.T_grid_place)
        near = np.hypot(off[0], off[1]) <= self.config.agree_m and abs(off[2]) <= self.config.agree_rad
        if near:
            self.confirmed.append(Confirmed(Found(task.node_id, match.T_grid_place, match.covariance)))
        return bool(near)

    def _hear(self, task: Task, hypothesis: Hypothesis) -> None:
        """Search every other place within the gate before the belief may become certain."""
        config, situation, outlook = self.config, task.situation, self._outlook
        heard = []
        if outlook is not None:
            same = self.places.around(task.node_id, config.company_m, 48)
            for spacing_m, places in zip(
                (config.spacing_m, config.gate.reach_m),
                self._ranked(outlook, situation, task.reference.points_grid),
                strict=True,
            ):
                others = [node_id for node_id in places if node_id not in same]
                heard += spaced(outlook, situation.here_id, others, config.hearing, spacing_m, config.gate)
        for node_id in heard:
            box = self._box(situation, node_id)
            if box is not None:
                over_edges_m = way_m(outlook, situation.here_id, node_id)
                self._tasks.append(Task(node_id, situation, task.reference, box, over_edges_m, hypothesis))
        hypothesis.heard = not heard

    def _commit(self, hypothesis: Hypothesis) -> Closed:
        """Make a certain hypothesis closures, one for each sighting, and start with a fresh outlook."""
        closures = tuple(
            Closure(s.here_id, s.T_here_node, s.covariance, s.found, s.informs, s.evidence)
            for s in hypothesis.sightings
        )
        self.start_afresh()
        return Closed(closures)

    def start_afresh(self) -> None:
        """Forget beliefs and searches: the graph they rest on has changed."""
        self.hypotheses.alive.clear()
        self._tasks.clear()
        self._since_outlook = self.config.gate.renew_after
        self.places.forget()
