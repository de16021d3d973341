"""Exploration: goal after goal at unexplored openings, until none is left; says what stayed closed."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import numpy as np

from lemtomap import se2
from lemtomap.nav.config import ExploreConfig, NavConfig
from lemtomap.nav.explore.frontier import find_openings
from lemtomap.nav.explore.ground import Ground
from lemtomap.nav.explore.memory import SeenMemory
from lemtomap.nav.explore.openings import Openings
from lemtomap.nav.explore.prices import Here, Price, price_openings
from lemtomap.nav.motion.costmap import Costmap
from lemtomap.nav.motion.metric import Reach, reach_from
from lemtomap.nav.route.fresh import FreshGraph
from lemtomap.nav.types import (
    Goal,
    NavOutput,
    NavReason,
    NavState,
)
from lemtomap.se2 import Pose
from lemtomap.topo.events import NavEvent
from lemtomap.topo.graph import OpeningState, Placeholder
from lemtomap.types import MapView, RouteGraph

AT_NODE = (0.0, 0.0)


@runtime_checkable
class RemembersOpenings(Protocol):
    """A graph on file that keeps the openings of earlier drives."""

    def openings(self) -> Sequence[Placeholder]:
        """Return them all, explored and closed ones too."""
        ...


@dataclass(frozen=True, slots=True)
class ExploreOutput:
    """What exploration wants now."""

    goal: Goal | None
    """A new goal for the navigator; None: go on with the present one."""
    done: bool
    text: str
    openings: tuple[Placeholder, ...] = ()
    closed: tuple[Placeholder, ...] = ()
    """Openings that could not be reached."""
    events: Sequence[NavEvent] = ()


@dataclass(slots=True)
class _Pursuit:
    number: int
    goal: Goal
    until_s: float
    """When patience ends."""
    told_s: float
    """When the navigator was given the goal last."""
    arrived_s: float | None = None
    facing: bool = False
    """Having arrived, the robot was told to look into the opening."""
    pressing: bool = False
    """It has been at the node from which the opening was seen: on over whatever floor lies between."""

    @property
    def direct(self) -> bool:
        """Return True if the goal is the opening itself, not the node from which it was seen."""
        return self.goal.p_node != AT_NODE


class Explorer:
    """Keeps the openings; picks the one that costs least to reach. Owned by the navigation thread."""

    def __init__(
        self,
        config: ExploreConfig | None = None,
        nav: NavConfig | None = None,
    ) -> None:
        self._nav = nav or NavConfig()
        self.config = config or self._nav.explore
        self._costmap = Costmap(self._nav.costmap, self._nav.body)
        self._memory = SeenMemory()
        self._openings = Openings(self.config.least_size_m)
        self._recalled = False
        self._pursuit: _Pursuit | None = None
        self._looked_s = -np.inf
        self._empty_looks = 0
        self._output = ExploreOutput(None, done=False, text="looking around")

    def step(
        self,
        map_view: MapView,
        graph: RouteGraph,
        navigation: NavOutput | None,
        T_odom_base: Pose,
        now_s: float,
    ) -> ExploreOutput:
        """Take the newest map and what the navigator does; return a goal now and then, at last `done`.

        navigation: the navigator's last output, None before the first.
        """
        if self._output.done or map_view.lost or now_s - self._looked_s < self.config.period_s - 1e-6:
            return ExploreOutput(None, self._output.done, self._output.text, *self._lists())
        self._looked_s = now_s
        if not self._recalled and isinstance(graph, RemembersOpenings):
            self._openings.recall(graph.openings())
        self._recalled = True
        T_grid_base = se2.compose(map_view.T_grid_odom, T_odom_base)
        reach = self._look(map_view, graph, T_grid_base, now_s)
        self._judge(navigation, now_s)
        fresh = FreshGraph(graph, map_view)
        goal = self._choose(Here(map_view, fresh, reach, T_grid_base, now_s))
        opened, _ = self._lists()
        self._empty_looks = 0 if opened else self._empty_looks + 1
        done = self._empty_looks >= self.config.sure_looks
        text = self._text(now_s, done=done)
        events = (*self._openings.take_events(), *self._memory.take_events(last=done))
        self._output = ExploreOutput(goal, done, text, *self._lists(), events)
        return self._output

    def _look(self, map_view: MapView, graph: RouteGraph, T_grid_base: Pose, now_s: float) -> Reach:
        """Find the openings of the window, leave out forgotten ones, and join them with the known."""
        config = self.config
        self._costmap.follow_window(map_view.grid)
        costs = self._costmap.build(map_view.stamp_s, T_grid_base[:2]).without_spokes(config.spoke_m)
        costs = costs.over_seen_floor(T_grid_base[:2])
        reach = reach_from(costs, T_grid_base)
        self._memory.take(costs, map_view.T_grid_node, T_grid_base, graph)
        seen = self._memory.recall(costs, graph)
        ground = Ground.of(reach, seen, config.least_depth_m, self._nav.body.radius_m)
        openings = find_openings(ground, config.rest_size_m)
        self._openings.match(openings, ground, map_view.T_grid_node, map_view.associated_id, now_s)
        return reach

    def _judge(self, navigation: NavOutput | None, now_s: float) -> None:
        """Learn from how the pursuit went: explored, failed, or reached and nothing more to see."""
        pursuit = self._pursuit
        if pursuit is None:
            return
        if self._openings.get(pursuit.number) is None:
            self._pursuit = None
            return
        if navigation is None or navigation.stamp_s <= pursuit.told_s:
            return
        if navigation.state == NavState.FAILED or now_s > pursuit.until_s:
            barred = navigation.state == NavState.FAILED and navigation.reason == NavReason.NO_ROUTE
            self._give_up(pursuit.number, now_s, barred=barred)
            self._pursuit = None
        elif navigation.state == NavState.ARRIVED:
            pursuit.arrived_s = now_s if pursuit.arrived_s is None else pursuit.arrived_s
            if pursuit.facing and now_s - pursuit.arrived_s > self.config.linger_s:
                self._openings.spend(pursuit.number)
                self._pursuit = None

    def _give_up(self, number: int, now_s: float, *, barred: bool = False) -> None:
        """Leave an opening for later; one that no open route leads to cannot be blamed for that so soon."""
        attempts = self.config.barred_attempts if barred else self.config.attempts
        self._openings.failed(number, now_s, pause_s=self.config.pause_s, attempts=attempts)

    def _choose(self, here: Here) -> Goal | None:
        """Return a new goal if another opening is to be pursued, or the pursued one has moved."""
        pursuit = self._pursuit
        ready = self._openings.ready(here.now_s)
        prices = price_openings(ready, here, self.config) if ready else {}
        if pursuit is not None and pursuit.arrived_s is not None:
            if pursuit.direct:
                return self._face(pursuit, here.now_s)
            pursuit.pressing = True
        if not prices:
            for placeholder in ready:
                self._give_up(placeholder.placeholder_id, here.now_s)
            return None
        number = min(prices, key=lambda n: prices[n].price_m)
        pursued = None if pursuit is None else prices.get(pursuit.number)
        if pursuit is not None and pursued is not None:
            better = prices[number].price_m < self.config.switch_share * pursued.price_m
            number = number if better else pursuit.number
        opening = next(p for p in ready if p.placeholder_id == number)
        return self._pursue(opening, prices[number], here.now_s)

    def _face(self, pursuit: _Pursuit, now_s: float) -> Goal | None:
        """Return, once, the goal to look into the opening from where the robot arrived."""
        opening = self._openings.get(pursuit.number)
        if pursuit.facing or opening is None:
            return None
        pursuit.facing, pursuit.arrived_s, pursuit.told_s = True, None, now_s
        return replace(
            pursuit.goal, yaw_node_rad=opening.yaw_rad, tolerance_m=2.0 * self.config.goal_tolerance_m
        )

    def _pursue(self, opening: Placeholder, price: Price, now_s: float) -> Goal | None:
        """Return the goal at an opening if the navigator is not on its way there already.

        Where unseen floor lies before the opening, because the window forgot it, the robot goes to the node
        from which it was seen, and on from there.
        """
        pursuit = self._pursuit if self._is_pursued(opening) else None
        pressing = pursuit is not None and pursuit.pressing
        place = (opening.x_m, opening.y_m) if price.direct or pressing else AT_NODE
        goal = Goal(opening.node_id, place, None, self.config.goal_tolerance_m)
        if pursuit is not None and _same_place(pursuit.goal, goal):
            return None
        until_s = now_s + self.config.patience_s + price.price_m / self.config.slow_mps
        self._pursuit = _Pursuit(opening.placeholder_id, goal, until_s, now_s, pressing=pressing)
        return goal

    def _is_pursued(self, opening: Placeholder) -> bool:
        return self._pursuit is not None and self._pursuit.number == opening.placeholder_id

    def _lists(self) -> tuple[tuple[Placeholder, ...], tuple[Placeholder, ...]]:
        state = self._openings.of_state
        return tuple(state(OpeningState.OPEN)), tuple(state(OpeningState.CLOSED))

    def _text(self, now_s: float, *, done: bool) -> str:
        opened, closed = self._lists()
        if done:
            nodes = ", ".join(str(node_id) for node_id in sorted({p.node_id for p in closed}))
            left = (
                f"{len(closed)} openings stayed closed, beside nodes {nodes}"
                if closed
                else "none stayed closed"
            )
            return f"explored everything; {left}"
        if opened and not self._openings.ready(now_s):
            return f"waiting to try {len(opened)} openings again, {len(closed)} closed"
        return f"{len(opened)} openings to explore, {len(closed)} closed"


def _same_place(a: Goal, b: Goal) -> bool:
    return a.node_id == b.node_id and float(np.hypot(*np.subtract(a.p_node, b.p_node))) < 0.25
