"""What the navigator does when the world changes or does not let it pass."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from lemtomap.nav.config import NavConfig, RecoveryConfig
from lemtomap.nav.navigator import Navigator
from lemtomap.nav.route.fresh import FreshGraph
from lemtomap.nav.route.planner import Route
from lemtomap.nav.route.way import CycleInput, RouteKeeper
from lemtomap.nav.types import (
    Goal,
    NavReason,
    NavState,
    ObstacleSighting,
)
from lemtomap.topo.events import Bumped, EdgeBlocked, EdgeTraversed
from lemtomap.types import RouteEdge, Twist
from tests.lemtomap.nav.test_navigator import two_rooms
from tests.lemtomap.nav.world import Graph, World, run


def shut(world, x0: float, x1: float) -> None:
    world.box(x0, 2.0, x1, 2.15)


def test_takes_another_way_within_5_s_when_a_door_is_closed():
    world = two_rooms()
    world.pose[:2] = (4.0, 1.0)
    shut_s = world.now_s + 1.0

    def door(w):
        if w.now_s >= shut_s:
            shut(w, 6.55, 7.45)

    outputs = run(world, Navigator(), 8, 90.0, door)
    rerouted = next(o for o in outputs if o.stamp_s > shut_s and 13 in o.route)
    assert rerouted.stamp_s - shut_s < 5.0
    assert any(isinstance(e, EdgeBlocked) for o in outputs for e in o.events)
    assert outputs[-1].state == NavState.ARRIVED
    assert world.contacts == 0


def test_uses_a_door_again_that_opens():
    world = two_rooms()
    world.pose[:2] = (4.0, 1.0)
    shut(world, 6.55, 7.45)
    navigator = Navigator()
    assert run(world, navigator, 8, 90.0)[-1].state == NavState.ARRIVED
    world.box(6.55, 2.0, 7.45, 2.15, value=False)
    outputs = run(world, navigator, 6, 60.0)
    assert outputs[-1].state == NavState.ARRIVED
    assert len(outputs) * 0.1 < 15.0, "took the long way though the door stood open in plain sight"


def test_an_edge_found_cut_while_it_is_closed_is_not_closed_for_longer():
    """Three edges through one doorway, tried one after another, made 30 minutes of the first one's minute."""
    keeper, edge = RouteKeeper(NavConfig()), RouteEdge(9, 2, 1.0, 2.5)
    world = two_rooms()
    spans_s = []
    world.graph.links = [(9, 1, 2)]
    for now_s in (0.0, 3.0, 6.0, 70.0, 400.0):
        view = world.view(1)
        here = view, FreshGraph(world.graph, view), world.pose, world.pose, Twist(), now_s
        keeper.keep(Goal(1), CycleInput(*here))
        keeper.route = Route((1, 2), (edge,), 2.5)
        moment = CycleInput(*here)
        assert keeper.close_next(moment)
        spans_s += [event.until_s - now_s for event in moment.events if isinstance(event, EdgeBlocked)]
        if now_s == 70.0:
            keeper.passed(EdgeTraversed(1, 2, 2.5), world.graph)
    block_s = RecoveryConfig().block_s
    assert spans_s[:-1] == [block_s, block_s, block_s, RecoveryConfig().block_growth * block_s]
    assert spans_s[-1] == block_s, "driven in between, so this is another closing"


def test_a_door_only_remembered_shut_is_looked_at_before_another_way_is_taken():
    """The window learns that a door has opened when the robot looks at it, and some scans later."""
    world = two_rooms()
    world.pose[:] = (2.6, 1.0, np.pi)
    shut(world, 1.75, 2.65)
    shut(world, 6.55, 7.45)
    view = world.view

    def door(w):
        if w.pose[0] > 4.0:
            w.view = view

    remembered = world.view().grid
    world.box(6.55, 2.0, 7.45, 2.15, value=False)
    world.view = lambda associated_id=None: replace(view(associated_id), grid=remembered)
    outputs = run(world, Navigator(), 8, 60.0, door)
    assert outputs[-1].state == NavState.ARRIVED
    assert not any(isinstance(e, EdgeBlocked) for o in outputs for e in o.events)


def test_two_ways_that_are_shut_by_turns_do_not_send_it_to_and_fro_for_ever():
    """Each is seen to be shut only from near by, and counts as open again while the robot is at the other."""
    world = two_rooms()
    navigator = Navigator(
        replace(NavConfig(), recovery=replace(RecoveryConfig(), block_s=8.0, barred_patience_s=2.0))
    )

    def doors(w):
        for x0, x1 in ((6.55, 7.45), (1.75, 2.65)):
            near = abs(w.pose[0] - 0.5 * (x0 + x1)) < 2.0
            w.box(x0, 2.0, x1, 2.15, value=near)

    outputs = run(world, navigator, 9, 400.0, doors)
    assert outputs[-1].state == NavState.FAILED
    assert "closed" in outputs[-1].text
    assert world.contacts == 0


def test_refuses_with_the_reason_when_no_way_is_left():
    world = two_rooms()
    shut(world, 6.55, 7.45)
    shut(world, 1.75, 2.65)
    navigator = Navigator()
    outputs = run(world, navigator, 9, 60.0)
    assert outputs[-1].state == NavState.FAILED
    assert outputs[-1].reason in {NavReason.NO_ROUTE, NavReason.BLOCKED}
    assert "closed" in outputs[-1].text
    assert world.contacts == 0
    assert run(world, navigator, 3, 30.0)[-1].state == NavState.ARRIVED


def test_a_way_closed_again_and_again_is_looked_at_once_more_before_a_new_goal_is_refused():
    world = two_rooms()
    shut(world, 6.55, 7.45)
    shut(world, 1.75, 2.65)
    navigator = Navigator()
    for _ in range(3):
        assert run(world, navigator, 9, 90.0)[-1].state == NavState.FAILED
        world.now_s += 1.1 * RecoveryConfig().block_s * RecoveryConfig().block_growth
    closed_until_s = max(world.now_s, *navigator._way.blocked.closed_until_s(world.now_s).values())
    world.box(6.55, 2.0, 7.45, 2.15, value=False)
    assert closed_until_s > world.now_s + 100.0, "else nothing is shown"
    assert run(world, navigator, 9, 90.0)[-1].state == NavState.ARRIVED


def test_a_node_that_something_stands_on_does_not_close_the_corridor():
    places = {1: (1.0, 1.0), 2: (2.5, 1.0), 3: (4.0, 1.0), 4: (5.5, 1.0), 5: (7.0, 1.0)}
    world = World(8.0, 2.4, Graph.of(places, list(pairwise(places))))
    world.box(3.7, 0, 3.9, 2.4)  # all across: the edges are closed
    navigator = Navigator()
    assert run(world, navigator, 5, 90.0)[-1].state == NavState.FAILED
    world.box(3.7, 1.5, 3.9, 2.3, value=False)  # what is left of it still stands on the edge
    for _ in range(5):
        navigator.step(
            world.view(), world.graph, world.T_odom_base, world.twist, world.sighting(), (), world.now_s
        )
        world.drive(Twist())
    assert run(world, navigator, 5, 30.0)[-1].state == NavState.ARRIVED
    assert world.contacts == 0


def test_a_bump_is_left_backwards_at_once():
    world = two_rooms()
    world.hidden[18:23, 70:75] = True
    outputs = drive_blind(world, Navigator(), 6, 20.0)
    bumped = next(i for i, o in enumerate(outputs) if any(isinstance(e, Bumped) for e in o.events))
    assert all(o.twist.v_mps <= 0.0 for o in outputs[bumped : bumped + 10])


def close_through_walls(world) -> None:
    """Join nodes on either side of the long wall by closures, as recognising a place through a door does."""
    closures = {900: (3, 11), 901: (4, 13), 902: (5, 9), 903: (5, 8)}
    world.graph.links += [(edge_id, a, b) for edge_id, (a, b) in closures.items()]
    world.graph.unproven |= set(closures)


def test_takes_the_way_it_knows_before_a_closure_through_a_wall():
    world = two_rooms()
    close_through_walls(world)
    world.pose[:2] = (4.0, 1.0)
    shut(world, 6.55, 7.45)
    outputs = run(world, Navigator(), 8, 90.0)
    assert outputs[-1].state == NavState.ARRIVED
    steps = {frozenset(pair) for o in outputs for pair in pairwise(o.route)}
    assert not steps & {frozenset((a, b)) for e, a, b in world.graph.links if e in world.graph.unproven}


def test_a_closure_that_proves_to_lead_through_a_wall_is_not_waited_at():
    world = two_rooms()
    close_through_walls(world)
    world.graph.links = [link for link in world.graph.links if set(link[1:]) not in ({6, 7}, {9, 13})]
    world.pose[:2] = (4.0, 1.0)
    shut(world, 6.55, 7.45)
    world.box(4.5, 4.3, 4.65, 5.3)
    outputs = run(world, Navigator(), 8, 60.0)
    assert outputs[-1].state == NavState.FAILED
    assert "closed" in outputs[-1].text
    assert len(outputs) * 0.1 < 3.0


def test_waits_politely_for_somebody_in_the_doorway():
    world = two_rooms()
    world.pose[:2] = (5.0, 1.0)
    begin_s = world.now_s

    def person(w):
        t = w.now_s - begin_s
        w.extra = [(7.0 + 0.15 * np.sin(3.0 * t), 2.1, 0.25)] if t < 8.0 else []

    outputs = run(world, Navigator(), 8, 60.0, person)
    assert outputs[-1].state == NavState.ARRIVED
    assert not any(13 in o.route for o in outputs)
    assert len(outputs) * 0.1 < 22.0
    assert world.contacts == 0


def test_waits_where_somebody_stands_in_the_only_doorway():
    world = two_rooms()
    shut(world, 1.75, 2.65)
    world.pose[:2] = (5.0, 1.0)
    gone_s = world.now_s + 15.0

    def person(w):
        w.extra = [(7.0, 2.1, 0.25)] if w.now_s < gone_s else []

    outputs = run(world, Navigator(), 8, 60.0, person)
    assert outputs[-1].state == NavState.ARRIVED
    assert any(o.state == NavState.WAITING for o in outputs)
    assert len(outputs) * 0.1 < 15.0 + 12.0
    assert world.contacts == 0


def test_somebody_who_stays_is_gone_around():
    world = two_rooms()
    world.pose[:2] = (5.0, 1.0)

    def person(w):
        w.extra = [(7.0, 2.1, 0.25)]

    outputs = run(world, Navigator(), 8, 90.0, person)
    assert outputs[-1].state == NavState.ARRIVED
    assert any(13 in o.route for o in outputs)
    assert world.contacts == 0


def drive_blind(world, navigator, goal, seconds):
    """Like `run`, with a bumper that reports what only touch can find."""
    navigator.set_goal(goal, world.now_s)
    outputs, touched = [], world.contacts
    for _ in range(int(seconds / 0.1)):
        bumps = [world.bump()] if world.contacts > touched else []
        touched = world.contacts
        outputs.append(
            navigator.step(
                world.view(),
                world.graph,
                world.T_odom_base,
                world.twist,
                world.sighting(),
                bumps,
                world.now_s,
            )
        )
        if navigator.goal is None:
            break
        world.drive(outputs[-1].twist)
    return outputs


def test_never_bumps_twice_into_what_the_laser_overlooks():
    world = two_rooms()
    world.hidden[18:23, 70:75] = True  # 0.25 m wide, in the middle of the corridor at x = 3.6
    navigator = Navigator()
    outputs = drive_blind(world, navigator, 6, 90.0)
    assert outputs[-1].state == NavState.ARRIVED
    assert sum(isinstance(e, Bumped) for o in outputs for e in o.events) == world.contacts == 1
    assert drive_blind(world, navigator, 1, 90.0)[-1].state == NavState.ARRIVED
    assert world.contacts == 1


def test_a_depth_camera_keeps_it_off_what_the_laser_overlooks():
    world = two_rooms()
    world.hidden[18:23, 70:75] = True
    world.hidden[30:36, 100:104] = True
    navigator = Navigator()
    navigator.set_goal(6, world.now_s)
    output = None
    for _ in range(600):
        seen = [world.sighting(), ObstacleSighting.from_cloud(world.now_s, world.T_odom_base, world.cloud())]
        output = navigator.step(
            world.view(), world.graph, world.T_odom_base, world.twist, seen, (), world.now_s
        )
        if navigator.goal is None:
            break
        world.drive(output.twist)
    assert output is not None
    assert output.state == NavState.ARRIVED
    assert world.contacts == 0


def test_gives_up_in_bounded_time_when_the_wheels_spin():
    world = two_rooms()
    navigator = Navigator()
    navigator.set_goal(6, world.now_s)
    output = None
    while navigator.goal is not None and world.now_s < 500.0:
        output = navigator.step(
            world.view(), world.graph, world.T_odom_base, world.twist, world.sighting(), (), world.now_s
        )
        world.now_s += 0.1
    assert output is not None
    assert output.state == NavState.FAILED
    assert output.reason in {NavReason.BLOCKED, NavReason.NO_ROUTE}
    assert world.now_s < 100.0 + 180.0


def test_waits_for_a_lost_pose_and_then_says_so():
    world = two_rooms()
    navigator = Navigator()
    run(world, navigator, 6, 3.0)
    world.lost = True
    outputs = run(world, navigator, 6, 60.0)
    assert outputs[10].state == NavState.WAITING
    assert outputs[10].twist.v_mps == pytest.approx(0.0)
    assert outputs[-1].state == NavState.FAILED
    assert outputs[-1].reason == NavReason.LOST
