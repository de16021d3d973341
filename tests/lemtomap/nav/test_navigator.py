"""The navigator in a small kinematic world."""

import numpy as np

from lemtomap.nav.navigator import Navigator
from lemtomap.nav.types import Goal, NavReason, NavState
from tests.lemtomap.nav.world import (
    RES,
    Graph,
    World,
    run,
)


def two_rooms() -> World:
    """Two rooms, a corridor below them, doors 0.9 m wide; nodes a metre or so apart."""
    places = {
        1: (1.0, 1.0), 2: (2.2, 1.0), 3: (3.4, 1.0), 4: (4.6, 1.0), 5: (5.8, 1.0), 6: (7.0, 1.0),
        7: (7.0, 2.2), 8: (7.0, 3.4), 9: (7.0, 4.8),
        10: (2.2, 2.2), 11: (2.2, 3.4), 12: (2.2, 4.8), 13: (4.6, 4.8),
    }  # fmt: skip
    pairs = [
        (1, 2), (2, 3), (3, 4), (4, 5), (5, 6), (6, 7), (7, 8), (8, 9), (2, 10), (10, 11), (11, 12),
        (12, 13), (13, 9),
    ]  # fmt: skip
    world = World(9.0, 6.0, Graph.of(places, pairs))
    world.box(0, 2.0, 9.0, 2.15)
    world.box(6.55, 2.0, 7.45, 2.15, value=False)
    world.box(1.75, 2.0, 2.65, 2.15, value=False)
    world.box(4.5, 2.0, 4.65, 6.0)
    world.box(4.5, 4.3, 4.65, 5.3, value=False)
    return world


def stops_between(outputs) -> int:
    speeds = np.array([o.twist.v_mps for o in outputs])
    moving = np.flatnonzero(speeds > 0.1)
    inner = speeds[moving[0] : moving[-1]]
    return int(((inner[1:] < 0.05) & (inner[:-1] >= 0.05)).sum())


def test_drives_through_doorways_without_a_stop_or_a_touch():
    world = two_rooms()
    outputs = run(world, Navigator(), 9, 60.0)
    assert outputs[-1].state == NavState.ARRIVED
    assert np.hypot(*(world.pose[:2] - (7.0, 4.8))) < 0.15
    assert world.contacts == 0
    assert stops_between(outputs) == 0
    assert (len(outputs) * 0.1) < 1.25 * (9.8 / 0.5)


def test_gives_the_post_of_a_door_a_wide_berth():
    """Arcs that graze the post get furthest; the last check on raw points then stops the robot there."""
    places = {1: (1.5, 5.0), 2: (1.5, 3.0), 3: (1.5, 2.1), 4: (2.6, 2.0), 5: (4.2, 2.0)}
    world = World(5.0, 6.0, Graph.of(places, [(1, 2), (2, 3), (3, 4), (4, 5)]), pose=(1.45, 4.8, -1.3))
    world.box(1.9, 2.5, 2.0, 6.0)
    world.box(1.9, 0, 2.0, 1.7)
    nearest_m = []
    outputs = run(
        world, Navigator(), 5, 40.0, lambda w: nearest_m.append(np.hypot(*(w.pose[:2] - (1.95, 2.5))))
    )
    assert outputs[-1].state == NavState.ARRIVED
    assert min(nearest_m) > 0.32
    assert stops_between(outputs) == 0


def test_velocity_is_continuous():
    world = two_rooms()
    outputs = run(world, Navigator(), 13, 60.0)
    v = np.array([o.twist.v_mps for o in outputs])
    w = np.array([o.twist.w_radps for o in outputs])
    assert np.abs(np.diff(v)).max() < 0.1
    assert np.abs(np.diff(w)).max() < 0.35


def test_arrives_with_the_heading_asked_for():
    world = two_rooms()
    outputs = run(world, Navigator(), Goal(4, (0.3, 0.2), 2.0), 60.0)
    assert outputs[-1].state == NavState.ARRIVED
    assert np.hypot(*(world.pose[:2] - (4.9, 1.2))) < 0.2
    assert abs(world.pose[2] - 2.0) < 0.12


def test_turns_in_place_when_the_way_starts_behind():
    world = two_rooms()
    world.pose[2] = np.pi
    outputs = run(world, Navigator(), 4, 60.0)
    assert outputs[0].state == NavState.TURNING
    assert outputs[-1].state == NavState.ARRIVED


def test_says_at_once_why_there_is_no_route():
    world = two_rooms()
    world.graph.places[50] = (8.0, 5.0)
    outputs = run(world, Navigator(), 50, 5.0)
    assert len(outputs) == 1
    assert outputs[0].state == NavState.FAILED
    assert outputs[0].reason == NavReason.NO_ROUTE
    assert "not connected" in outputs[0].text


def test_takes_the_next_goal_after_a_failure():
    world = two_rooms()
    navigator = Navigator()
    assert run(world, navigator, 77, 5.0)[-1].state == NavState.FAILED
    assert run(world, navigator, 3, 30.0)[-1].state == NavState.ARRIVED


def test_refuses_a_point_out_of_reach_soon_after_it_came_to_its_node():
    world = two_rooms()
    outputs = run(world, Navigator(), Goal(5, (0.4, -1.3)), 60.0)
    assert outputs[-1].state == NavState.FAILED
    assert outputs[-1].reason == NavReason.BLOCKED
    assert "out of reach" in outputs[-1].text
    assert len(outputs) * 0.1 < 5.2 / 0.5 + 12.0


def test_keeps_the_way_over_unseen_floor_where_it_parts_from_the_edges():
    """At node 1 no other way is left; below the door, at node 2, two metres of seen edge lead back to it."""
    world = two_rooms()
    world.graph = Graph.of({1: (2.2, 3.4), 2: (2.2, 1.0)}, [(1, 2)])
    world.known[round(2.0 / RES) :, round(4.5 / RES) :] = False
    world.box(4.5, 4.3, 4.65, 5.3)
    world.pose = np.array([2.2, 3.4, -1.5])
    outputs = run(world, Navigator(), Goal(1, (4.8, 0.0)), 60.0, lambda w: w.reveal())
    assert outputs[-1].state == NavState.ARRIVED
    assert len(outputs) * 0.1 < 1.5 * (9.6 / 0.5), "drove to and fro between two ways"


def test_goes_on_over_unseen_floor_from_where_the_seen_way_ends():
    """The seen way ends beside the robot, before the goal's node, to which none of its own edges leads."""
    world = two_rooms()
    world.graph = Graph.of({1: (2.0, 1.5), 2: (3.0, 1.5), 3: (2.0, 1.85)}, [(1, 2), (2, 3)])
    world.known[round(3.0 / RES) :] = False
    world.pose = np.array([2.0, 1.5, 1.5])
    outputs = run(world, Navigator(), Goal(3, (0.0, 3.0)), 30.0)
    assert outputs[-1].state == NavState.ARRIVED


def test_refuses_at_its_node_a_point_that_only_a_long_way_over_unseen_floor_might_lead_to():
    world = two_rooms()
    world.graph = Graph.of({1: (2.2, 3.4), 2: (2.2, 2.16), 3: (2.2, 1.0)}, [(1, 2), (2, 3)])
    world.known[round(2.15 / RES) :, round(4.65 / RES) :] = False
    world.known[round(1.9 / RES) :, round(8.0 / RES) :] = False
    world.box(4.5, 2.0, 9.0, 2.15)
    world.box(4.5, 2.0, 4.65, 6.0)
    world.pose = np.array([2.2, 2.15, 1.5])
    ys = []

    def look(w):
        w.reveal()
        ys.append(w.pose[1])

    outputs = run(world, Navigator(), Goal(1, (2.75, 0.0)), 60.0, look)
    assert outputs[-1].state == NavState.FAILED
    assert "out of reach" in outputs[-1].text
    assert min(ys) > 2.0, "set out on the long way first"
