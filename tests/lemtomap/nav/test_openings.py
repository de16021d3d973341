"""What becomes of one opening: kept, told apart, reached from the right node, tried again, closed."""

import numpy as np
import pytest

from lemtomap import se2
from lemtomap.nav.explore.frontier import Opening, find_openings
from lemtomap.nav.explore.ground import Ground
from lemtomap.nav.explore.openings import Openings
from lemtomap.nav.kernels import fields as kernels
from lemtomap.nav.motion.costmap import Costs
from lemtomap.nav.motion.metric import reach_from
from lemtomap.topo.events import OpeningDone
from lemtomap.topo.graph import OpeningState

RES = 0.05
SIDE_M = 6.0
BODY_M = 0.18


def ground(unknown=(), walls=(), seen=None, spoke_m=0.0, start=(1.0, 1.0)) -> Ground:
    """Free floor, 6 x 6 m, with unknown and occupied boxes (x0, y0, x1, y1); seen: ground known once."""
    state = np.full((round(SIDE_M / RES),) * 2, kernels.FREE, dtype=np.uint8)
    for boxes, value in ((unknown, kernels.UNKNOWN), (walls, kernels.LETHAL)):
        for x0, y0, x1, y1 in boxes:
            state[round(y0 / RES) : round(y1 / RES), round(x0 / RES) : round(x1 / RES)] = value
    clearance = kernels.clearance_transform(state, 9.0)
    open_floor = (state == kernels.FREE) & (clearance > BODY_M / RES)
    cost = np.where(open_floor, 1.0, np.inf).astype(np.float32)
    costs = Costs(0.0, RES, (0.0, 0.0), state, clearance, cost).without_spokes(spoke_m)
    known = (costs.state != kernels.UNKNOWN) if seen is None else seen
    return Ground.of(reach_from(costs, start), known.astype(np.uint8), 0.2, BODY_M)


DARK_ROOM = (4.0, 0.0, 6.0, 6.0)
EDGE = (3.95, 3.0)
NODES = {1: se2.pose(2.0, 3.0, 0.0)}


def one_opening() -> tuple[Openings, int]:
    openings = Openings()
    openings.match([Opening(EDGE, 0.0, 1.0)], ground([DARK_ROOM]), NODES, 1, 0.0)
    (placeholder,) = openings.of_state(OpeningState.OPEN)
    return openings, placeholder.placeholder_id


def test_is_explored_when_the_ground_behind_it_was_seen():
    openings, number = one_opening()
    openings.match([], ground(), NODES, 1, 1.0)
    assert OpeningDone(number, closed=False) in openings.take_events()


def test_is_kept_while_the_window_has_forgotten_the_ground_around_it():
    openings, number = one_opening()
    forgotten = ground([(0.0, 0.0, 6.0, 6.0)], seen=np.ones((120, 120), dtype=np.uint8))
    openings.match([], forgotten, NODES, 1, 1.0)
    assert openings.get(number) is not None


def test_is_explored_when_what_is_left_of_it_is_too_small_to_be_found():
    openings, number = one_opening()
    openings.match([], ground([DARK_ROOM]), NODES, 1, 1.0)
    assert openings.get(number) is None


@pytest.mark.parametrize(("wall", "kept"), [((4.0, 0.0, 4.1, 6.0), False), ((0.0, 0.0, 0.1, 6.0), True)])
def test_out_of_reach_is_kept_unless_a_wall_hides_the_dark(wall, kept):
    openings, number = one_opening()
    shut_in = [(0.5, 1.5, 1.5, 1.6), (0.5, 0.4, 1.5, 0.5), (0.5, 0.4, 0.6, 1.6), (1.4, 0.4, 1.5, 1.6)]
    openings.match([], ground([(4.1, 0.0, 6.0, 6.0)], [wall, *shut_in]), NODES, 1, 1.0)
    assert (openings.get(number) is not None) is kept


def test_one_behind_a_wall_is_another_one():
    openings, _ = one_opening()
    beyond = Opening((4.4, 3.0), 0.0, 1.0)
    openings.match([beyond], ground([(5.0, 0.0, 6.0, 6.0)], [(4.1, 0.0, 4.2, 6.0)]), NODES, 1, 1.0)
    assert beyond.p_grid in {(p.x_m + 2.0, p.y_m + 3.0) for p in openings.of_state(OpeningState.OPEN)}
    assert len(openings.take_events()) >= 2


def test_belongs_to_the_node_that_sees_it_not_to_the_nearest():
    walls = [(0.0, 3.5, 6.0, 3.6)]
    nodes = NODES | {2: se2.pose(3.9, 3.9, 0.0)}
    openings = Openings()
    openings.match([Opening(EDGE, 0.0, 1.0)], ground([DARK_ROOM], walls), nodes, 2, 0.0)
    assert openings.of_state(OpeningState.OPEN)[0].node_id == 1


def kept_at(walls, nodes, here_id):
    """The node beside which an opening at EDGE is kept."""
    openings = Openings()
    openings.match([Opening(EDGE, 0.0, 1.0)], ground([DARK_ROOM], walls), nodes, here_id, 0.0)
    return openings.of_state(OpeningState.OPEN)[0].node_id


def test_belongs_to_no_node_that_sees_it_only_through_a_rack_the_robot_does_not_fit_through():
    posts = [(x, 3.4, x + 0.05, 3.45) for x in np.arange(0.0, 6.0, 0.3)]
    nodes = NODES | {2: se2.pose(3.97, 4.2, 0.0)}
    assert kept_at(posts, nodes, here_id=2) == 1
    assert kept_at([], nodes, here_id=2) == 2


def test_belongs_to_the_node_with_the_shortest_way_where_none_has_a_straight_one():
    """One 1.8 m from the robot's start was kept 14.6 m away, beside the node that had seen it first."""
    screens = [(3.3, 2.6, 3.4, 3.4), (0.5, 2.0, 0.6, 6.0)]
    nodes = {1: se2.pose(2.8, 3.0, 0.0), 2: se2.pose(0.2, 5.0, 0.0)}
    assert kept_at(screens, nodes, here_id=2) == 1


def test_a_failed_one_waits_and_a_closed_one_in_reach_gets_one_more_chance():
    openings, number = one_opening()
    again = [Opening(EDGE, 0.0, 1.0)]
    openings.failed(number, 10.0, pause_s=60.0, attempts=2)
    assert openings.ready(69.0) == []
    assert len(openings.ready(70.0)) == 1
    for end_s, expected in ((70.0, 1), (200.0, 0)):
        openings.failed(number, end_s, pause_s=60.0, attempts=2)
        assert len(openings.of_state(OpeningState.CLOSED)) == 1
        openings.match(again, ground([DARK_ROOM]), NODES, 1, end_s + 1.0)
        assert openings.ready(end_s + 1.0) == []
        openings.match(again, ground([DARK_ROOM]), NODES, 1, end_s + 61.0)
        assert len(openings.ready(end_s + 61.0)) == expected


@pytest.mark.parametrize(("wide_m", "count"), [(0.3, 0), (0.6, 1)])
def test_no_dark_seam_is_one_for_leading_out_of_doors(wide_m, count):
    low, high = 3.0 - 0.5 * wide_m, 3.0 + 0.5 * wide_m
    seam, outside = (3.0, low, 4.5, high), (4.5, 0.0, 6.0, 6.0)
    wall = [(4.2, 0.0, 4.5, low), (4.2, high, 4.5, 6.0)]
    assert len(find_openings(ground([seam, outside], wall), 0.15)) == count


def test_a_door_is_not_explored_by_two_beams_that_went_through_it():
    """A room deeper than the laser reaches shows no more; half of a real building lay behind such a door."""
    walls = [(3.95, 0.0, 4.05, 2.6), (3.95, 3.4, 4.05, 6.0)]
    dark = [(4.0, 0.0, 6.0, 2.75), (4.0, 2.85, 6.0, 3.1), (4.0, 3.2, 6.0, 6.0)]
    (found,) = find_openings(ground(dark, walls, spoke_m=0.15), 0.3)
    assert found.p_grid == pytest.approx((3.97, 3.0), abs=0.2)


def test_a_corridor_whose_walls_are_seen_edge_on_leads_on():
    """Between the floor along both walls its dark is too narrow for a patch until they end."""
    walls = [(0.0, 2.4, 6.0, 2.5), (0.0, 3.4, 6.0, 3.5)]
    dark = [(3.0, 2.75, 3.6, 3.15), (3.6, 0.0, 6.0, 6.0), (0.0, 3.5, 6.0, 6.0), (0.0, 0.0, 6.0, 2.4)]
    (found,) = find_openings(ground(dark, walls, start=(1.0, 3.0)), 0.3)
    assert found.p_grid == pytest.approx((2.97, 2.95), abs=0.3)


def test_an_opening_that_comes_and_goes_is_left_alone_at_last():
    """What is known of the ground depends on the nodes in view; turning to and fro would never end."""
    openings, numbers = Openings(), set()
    for look in range(20):
        openings.match([Opening(EDGE, 0.0, 1.0)], ground([DARK_ROOM]), NODES, 1, 2.0 * look)
        numbers |= {each.placeholder_id for each in openings.of_state(OpeningState.OPEN)}
        openings.match([], ground(), NODES, 1, 2.0 * look + 1.0)
    assert len(numbers) == 3
    elsewhere = Opening((3.95, 5.2), 0.0, 1.0)
    openings.match([elsewhere], ground([DARK_ROOM]), NODES, 1, 50.0)
    assert len(openings.of_state(OpeningState.OPEN)) == 1


def test_an_opening_that_recedes_before_the_robot_is_none_that_comes_and_goes():
    """A door deep in the dark is uncovered bit by bit; after four bits the room behind it was given up."""
    openings = Openings()
    for look in range(6):
        edge = (2.0 + 0.4 * look, 3.0)
        openings.match([Opening(edge, 0.0, 1.0)], ground([DARK_ROOM]), NODES, 1, 1.0 * look)
        assert len(openings.of_state(OpeningState.OPEN)) == 1
        openings.match([], ground(), NODES, 1, 1.0 * look + 0.5)
        assert len(openings.of_state(OpeningState.OPEN)) == 0


def strips(count: int) -> list[tuple[float, float, float, float]]:
    """What the window has forgotten between the beams that still reach the edge of the dark room."""
    return [(2.0, 0.05 + 0.4 * k, 4.0, 0.35 + 0.4 * k) for k in range(count)]


def test_is_kept_where_only_a_few_beams_show_the_floor_up_to_it():
    """From afar a remembered edge is too full of gaps to be found; what lies behind it is still unseen."""
    openings, number = one_opening()
    seen = np.ones((120, 120), dtype=np.uint8)
    seen[:, 80:] = 0
    barely = ground([DARK_ROOM, *strips(15)], seen=seen)
    assert barely.reach.nearest(EDGE, 0.3) is not None
    openings.match([], barely, NODES, 1, 1.0)
    assert openings.get(number) is not None
