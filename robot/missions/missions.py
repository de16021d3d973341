"""What the robot is to do: missions give the navigator one goal after another and know when they are done."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

from lemtomap.errors import BadSetting
from lemtomap.nav.explore.explorer import Explorer
from lemtomap.nav.navigator import Navigator
from lemtomap.nav.route.fresh import FreshGraph
from lemtomap.nav.types import Goal, NavOutput, NavState
from lemtomap.robot.exchange import MissionState
from lemtomap.robot.missions.nodes_by_distance import farthest_node, nearest_of, ways_from
from lemtomap.robot.motion.docking import DockingOutput, DockingState
from lemtomap.se2 import Pose
from lemtomap.topo.events import LevelChanged, NavEvent
from lemtomap.topo.naming import number
from lemtomap.types import MapView, RouteGraph


class NamedGraph(RouteGraph, Protocol):
    """A route graph whose nodes and areas may bear names."""

    def area_nodes(self, place: str) -> list[int]:
        """Return the nodes of the area that `area:N` or a name means; empty: there is none."""
        ...

    def node_of(self, name: str) -> int | None:
        """Return the node that bears this name."""
        ...


@dataclass(frozen=True, slots=True)
class MissionInput:
    """What a mission knows when it is asked."""

    now_s: float
    view: MapView
    graph: NamedGraph
    output: NavOutput
    navigator: Navigator
    T_odom_base: Pose
    start_id: int = 1
    """The node at which this run began."""
    docking: DockingOutput | None = None
    """How the drive onto the dock stands, once it has begun."""

    @property
    def fresh(self) -> FreshGraph:
        """The graph with what mapping told last."""
        return FreshGraph(self.graph, self.view)


@dataclass(frozen=True, slots=True)
class Order:
    """What a mission wants next."""

    state: MissionState = MissionState.RUNNING
    text: str = ""
    goal: Goal | None = None
    """A new goal for the navigator."""
    cancel: bool = False
    events: Sequence[NavEvent] = field(default=())
    dock: bool = False
    """Drive onto the charging dock now."""


class Mission(Protocol):
    """Asked after every navigation cycle."""

    def step(self, moment: MissionInput) -> Order:
        """Return what to do now."""
        ...


class Idle:
    """Stay where you are."""

    def step(self, moment: MissionInput) -> Order:  # noqa: ARG002 -- nothing to look at
        """Return no goal."""
        return Order(MissionState.WAITING)


class GoTo:
    """Drive to one place: a node's number, its name, an area (`area:7` or its name), `start` (where the robot
    was first) or `far`.
    """

    def __init__(self, place: str) -> None:
        self.place = place
        self._goal: Goal | None = None
        self._asked_cycle = -1

    def step(self, moment: MissionInput) -> Order:
        """Give the goal once, then wait for the navigator's verdict."""
        if self._goal is None:
            node_id = resolve(self.place, moment)
            if node_id is None:
                return Order(MissionState.FAILED, f"there is no place '{self.place}' in this map")
            self._goal, self._asked_cycle = Goal(node_id), moment.output.cycle
            return Order(MissionState.RUNNING, f"going to {self.place}", goal=self._goal)
        if moment.output.cycle <= self._asked_cycle:
            return Order(MissionState.RUNNING, f"going to {self.place}")
        if moment.output.state is NavState.ARRIVED:
            return Order(MissionState.DONE, f"arrived at {self.place}")
        if moment.output.state is NavState.FAILED:
            why = moment.output.text or str(moment.output.reason)
            return Order(MissionState.FAILED, f"{self.place} not reached: {why}")
        return Order(MissionState.RUNNING, f"going to {self.place}")


class ChangeLevel:
    """Say that the robot is on another level now: it was carried by a lift, or stands at a ramp's end."""

    def __init__(self, level: int) -> None:
        self._level = level

    def step(self, moment: MissionInput) -> Order:  # noqa: ARG002 -- a person knows
        """Tell the map."""
        text = f"on level {self._level}"
        return Order(MissionState.DONE, text, cancel=True, events=(LevelChanged(self._level),))


class Dock:
    """Drive onto the charging dock, which must be in sight from here; done when the charger says so."""

    def __init__(self) -> None:
        self._before: DockingOutput | None = None
        self._begun = False

    def step(self, moment: MissionInput) -> Order:
        """Hand the wheels over and wait for the verdict."""
        if not self._begun:
            self._begun, self._before = True, moment.docking
            return Order(MissionState.RUNNING, "docking", cancel=True, dock=True)
        output = moment.docking
        if output is None or output is self._before:
            return Order(MissionState.RUNNING, "docking", dock=True)
        if output.state is DockingState.DOCKED:
            return Order(MissionState.DONE, "docked and charging")
        if output.state is DockingState.FAILED:
            return Order(MissionState.FAILED, f"not docked: {output.reason}")
        return Order(MissionState.RUNNING, f"docking: {output.state}", dock=True)


class Explore:
    """See everything that can be reached, then stop where the last opening was."""

    def __init__(self) -> None:
        self._explorer: Explorer | None = None

    def step(self, moment: MissionInput) -> Order:
        """Pass the explorer's goals on."""
        if self._explorer is None:
            self._explorer = Explorer(nav=moment.navigator.config)
        found = self._explorer.step(
            moment.view, moment.graph, moment.output, moment.T_odom_base, moment.now_s
        )
        state = MissionState.DONE if found.done else MissionState.RUNNING
        return Order(state, found.text, found.goal, cancel=found.done, events=found.events)


class Tour:
    """Pass within a few metres of every node that can be reached, nearest first, and come back.

    On a map of a single node there is nothing to visit: explore first (`explore,tour`).
    """

    def __init__(self, spacing_m: float = 3.0) -> None:
        self._spacing_m = spacing_m
        self._seen: set[int] = set()
        self._here = 0
        self._leg: GoTo | None = None
        self._target = 0
        self._missed = 0

    def step(self, moment: MissionInput) -> Order:
        """Look around at each node; give the next goal when the last one was reached or given up."""
        self._look(moment)
        if self._leg is not None:
            order = self._leg.step(moment)
            if not order.state.over:
                return Order(MissionState.RUNNING, self._text(), order.goal)
            if order.state is MissionState.FAILED:
                self._missed += 1
                self._seen.add(self._target)
            if self._target == moment.start_id:
                return Order(MissionState.DONE, f"visited everything; {self._missed} places not reached")
        self._target = self._next(moment)
        self._leg = GoTo(str(self._target))
        return Order(MissionState.RUNNING, self._text(), self._leg.step(moment).goal)

    def _look(self, moment: MissionInput) -> None:
        """Tick off what is near."""
        here = moment.view.associated_id
        if here == self._here:
            return
        self._here = here
        for way_m, node_id in ways_from(moment.fresh, here):
            if way_m > self._spacing_m:
                return
            self._seen.add(node_id)

    def _next(self, moment: MissionInput) -> int:
        """Return the nearest node not seen yet; the start when there is none."""
        ways = ways_from(moment.fresh, moment.view.associated_id)
        return next((node_id for _, node_id in ways if node_id not in self._seen), moment.start_id)

    def _text(self) -> str:
        return f"touring: to node {self._target}, {self._missed} places not reached"


class Series:
    """One mission after another; fails when one of them fails."""

    def __init__(self, missions: Sequence[Mission]) -> None:
        self._missions = list(missions)

    def step(self, moment: MissionInput) -> Order:
        """Ask the first mission that is not over."""
        order = self._missions[0].step(moment)
        if order.state is MissionState.DONE and len(self._missions) > 1:
            self._missions.pop(0)
            return Order(MissionState.RUNNING, order.text, order.goal, order.cancel, order.events)
        return order


def resolve(place: str, moment: MissionInput) -> int | None:
    """Return the node meant by a number, a name, `here`, `start` or `far`; None when there is none.

    Of an area it is the node to which the way is shortest (thesis, section 3-5).
    """
    node_id = number(place)
    if node_id is not None and moment.fresh.has_node(node_id):
        return node_id
    named = moment.graph.node_of(place)
    if named is not None:
        return named
    inside = frozenset(moment.graph.area_nodes(place))
    if inside:
        return nearest_of(moment.graph, moment.view.associated_id, inside, moment.now_s)
    return _resolve_word(place, moment)


def _resolve_word(place: str, moment: MissionInput) -> int | None:
    if place == "here":
        return moment.view.associated_id
    if place == "start":
        return moment.start_id if moment.fresh.has_node(moment.start_id) else None
    if place == "far":
        return farthest_node(moment.fresh, moment.view.associated_id)
    return None


def parse_mission(text: str) -> Mission:
    """Return the mission meant by one word, or several joined by commas. Raises BadSetting.

    `explore`, `tour`, `goto:PLACE`, `level:N` or `dock`.
    """
    missions = [_parse_one(part.strip()) for part in text.split(",")]
    return missions[0] if len(missions) == 1 else Series(missions)


def _parse_one(text: str) -> Mission:
    kind, _, place = text.partition(":")
    if kind == "goto" and place:
        return GoTo(place)
    if kind == "level" and re.fullmatch(r"-?[0-9]{1,3}", place):
        return ChangeLevel(int(place))
    if text == "explore":
        return Explore()
    if text == "tour":
        return Tour()
    if text == "dock":
        return Dock()
    if text == "idle":
        return Idle()
    raise BadSetting(
        f"mission '{text}': must be explore, tour, goto:PLACE, level:N, dock, or several joined by commas"
    )
