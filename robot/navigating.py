"""The navigation part of the robot: 10 times a second, mission -> goal -> velocity, in its own thread."""

from collections.abc import Callable
from typing import Protocol

from lemtomap.nav.navigator import Navigator
from lemtomap.types import RouteGraph, Twist
from robot.exchange import Exchange, Level, MissionState, MissionStatus
from robot.missions import Idle, Mission, Moment


class ClosableGraph(RouteGraph, Protocol):
    """A route graph with a file behind it."""

    def node_of(self, name: str) -> int | None:
        """Return the node that bears this name."""
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

    def step(self, now_s: float) -> None:
        """Run one cycle; does nothing before the first map."""
        view, odometry = self._exchange.map_view.get(), self._exchange.odometry.get()
        if view is None or odometry is None or view.associated_id == 0:
            return
        if self._graph is None:
            self._graph, self._start_id = self._open_graph(), view.associated_id
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
            Moment(
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

    def _follow_mission(self, moment: Moment) -> None:
        if self._status.state.over:
            return
        now_s = moment.now_s
        order = self.mission.step(moment)
        if order.goal is not None:
            self.navigator.set_goal(order.goal, now_s)
        elif order.cancel:
            self.navigator.cancel()
        for event in order.events:
            self._exchange.nav_events.put(event)
        if order.dock is not bool(self._exchange.dock.get()):
            self._exchange.dock.put(order.dock)
        if (order.state, order.text) != (self._status.state, self._status.text):
            level = Level.WARN if order.state is MissionState.FAILED else Level.INFO
            self._exchange.note(now_s, "mission", order.text or str(order.state), level)
        self._status = MissionStatus(now_s, order.state, order.text)
        self._exchange.mission.put(self._status)

    def set_mission(self, mission: Mission) -> None:
        """Take a new mission; the present goal is dropped."""
        self.navigator.cancel()
        self.mission, self._status = mission, MissionStatus(0.0, MissionState.WAITING)

    def close(self) -> None:
        """Close the map's reader."""
        if self._graph is not None:
            self._graph.close()
            self._graph = None
