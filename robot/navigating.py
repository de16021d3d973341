"""The navigation part of the robot: 10 times a second, mission -> goal -> velocity, in its own thread."""

from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

from lemtomap.nav.navigator import Navigator
from lemtomap.nav.types import Goal
from lemtomap.robot.exchange import (
    Exchange,
    MissionState,
    MissionStatus,
    NoteLevel,
)
from lemtomap.robot.missions.missions import Idle, Mission, MissionInput
from lemtomap.robot.missions.relocalise import Finder
from lemtomap.topo.events import LevelChanged
from lemtomap.types import MapView, RouteGraph, Twist


class ClosableGraph(RouteGraph, Protocol):
    """A route graph with a file behind it."""

    def node_of(self, name: str) -> int | None:
        """Return the node that bears this name."""
        ...

    def area_nodes(self, place: str) -> list[int]:
        """Return the nodes of the area that `area:N` or a name means; empty: there is none."""
        ...

    def close(self) -> None:
        """Close the file."""
        ...


class NavigationStep:
    """Asks the mission for goals and the navigator for velocities."""

    def __init__(
        self, navigator: Navigator, exchange: Exchange, open_graph: Callable[[], ClosableGraph]
    ) -> None:
        self.navigator = navigator
        self.mission: Mission = Idle()
        self._exchange = exchange
        self._open_graph = open_graph
        self._graph: ClosableGraph | None = None
        self._status = MissionStatus(0.0, MissionState.WAITING)
        self._start_id = 1
        self._finder: Finder | None = None
        """At work while the robot is lost."""
        self._interrupted: Goal | None = None

    def step(self, now_s: float) -> None:
        """Run one cycle; does nothing before the first map."""
        view, odometry = self._exchange.map_view.get(), self._exchange.odometry.get()
        if view is None or odometry is None or view.associated_id == 0:
            return
        if self._graph is None:
            self._graph, self._start_id = self._open_graph(), view.associated_id
        view = self._lost_or_found(view, now_s)
        _ = self._graph.version  # asked once a cycle: here the reader forgets what has changed
        output = self.navigator.step(
            view,
            self._graph,
            odometry.T_odom_base,
            Twist(odometry.v_mps, odometry.w_radps),
            self._exchange.sightings.drain(),
            self._exchange.contacts.drain(),
            now_s,
        )
        for event in output.events:
            self._exchange.nav_events.put(event)
        self._exchange.nav_output.put(output)
        self._follow_mission(
            MissionInput(
                now_s,
                view,
                self._graph,
                output,
                self.navigator,
                odometry.T_odom_base,
                self._start_id,
                self._exchange.docking.get(),
            )
        )

    def _follow_mission(self, moment: MissionInput) -> None:
        if self._status.state.over:
            return
        now_s = moment.now_s
        order = self.mission.step(moment) if self._finder is None else self._finder.step(moment)
        if order.goal is not None:
            self.navigator.set_goal(order.goal, now_s)
        elif order.cancel:
            self.navigator.cancel()
        for event in order.events:
            if isinstance(event, LevelChanged):
                self.navigator.surroundings.forget_window()
            self._exchange.nav_events.put(event)
        if order.dock is not bool(self._exchange.dock.get()):
            self._exchange.dock.put(order.dock)
        if (order.state, order.text) != (self._status.state, self._status.text):
            level = NoteLevel.WARN if order.state is MissionState.FAILED else NoteLevel.INFO
            self._exchange.note(now_s, "mission", order.text or str(order.state), level)
        self._status = MissionStatus(now_s, order.state, order.text)
        self._exchange.mission.put(self._status)

    def _lost_or_found(self, view: MapView, now_s: float) -> MapView:
        """Stop what is under way when the robot is lost, go on with it when it is found again.

        Returns the view to navigate by: with a mission the robot drives about in what it maps while lost.
        """
        if not view.lost:
            if self._finder is not None:
                self._finder = None
                self.navigator.cancel()
                if self._interrupted is not None:
                    self.navigator.set_goal(self._interrupted, now_s)
            return view
        if isinstance(self.mission, Idle) or self._status.state.over:
            return view
        if self._finder is None:
            self._interrupted = self.navigator.goal
            self.navigator.cancel()
            self.navigator.surroundings.forget_window()
            self._finder = Finder(self.navigator.config, now_s)
        return replace(view, lost=False)

    def set_mission(self, mission: Mission) -> None:
        """Take a new mission; the present goal is dropped."""
        self.navigator.cancel()
        self.mission, self._status = mission, MissionStatus(0.0, MissionState.WAITING)
        self._finder = self._interrupted = None

    def close(self) -> None:
        """Close the map's reader."""
        if self._graph is not None:
            self._graph.close()
            self._graph = None
