"""What the robot is to do: missions give the navigator one goal after another and know when they are done."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

from drivers.kobuki.docking import DockingOutput, DockingState
from lemtomap.errors import BadSetting
from lemtomap.nav.config import NavConfig
from lemtomap.nav.explore.explorer import Explorer
from lemtomap.nav.navigator import Navigator
from lemtomap.nav.types import Goal, NavOutput, NavState
from lemtomap.se2 import Pose
from lemtomap.topo.events import NavEvent
from lemtomap.types import MapView, RouteGraph
from robot.exchange import MissionState


class NamedGraph(RouteGraph, Protocol):
    """A route graph whose nodes may bear names."""

    def node_of(self, name: str) -> int | None:
        """Return the node that bears this name."""
        ...


@dataclass(frozen=True, slots=True)
class Moment:
    """What a mission knows when it is asked."""

    now_s: float
    view: MapView
    graph: NamedGraph
    output: NavOutput
    navigator: Navigator
    T_odom_base: Pose
    docking: DockingOutput | None = None
    """How the drive onto the dock stands, once it has begun."""


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

    def step(self, moment: Moment) -> Order:
        """Return what to do now."""
        ...


class Idle:
    """Stay where you are."""

    def step(self, moment: Moment) -> Order:  # noqa: ARG002 -- nothing to look at
        """Return no goal."""
        return Order(MissionState.WAITING)


class GoTo:
    """Drive to one place: a node's number, its name, `start` (where the robot was first) or `far`."""

    def __init__(self, place: str) -> None:
        self.place = place
        self._goal: Goal | None = None
        self._asked_cycle = -1

    def step(self, moment: Moment) -> Order:
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


class Dock:
    """Drive onto the charging dock, which must be in sight from here; done when the charger says so."""

    def __init__(self) -> None:
        self._before: DockingOutput | None = None
        self._begun = False

    def step(self, moment: Moment) -> Order:
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

    def __init__(self, config: NavConfig | None = None) -> None:
        self._config = config or NavConfig()
        self._explorer: Explorer | None = None

    def step(self, moment: Moment) -> Order:
        """Pass the explorer's goals on."""
        if self._explorer is None:
            self._explorer = Explorer(nav=self._config)
        found = self._explorer.step(
            moment.view, moment.graph, moment.output, moment.T_odom_base, moment.now_s
        )
        state = MissionState.DONE if found.done else MissionState.RUNNING
        return Order(state, found.text, found.goal, cancel=found.done, events=found.events)


class Series:
    """One mission after another; fails when one of them fails."""

    def __init__(self, missions: Sequence[Mission]) -> None:
        self._missions = list(missions)

    def step(self, moment: Moment) -> Order:
        """Ask the first mission that is not over."""
        order = self._missions[0].step(moment)
        if order.state is MissionState.DONE and len(self._missions) > 1:
            self._missions.pop(0)
            return Order(MissionState.RUNNING, order.text, order.goal, order.cancel, order.events)
        return order


def resolve(place: str, moment: Moment) -> int | None:
    """Return the node meant by a number, a name, `here`, `start` or `far`; None when there is none."""
    if re.fullmatch(r"\d+", place):
        return int(place) if moment.graph.has_node(int(place)) else None
    named = moment.graph.node_of(place)
    if named is not None:
        return named
    if place == "here":
        return moment.view.associated_id
    if place == "start":
        return 1 if moment.graph.has_node(1) else None
    if place == "far":
        return farthest_node(moment.graph, moment.view.associated_id)
    return None


def farthest_node(graph: RouteGraph, start_id: int, at_most: int = 100_000) -> int:
    """Return the node whose shortest way over edges from `start_id` is longest (of the first `at_most`)."""
    import heapq  # noqa: PLC0415

    done: set[int] = set()
    heap, last = [(0.0, start_id)], start_id
    while heap and len(done) < at_most:
        length_m, node_id = heapq.heappop(heap)
        if node_id in done:
            continue
        done.add(node_id)
        last = node_id
        for edge in graph.edges_of(node_id):
            if edge.other_id not in done:
                heapq.heappush(heap, (length_m + edge.length_m, edge.other_id))
    return last


def parse_mission(text: str) -> Mission:
    """Return the mission meant by `explore`, `tour`, `goto:PLACE`, `dock`, or several joined by commas."""
    missions = [_parse_one(part.strip()) for part in text.split(",")]
    return missions[0] if len(missions) == 1 else Series(missions)


def _parse_one(text: str) -> Mission:
    kind, _, place = text.partition(":")
    if kind == "goto" and place:
        return GoTo(place)
    if text == "explore":
        return Explore()
    if text == "dock":
        return Dock()
    if text == "idle":
        return Idle()
    raise BadSetting(
        f"mission '{text}': must be explore, tour, goto:PLACE, dock, or several joined by commas"
    )
