"""Which places a lost robot searches first."""

from types import SimpleNamespace

import numpy as np
import pytest

from lemtomap.se2 import inverse, pose, transform
from lemtomap.topo.kernels import fitting, panorama
from lemtomap.topo.loops.config import LocatorConfig
from lemtomap.topo.loops.descriptor import describe
from lemtomap.topo.loops.lineup import LineUp

ROOMS = 60


def walls(seed, step_m=0.1):
    """A room with a few boxes in it, float64 (N, 2), metres."""
    rng = np.random.default_rng(seed)
    width, depth = rng.uniform(2.5, 6.0, 2)
    boxes = [(-width / 2, -depth / 2, width / 2, depth / 2)]
    for _ in range(3):
        x, y = rng.uniform(-0.5, 0.5, 2) * [width, depth]
        boxes.append((x, y, x + rng.uniform(0.3, 1.0), y + rng.uniform(0.3, 1.0)))
    sides = []
    for x0, y0, x1, y1 in boxes:
        xs, ys = np.arange(x0, x1, step_m), np.arange(y0, y1, step_m)
        sides += [np.column_stack([xs, np.full(len(xs), y)]) for y in (y0, y1)]
        sides += [np.column_stack([np.full(len(ys), x), ys]) for x in (x0, x1)]
    return np.concatenate(sides)


def seen_from(points, T_room_base, half_angle_rad=np.pi):
    """What a laser sees of a room: the nearest point of each degree, base frame."""
    base = transform(inverse(T_room_base), points)
    bearing = np.arctan2(base[:, 1], base[:, 0])
    base, bearing = base[abs(bearing) <= half_angle_rad], bearing[abs(bearing) <= half_angle_rad]
    order = np.argsort(np.hypot(*base.T))
    _, first = np.unique(np.floor(np.rad2deg(bearing[order])), return_index=True)
    return base[order][first]


@pytest.fixture
def line_up():
    """Rooms 0 to ROOMS - 1, one node each, none beside another."""
    rooms = {node_id: walls(node_id) for node_id in range(ROOMS)}
    places = SimpleNamespace(points=rooms.get, around=lambda node_id, *_: {node_id: np.zeros(3)})
    index = SimpleNamespace(
        nearest=lambda *_, **__: [SimpleNamespace(node_id=node_id) for node_id in reversed(rooms)]
    )
    return LineUp(LocatorConfig(), index, places, lambda _: True)


def first_places(line_up, points_base, turned_rad, count=1):
    line_up.begin(points_base, describe(points_base), 0.0, turned_rad)
    while (chosen := line_up.next()) is None:
        assert line_up.rank(2_000) > 0
    return [chosen[0], *[line_up.next()[0] for _ in range(count - 1)]]


@pytest.mark.parametrize("room", range(0, ROOMS, 7))
def test_the_room_where_the_robot_stands_comes_first_however_it_faces(line_up, room):
    T_room_base = pose(0.3, -0.4, 0.7 * room)
    assert room in first_places(line_up, seen_from(walls(room), T_room_base), 7.0, count=2)


def test_what_a_laser_cannot_see_behind_it_says_nothing(line_up):
    view = seen_from(walls(8), pose(0.0, 0.2, 2.0), half_angle_rad=np.deg2rad(120.0))
    assert 8 in first_places(line_up, view, 0.0, count=3)


def test_all_is_heard_once_a_round_was_searched_by_a_robot_that_had_looked_round(line_up):
    view = seen_from(walls(8), pose(0.0, 0.0, 0.0))
    for turned_rad, heard in ((0.0, False), (3.0, True)):
        line_up.begin(view, describe(view), 0.0, turned_rad)
        while not line_up.is_over:
            line_up.rank(5_000)
            if line_up.next() is not None:
                assert not line_up.heard
                line_up.searched()
        assert line_up.heard is heard


def test_a_place_searched_in_vain_is_not_tried_again_from_the_same_spot(line_up):
    view = seen_from(walls(8), pose(0.0, 0.0, 0.0))
    tried = set()
    for _ in range(2):
        line_up.begin(view, describe(view), 0.0, 3.0)
        while not line_up.is_over:
            line_up.rank(5_000)
            if (chosen := line_up.next()) is not None:
                assert chosen[0] not in tried
                tried.add(chosen[0])
                line_up.searched()
    assert len(tried) == 2 * LocatorConfig().first_candidates


def test_panoramas_are_alike_at_any_turn_and_unlike_when_nothing_was_seen():
    ranges = panorama.seen(walls(3))
    for turn in (0, 5, 40):
        assert panorama.unlikeness(np.roll(ranges, turn), ranges[None]) == 0.0
    assert panorama.unlikeness(np.roll(ranges, 3), panorama.seen(walls(4))[None]) > 0.1
    blind = np.full(panorama.BEARINGS, panorama.UNSEEN, dtype=np.uint8)
    assert panorama.unlikeness(blind, ranges[None]) == 1.0


def test_only_what_one_picture_explains_alone_tells_two_apart():
    field = np.zeros((40, 40), dtype=np.int16)
    field[10, :] = 100
    other = field.copy()
    field[20, 5:15] = 100  # a chest that only the first picture has
    points = np.array([[0.1 * c + 0.05, 0.1 * r + 0.05] for r in (10, 20, 30) for c in range(5, 15)])
    side = (np.zeros(3), field, np.array([0.0, 0.0, 0.1]))
    rival = (np.zeros(3), other, np.array([0.0, 0.0, 0.1]))
    assert fitting.told_apart(points, *side, *rival) == (10, 0)
    assert fitting.told_apart(points, *rival, *side) == (0, 10)
