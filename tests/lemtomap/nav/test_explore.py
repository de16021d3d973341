"""Exploration in the small kinematic world, through a window that learns and forgets."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from lemtomap.nav.config import NavConfig
from lemtomap.nav.explore.explorer import Explorer
from lemtomap.nav.explore.memory import SeenMemory
from lemtomap.nav.motion.costmap import Costmap
from lemtomap.nav.navigator import Navigator
from lemtomap.nav.types import NavOutput, NavReason, NavState
from lemtomap.topo.events import GroundSeen, OpeningDone, OpeningSeen
from lemtomap.topo.graph import OpeningState, Placeholder
from lemtomap.types import Twist
from tests.lemtomap.nav.world import RES, Graph, World


def office() -> World:
    """A corridor with three rooms on each side, one of them shut."""
    world = World(13.0, 8.0, Graph.of({1: (1.0, 4.0)}, []), pose=(1.0, 4.0, 0.0))
    for y in (3.2, 4.7):
        world.box(0, y, 13.0, y + 0.1)
    for x in (4.3, 8.7):
        world.box(x, 0, x + 0.1, 3.2)
        world.box(x, 4.8, x + 0.1, 8.0)
    for x in (2.0, 6.5, 10.5):
        world.box(x, 3.2, x + 0.9, 3.3, value=False)
    for x in (2.5, 11.0):
        world.box(x, 4.7, x + 0.9, 4.8, value=False)
    world.known[:] = False
    return world


@dataclass
class Keeping(Graph):
    """A graph on file that is told what was seen from its nodes."""

    pictures: dict[int, bytes] = field(default_factory=dict)

    def keep(self, events):
        self.pictures.update({each.node_id: each.picture for each in events if isinstance(each, GroundSeen)})

    def ground_seen(self, node_id):
        return self.pictures.get(node_id)


def explore(world: World, seconds: float, window_m: float):
    navigator, explorer = Navigator(), Explorer()
    output, events, seen = None, [], np.zeros_like(world.known)
    for _ in range(int(seconds / 0.1)):
        world.reveal()
        seen |= world.known
        world.forget_far(window_m)
        world.grow()
        view = world.view()
        wish = explorer.step(view, world.graph, output, world.T_odom_base, world.now_s)
        events.extend(wish.events)
        if isinstance(world.graph, Keeping):
            world.graph.keep(wish.events)
        if wish.done:
            break
        if wish.goal is not None:
            navigator.set_goal(wish.goal, world.now_s)
        output = navigator.step(
            view, world.graph, world.T_odom_base, world.twist, world.sighting(), (), world.now_s
        )
        world.drive(output.twist)
    return wish, events, seen


@pytest.mark.parametrize("window_m", [20.0, 6.0])
def test_explores_the_whole_office_and_ends_by_itself(window_m):
    world = office()
    wish, events, seen = explore(world, 400.0, window_m)
    assert wish.done, wish.text
    floor = np.zeros_like(seen)
    floor[:, :] = ~world.walls
    floor[round(4.7 / RES) :, round(4.35 / RES) : round(8.75 / RES)] = False  # the shut room
    assert seen[floor].mean() > 0.97
    assert world.contacts == 0
    born = {event.placeholder_id for event in events if isinstance(event, OpeningSeen)}
    gone = {event.placeholder_id for event in events if isinstance(event, OpeningDone)}
    assert born == gone


class Remembering(Graph):
    """A graph on file with an opening from an earlier drive."""

    def openings(self):
        return [
            Placeholder(7, 1, 6.0, 0.5, 0.0, 0.8),
            Placeholder(9, 1, 3.0, 0.0, 0.0, 0.8, OpeningState.EXPLORED),
        ]


def test_goes_on_where_an_earlier_drive_left_off():
    world = office()
    world.graph = Remembering(world.graph.places, world.graph.links)
    world.known[:] = True
    world.known[:, round(6.0 / RES) :] = False
    explorer = Explorer()
    wish = explorer.step(world.view(), world.graph, None, world.T_odom_base, world.now_s)
    numbers = {opening.placeholder_id for opening in wish.openings}
    assert 7 in numbers
    assert 9 not in numbers
    assert min(numbers - {7}, default=10) >= 10


def test_a_later_drive_does_not_explore_again_what_an_earlier_one_has_seen():
    world = office()
    world.graph = Keeping(world.graph.places, world.graph.links)
    explore(world, 400.0, 6.0)
    took_s = []
    for graph in (world.graph, Graph(world.graph.places, world.graph.links)):
        later = office()
        later.graph, begun_s = graph, later.now_s
        explore(later, 60.0, 6.0)
        took_s.append(later.now_s - begun_s)
    assert took_s[0] < 0.5 * took_s[1], took_s


def test_pictures_of_the_ground_far_from_the_robot_are_with_the_map():
    world = office()
    world.known[:] = True
    costmap = Costmap(NavConfig().costmap, NavConfig().body)
    costmap.follow_window(world.view().grid)
    costs = costmap.build(world.now_s, world.pose[:2])
    memory, graph = SeenMemory(kept=5), Keeping({}, [])
    places = {k: np.array([1.0 + 0.1 * k, 4.0, 0.1 * k]) for k in range(100)}
    for k, place in places.items():
        memory.take(costs, {k: place}, place, graph)
        graph.keep(memory.take_events())
        assert len(memory) <= 5
    assert len(graph.pictures) == 99  # all but that of the node it is at
    world.known[:] = False
    costmap.follow_window(world.view().grid)
    unknown = costmap.build(world.now_s, world.pose[:2])
    assert memory.recall(unknown, graph).sum() > SeenMemory().recall(unknown).sum() + 1000


@pytest.mark.parametrize(("reason", "tries"), [(NavReason.BLOCKED, 2), (NavReason.NO_ROUTE, 4)])
def test_an_opening_to_which_every_route_is_closed_is_tried_more_often(reason, tries):
    """Somebody in the only door bars the way to all of them at once."""
    world, explorer, output, goals = office(), Explorer(), None, 0
    world.reveal()
    for _ in range(3000):
        world.now_s += 0.5
        wish = explorer.step(world.view(), world.graph, output, world.T_odom_base, world.now_s)
        if wish.done:
            break
        goals += wish.goal is not None
        output = NavOutput(world.now_s + 0.1, Twist(), NavState.FAILED, reason)
    assert wish.done
    assert goals == tries * len(wish.closed)
