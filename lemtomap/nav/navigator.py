"""The navigator: first topological, then metric, then a velocity (thesis, 3-5; one object instead of three).

    goal -> route over nodes -> sliding metric goal -> field in the window, field near by -> DWA -> raw points

`step` is called at control rate and never waits; each call says what it does and, when it cannot, why.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from lemtomap import se2
from lemtomap.errors import NoRoute, NotStarted
from lemtomap.nav.config import NavConfig
from lemtomap.nav.motion.collision import limit_twist
from lemtomap.nav.motion.dwa import approach
from lemtomap.nav.motion.follower import Follower, FollowerState, Step
from lemtomap.nav.motion.metric import MetricPlan, reach_from
from lemtomap.nav.motion.recovery import (
    BreadcrumbTrail,
    ProgressWatch,
    RecoveryBehaviour,
    RecoverySequence,
)
from lemtomap.nav.outlook import FarLook, Lookout, WindowLook
from lemtomap.nav.places import goal_at
from lemtomap.nav.route.fresh import FreshGraph
from lemtomap.nav.route.planner import Route
from lemtomap.nav.route.sliding import Target, is_roundabout, place_of
from lemtomap.nav.route.watching import EdgeClock
from lemtomap.nav.route.way import CycleInput, RouteKeeper
from lemtomap.nav.surroundings import Surroundings
from lemtomap.nav.types import (
    Contact,
    Goal,
    NavOutput,
    NavReason,
    NavState,
    ObstacleSighting,
)
from lemtomap.samples import as_finite, as_points, check_kind
from lemtomap.se2 import Pose
from lemtomap.topo.file.reader import TopoReader
from lemtomap.types import MapView, Odometry, RouteGraph, Scan, Twist

REST = Twist(0.0, 0.0)


class Navigator:
    """Drives to goals, one at a time; a new goal replaces the old one without a stop.

        with lemtomap.Navigator.open("my.lemto") as navigator:
            navigator.go_to("kitchen")
            twist = navigator.drive(mapper.view(), odometry, scan).twist

    `open`, `go_to` and `drive` are for programs that map and drive in turn; a robot with a thread for each
    gives `set_goal` and `step` what it has.
    """

    def __init__(
        self, config: NavConfig | None = None, far: Callable[[Surroundings], FarLook] = WindowLook
    ) -> None:
        self.config = config or NavConfig()
        self.surroundings = Surroundings(self.config)
        self.lookout = Lookout(self.surroundings, far(self.surroundings), self.config)
        self._goal: Goal | None = None
        self._end: tuple[NavState, NavReason, str] = (NavState.IDLE, NavReason.NONE, "no goal")
        self._way = RouteKeeper(self.config)
        self._lost_s: float | None = None
        self._waiting_s: float | None = None
        self._shut_since_s: float | None = None
        self._command = REST
        self._cycle = 0
        self._follower = Follower(self.config)
        self._progress = ProgressWatch(self.config.recovery)
        self._ladder = RecoverySequence(self.config.recovery)
        self._way_back = BreadcrumbTrail()
        self._edge_clock = EdgeClock()
        self._map: TopoReader | None = None
        """The file that `open` was given."""
        self._asked: Goal | None = None
        """Goes to `set_goal` with the next `drive`, which knows the time."""

    @classmethod
    def open(cls, path: Path | str, *, config: NavConfig | None = None) -> Self:
        """Navigate by a map file, which a Mapper may be writing. Raises BadMap, and BadSample for arguments
        that are none.
        """
        check_kind("Navigator.open: path", path, str, Path)
        check_kind("Navigator.open: config", config, NavConfig, type(None))
        navigator = cls(config)
        navigator._map = TopoReader(path)
        return navigator

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the map file that `open` opened."""
        if self._map is not None:
            self._map.close()

    def go_to(self, place: Goal | int | str) -> None:
        """Drive from now on to a node, by number or name, or to a point in a node's frame.

        A Mapper writes what is new twice a second; a node is a place to go to from then on.
        Raises NoRoute when the map has no such place, BadSample for what is none, NotStarted without `open`.
        """
        self._asked = goal_at(place, self._opened())

    def drive(
        self,
        view: MapView,
        odometry: Odometry,
        seen: Scan | NDArray[np.floating] | Sequence[Sequence[float]] | None = None,
        bumps: Sequence[Contact] = (),
    ) -> NavOutput:
        """Run one control cycle, best ten times a second: `.twist` is what the base should do now.

        `.state`, `.reason` and `.text` say how it goes; `.events` is for the next `Mapper.update`.
        odometry: the base now; its stamp is the time. seen: a new scan taken there, or points float (N, 2),
        metres, base frame; None: nothing new. bumps: contacts since the last call. Raises BadSample for
        arguments that are none, NotStarted without `open`.
        """
        graph = self._opened()
        check_kind("Navigator.drive: view", view, MapView)
        check_kind("Navigator.drive: odometry", odometry, Odometry)
        T_odom_base, now_s = as_finite("Odometry.T_odom_base", odometry.T_odom_base), odometry.stamp_s
        sighting = (
            ObstacleSighting.from_scan(seen, T_odom_base)
            if isinstance(seen, Scan)
            else None
            if seen is None
            else as_points("Navigator.drive: seen", seen)
        )
        for contact in bumps:
            check_kind("Navigator.drive: bumps", contact, Contact)
        if self._asked is not None:
            self.set_goal(self._asked, now_s)
            self._asked = None
        _ = graph.version  # asked once a cycle: here the reader forgets what has changed
        twist = Twist(odometry.v_mps, odometry.w_radps)
        return self.step(view, graph, T_odom_base, twist, sighting, bumps, now_s)

    def _opened(self) -> TopoReader:
        if self._map is None:
            raise NotStarted("this navigator has no map file: make it with Navigator.open")
        return self._map

    @property
    def goal(self) -> Goal | None:
        """The goal under way; None when arrived, failed or idle."""
        return self._goal

    def set_goal(self, goal: Goal | int, now_s: float) -> None:
        """Take a new goal (an int is a node's id); accepted in every state.

        A robot that has hardly moved since the last goal keeps its count of failed recoveries: whoever moves
        the goal about while it is stuck does not keep it from giving up.
        """
        stayed = self._goal is not None and self._way_back.stayed_m < self.config.recovery.stayed_m
        self._goal = Goal(goal) if isinstance(goal, int) else goal
        self._way.route = None
        self.lookout.restart()
        self._waiting_s = self._lost_s = self._shut_since_s = None
        self._follower.restart()
        if stayed:
            self._progress.move_goal()
            return
        self._way_back.start_leg()
        self._way.start_leg()
        self._ladder.reset()
        self._progress.restart(now_s)

    def cancel(self) -> None:
        """Drop the goal; the robot comes to rest within its limits."""
        if self._goal is not None:
            self._finish(NavState.IDLE, NavReason.CANCELLED, "goal cancelled")

    def step(
        self,
        map_view: MapView,
        graph: RouteGraph,
        T_odom_base: Pose,
        twist: Twist,
        scan_points_base: ObstacleSighting | Sequence[ObstacleSighting] | NDArray[np.floating] | None,
        bumps: Sequence[Contact],
        now_s: float,
    ) -> NavOutput:
        """Run one control cycle.

        scan_points_base: what range sensors saw lately: sightings (which know free rays and their time), or
        bare points (N, 2) in the base frame of now. bumps: contacts since the last call. The pose for
        control is compose(T_grid_odom, T_odom_base), so it is as fresh as the odometry.
        """
        self._cycle += 1
        T_grid_base = se2.compose(map_view.T_grid_odom, T_odom_base)
        speed = REST if bumps else self._speed(twist)  # a bump has stopped the robot, or must
        fresh = FreshGraph(graph, map_view)
        moment = CycleInput(map_view, fresh, T_odom_base, T_grid_base, speed, now_s)
        self._way_back.drove(T_odom_base)
        self.surroundings.recall(graph, now_s)
        self.surroundings.take(map_view, _as_sightings(scan_points_base, T_odom_base, now_s))
        self._feel(bumps, moment)
        output = self._act(moment) if self._goal is not None else self._rest(moment)
        self._command = output.twist
        driving = output.state in {NavState.DRIVING, NavState.TURNING}
        traversed = self._edge_clock.step(map_view.associated_id, fresh, now_s, driving=driving)
        if traversed is not None:
            self._way.passed(traversed, fresh)
        events = (*moment.events, *((traversed,) if traversed else ()))
        return replace(output, events=events, cycle=self._cycle)

    def _speed(self, measured: Twist) -> Twist:
        """Trust our own last command where the measured speed is near it: it is smooth and not late."""
        close = abs(measured.v_mps - self._command.v_mps) < 0.15
        steady = abs(measured.w_radps - self._command.w_radps) < 0.6
        return Twist(
            self._command.v_mps if close else measured.v_mps,
            self._command.w_radps if steady else measured.w_radps,
        )

    def _feel(self, bumps: Sequence[Contact], moment: CycleInput) -> None:
        """Remember contacts and leave them backwards."""
        for contact in bumps:
            moment.events.append(self.surroundings.touch(contact, moment.map_view, moment.T_grid_base))
        if bumps and self._goal is not None:
            self._ladder.back_off(moment.T_odom_base, moment.now_s, self.config.recovery.bump_back_m)
            self.lookout.forget()

    # ---- one cycle with a goal ----

    def _act(self, moment: CycleInput) -> NavOutput:
        if moment.map_view.lost:
            return self._wait_for_pose(moment)
        self._lost_s = None
        goal = self._goal
        if goal is None:
            return self._rest(moment)
        try:
            route = self._way.keep(goal, moment)
            self._look(goal, route, moment)
        except NoRoute as error:
            return self._no_route(goal, moment, str(error))
        if self._way.route is None:  # an edge was closed: look for another way at once
            return self._act(moment)
        if self._goal_is_shut(route, moment):
            return self._fail(
                moment, NavReason.BLOCKED, f"the goal is out of reach from node {route.nodes[-1]}"
            )
        recovering = self._recover_step(moment)
        return self._go(route, moment) if recovering is None else recovering

    def _go(self, route: Route, moment: CycleInput) -> NavOutput:
        plan, target = self.lookout.plan, self.lookout.target
        if plan is None or target is None:
            return self._no_way(route, moment)
        if target.final and self._shut_since_s is not None:
            slower = approach(moment.twist, REST, self.config.body, self.config.period_s)
            return self._output(
                moment, slower, NavState.WAITING, NavReason.OBSTACLE, "no way to the goal in sight"
            )
        self._waiting_s = None
        return self._drive(route, plan, target, moment)

    def _look(self, goal: Goal, route: Route, moment: CycleInput) -> None:
        """Renew what is known of the way; start over where a far look shows it closed. Raises NoRoute."""
        if not self.lookout.is_due(moment.now_s) and self.lookout.outlook is not None:
            return
        barriers = self._way.barriers
        barriers.remember(self.surroundings.hits_grid(moment.map_view.T_grid_odom), moment.now_s)
        found = self.lookout.renew(goal, route, moment, self._tolerance_m(), far=barriers.watching)
        if found is None:
            return
        shut_at = self._way.check(goal, found.target, found.plan, found.reach, moment)
        if shut_at is not None:
            self.surroundings.hold(shut_at, moment.now_s + self.config.recovery.block_s)
        if self._way.route is None:
            self._start_over(moment.now_s)

    def _start_over(self, now_s: float) -> None:
        """The way is another one now: what was measured along the old one no longer counts."""
        self.lookout.forget()
        self._waiting_s = None
        self._progress.restart(now_s)

    def _no_route(self, goal: Goal, moment: CycleInput, text: str) -> NavOutput:
        """Refuse, unless what bars the way came just now and may go again, or is seen to be gone."""
        barred_s, patience_s = self._way.barred_s, self.config.recovery.barred_patience_s
        if self.lookout.is_due(moment.now_s):
            costs = self.surroundings.costs(moment.map_view, moment.T_grid_base, moment.now_s)
            reach = reach_from(costs, moment.T_grid_base)
            if self._way.reopen(reach, moment) or self._way.begin_elsewhere(goal, reach, moment):
                barred_s = moment.now_s
        if (barred_s is None or moment.now_s - barred_s > patience_s) and not self._way.retry(moment):
            return self._fail(moment, NavReason.NO_ROUTE, text)
        self._start_over(moment.now_s)
        twist = approach(moment.twist, REST, self.config.body, self.config.period_s)
        return self._output(moment, twist, NavState.WAITING, NavReason.OBSTACLE, f"{text}: waiting")

    def _goal_is_shut(self, route: Route, moment: CycleInput) -> bool:
        """Return True if the robot has been at the goal's node for a while with no way to the goal itself."""
        if not self._is_beside_goal(route, moment):
            self._shut_since_s = None
        elif self._shut_since_s is None:
            self._shut_since_s = moment.now_s
        since_s = self._shut_since_s
        return since_s is not None and moment.now_s - since_s > self.config.recovery.closed_after_s

    def _is_beside_goal(self, route: Route, moment: CycleInput) -> bool:
        """Return True if the robot is at the goal's node and the goal, though near, is not to be reached.

        A long way round over unseen floor to a place beside the node is none: it leads through gaps in walls.
        """
        target, plan, goal = self.lookout.target, self.lookout.plan, self._goal
        place = moment.map_view.T_grid_node.get(route.nodes[-1])
        if target is None or plan is None or goal is None or place is None or target.beyond_m > 0.0:
            return False
        if target.node_id != route.nodes[-1]:
            return False
        away_m = float(np.hypot(*(place - moment.T_grid_base)[:2]))
        if not target.final:
            return away_m < self.config.follow.at_node_m
        return away_m < self.config.follow.by_node_m and is_roundabout(route, goal, target, plan.length_m)

    # ---- driving ----

    def _drive(self, route: Route, plan: MetricPlan, target: Target, moment: CycleInput) -> NavOutput:
        last = target.final or (target.node_id == route.nodes[-1] and target.beyond_m == 0.0)
        end_m = self._way_to_end(plan, moment.T_grid_base) if last else None
        if end_m is not None and target.final and self._follower.at_goal(end_m, self._tolerance_m()):
            step = self._follower.halt(moment.T_grid_base, moment.twist, self._goal_yaw(route, moment))
            if step.motion == FollowerState.THERE:
                self._finish(NavState.ARRIVED, NavReason.NONE, f"arrived at node {route.nodes[-1]}")
                return self._output(moment, REST, *self._end)
        else:
            step = self._follower.step(plan, moment.T_grid_base, moment.twist, end_m)
        if self._progress.stuck(self.lookout.remaining_m(route), moment.now_s):
            return self._climb(moment)
        self._ladder.relax(self._progress.take_gain())
        return self._send(route, plan, target, step, moment)

    def _send(
        self, route: Route, plan: MetricPlan, target: Target, step: Step, moment: CycleInput
    ) -> NavOutput:
        points = self.surroundings.points(moment.T_odom_base, moment.now_s)
        twist = limit_twist(step.twist, points, self.config.body, self.config.collision)
        state = NavState.TURNING if step.motion == FollowerState.TURN else NavState.DRIVING
        reason = (
            NavReason.OBSTACLE
            if step.motion == FollowerState.STUCK or twist.v_mps < step.twist.v_mps
            else NavReason.NONE
        )
        speed_mps = self.config.route.usual_speed_mps
        beyond = self.lookout.edges_beyond(route)
        expected_s = plan.length_m / speed_mps + sum(edge.time_s for edge in beyond)
        return replace(
            self._output(moment, twist, state, reason, f"to node {target.node_id}"),
            remaining_m=self.lookout.remaining_m(route),
            expected_s=expected_s,
        )

    def _way_to_end(self, plan: MetricPlan, T_grid_base: Pose) -> float:
        away_m = float(np.hypot(*(np.array(plan.p_target_grid) - T_grid_base[:2])))
        return max(away_m, 0.0) if plan.length_m < 1.0 else plan.length_m

    def _tolerance_m(self) -> float:
        goal = self._goal
        return self.config.goal_tolerance_m if goal is None or goal.tolerance_m is None else goal.tolerance_m

    def _goal_yaw(self, route: Route, moment: CycleInput) -> float | None:
        goal = self._goal
        if goal is None or goal.yaw_node_rad is None:
            return None
        place = place_of(route, len(route.nodes) - 1, goal, moment.map_view.T_grid_node)
        return None if place is None else float(place[2])

    # ---- when it does not work ----

    def _no_way(self, route: Route, moment: CycleInput) -> NavOutput:
        """Nothing of the route can be reached: wait a little, then climb the ladder."""
        if self._waiting_s is None:
            self._waiting_s = moment.now_s
        patience_s = self.config.recovery.closed_after_s
        if moment.now_s - self._waiting_s < patience_s:
            slower = approach(moment.twist, REST, self.config.body, self.config.period_s)
            text = f"no way to node {route.nodes[min(1, len(route.nodes) - 1)]} yet: waiting"
            return self._output(moment, slower, NavState.WAITING, NavReason.OBSTACLE, text)
        self._waiting_s = moment.now_s
        return self._climb(moment)

    def _climb(self, moment: CycleInput) -> NavOutput:
        """Take the next rung of the ladder, or give up with the reason."""
        if self._ladder.exhausted:
            return self._fail(moment, NavReason.BLOCKED, "no progress after every recovery")
        rung = self._ladder.climb(moment.T_odom_base, moment.now_s)
        self._progress.grace(moment.now_s)
        self.lookout.forget()
        if rung == RecoveryBehaviour.CLEAR:
            self.surroundings.forget_live()
        if rung == RecoveryBehaviour.BLOCK and self._way.close_next(moment):
            self._start_over(moment.now_s)
        twist = approach(moment.twist, REST, self.config.body, self.config.period_s)
        return self._output(
            moment, twist, NavState.RECOVERING, NavReason.OBSTACLE, f"no progress: {rung.name.lower()}"
        )

    def _recover_step(self, moment: CycleInput) -> NavOutput | None:
        wanted = self._ladder.step(
            moment.T_odom_base, self._way_back, moment.now_s, room_behind=self._room_behind(moment)
        )
        if wanted is None:
            return None
        name = self._ladder.name
        self._progress.grace(moment.now_s)
        twist = approach(moment.twist, wanted, self.config.body, self.config.period_s)
        if wanted.v_mps < 0.0:
            twist = replace(twist, v_mps=min(twist.v_mps, 0.0))  # no braking distance into what was touched
        points = self.surroundings.points(moment.T_odom_base, moment.now_s)
        twist = limit_twist(twist, points, self.config.body, self.config.collision)
        return self._output(moment, twist, NavState.RECOVERING, NavReason.OBSTACLE, name)

    def _room_behind(self, moment: CycleInput) -> bool:
        """Return True if the costmap leaves room 10 cm behind the robot."""
        costs = self.lookout.costs
        if costs is None:
            return True
        back = se2.transform(moment.T_grid_base, [-0.10, 0.0])
        if not costs.holds(back):
            return False
        row, col = costs.cell(back)
        here_row, here_col = costs.cell(moment.T_grid_base)
        there, here = costs.clearance[int(row), int(col)], costs.clearance[int(here_row), int(here_col)]
        return bool(there * costs.resolution_m >= self.config.body.radius_m or there > here)

    def _wait_for_pose(self, moment: CycleInput) -> NavOutput:
        if self._lost_s is None:
            self._lost_s = moment.now_s
        if moment.now_s - self._lost_s > self.config.recovery.lost_patience_s:
            return self._fail(moment, NavReason.LOST, "the pose in the map was not found again")
        self._progress.restart(moment.now_s)
        twist = approach(moment.twist, REST, self.config.body, self.config.period_s)
        return self._output(moment, twist, NavState.WAITING, NavReason.LOST, "pose lost: waiting for it")

    def _fail(self, moment: CycleInput, reason: NavReason, text: str) -> NavOutput:
        self._finish(NavState.FAILED, reason, text)
        return self._rest(moment)

    # ---- results ----

    def _finish(self, state: NavState, reason: NavReason, text: str) -> None:
        self._end = (state, reason, text)
        self._goal = self._way.route = None
        self.lookout.forget()

    def _rest(self, moment: CycleInput) -> NavOutput:
        slower = approach(moment.twist, REST, self.config.body, self.config.period_s)
        return self._output(moment, slower, *self._end)

    def _output(
        self, moment: CycleInput, twist: Twist, state: NavState, reason: NavReason, text: str
    ) -> NavOutput:
        plan, target, way = self.lookout.plan, self.lookout.target, self._way.route
        return NavOutput(
            stamp_s=moment.now_s,
            twist=twist,
            state=state,
            reason=reason,
            text=text,
            goal=self._goal,
            route=() if way is None else way.nodes,
            target_id=None if target is None else target.node_id,
            local_path_grid=np.empty((0, 2)) if plan is None else plan.path_grid,
            costmap=self.lookout.picture,
        )


def _as_sightings(
    seen: ObstacleSighting | Sequence[ObstacleSighting] | NDArray[np.floating] | None,
    T_odom_base: Pose,
    now_s: float,
) -> Sequence[ObstacleSighting]:
    if seen is None:
        return ()
    if isinstance(seen, ObstacleSighting):
        return (seen,)
    if isinstance(seen, np.ndarray):
        return (ObstacleSighting.from_points(now_s, T_odom_base, seen),)
    return seen
