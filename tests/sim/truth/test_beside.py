"""Rooms, doors, types and lifts that lie beside a plan."""

import json
import math

import numpy as np
import pytest
from PIL import Image

from lemtomap.sim import worlds
from lemtomap.sim.truth.model import Doorway


def plan(folder, labels=None, yaw=0.0):
    """Save two rooms, 2 m x 4 m each, with a gap between them."""
    grey = np.full((40, 40), 254, dtype=np.uint8)
    grey[0] = grey[-1] = grey[:, 0] = grey[:, -1] = grey[:15, 20] = grey[25:, 20] = 0
    Image.fromarray(grey).save(folder / "map.png")
    (folder / "map.yaml").write_text(f"image: map.png\nresolution: 0.1\norigin: [-1, -2, {yaw}]\nnegate: 0\n")
    if labels is not None:
        Image.fromarray(labels).save(folder / "rooms.png")
    return folder / "map.yaml"


def two_rooms():
    labels = np.zeros((40, 40), dtype=np.uint8)
    labels[1:10, 1:20], labels[10:39, 21:39] = 3, 7  # room 3 reaches only the upper part: rows go down
    return labels


def test_a_label_image_tells_the_room_at_a_point_and_rooms_json_its_type(tmp_path):
    (tmp_path / "rooms.json").write_text(json.dumps({"7": {"label": "LAB", "type": "office"}}))
    truth = worlds.load(plan(tmp_path, two_rooms())).truth
    assert truth.room_at(0.0, 1.9 - 0.5) == "3"
    assert truth.room_at(0.0, -1.5) is None
    assert truth.room_at(2.0, -1.5) == "7"
    assert truth.room_at(99.0, 99.0) is None
    assert {room.name: room.kind for room in truth.rooms} == {"3": "room", "7": "office"}


def test_a_label_image_turns_with_its_plan(tmp_path):
    yaw = 0.4
    truth = worlds.load(plan(tmp_path, two_rooms(), yaw)).truth
    dx, dy = 0.5, 3.5  # outside the plan if that had not turned
    x, y = -1 + math.cos(yaw) * dx - math.sin(yaw) * dy, -2 + math.sin(yaw) * dx + math.cos(yaw) * dy
    assert truth.room_at(x, y) == "3"


def test_doors_tell_width_kind_and_rooms_in_both_spellings(tmp_path):
    (tmp_path / "doors.yaml").write_text(
        "- {name: a, rooms: [3, 7], kind: sliding, door_corner_pt_1: [1, -0.5], door_corner_pt_2: [1, 0.5]}\n"
        "- {name: b, approach: [{from: '3'}, {from: '3'}], width_m: 0.9,"
        " door_corner_pt_1: [0, 0], door_corner_pt_2: [0, 0.85]}\n"
        "- {name: c, rooms: [0, 3], door_corner_pt_1: [0, 0], door_corner_pt_2: [0, 1.61]}\n"
    )
    a, b, c = worlds.load(plan(tmp_path, two_rooms())).truth.doors
    assert (a.rooms, a.kind, a.width_m, a.centre, a.is_door) == (("3", "7"), "sliding", 1.0, (1.0, 0.0), True)
    assert (b.width_m, b.is_door, c.is_door) == (0.9, True, False)


def test_a_door_of_1_60_m_is_a_door_and_an_opening_never(tmp_path):
    ends = ((0.0, 0.0), (1.6, 0.0))
    assert Doorway("d", ends, ("a", "b")).is_door
    assert not Doorway("d", ends, ("a", "b"), "opening").is_door


def test_lifts_and_named_places_are_read(tmp_path):
    (tmp_path / "places.yaml").write_text(
        "lifts:\n- {name: L, centre: [1, 2], width: 2.7, depth: 2, levels: [L1, L2]}\n"
        "places:\n- {name: lobby, at: [0, 1]}\n"
    )
    truth = worlds.load(plan(tmp_path)).truth
    (lift,) = truth.lifts
    assert (lift.centre, lift.width_m, lift.depth_m, lift.levels) == ((1.0, 2.0), 2.7, 2.0, ("L1", "L2"))
    assert truth.places == (("lobby", (0.0, 1.0)),)


@pytest.mark.parametrize(
    ("file", "text", "says"),
    [
        ("doors.yaml", "- {name: d, rooms: [1, 2], door_corner_pt_1: [0, 0]}\n", "doors.yaml: entry 1"),
        ("doors.yaml", ("- {rooms: [1, 2], width_m: -1, door_corner_pt_1: [0, 0],"
         " door_corner_pt_2: [0, 1]}\n"), "doors.yaml: entry 1"),
        ("rooms.json", "{", "rooms.json: not a table"),
        ("rooms.json", '{"1": 3}', "rooms.json: not a table"),
        ("places.yaml", "lifts: [{name: L}]\n", "places.yaml: a place or a lift"),
        ("places.yaml", "[]\n", "places.yaml: a place or a lift"),
        ("rooms.png", "no image", "rooms.png: not a readable image"),
    ],
)  # fmt: skip
def test_a_damaged_file_of_truth_is_one_line_and_nothing_of_it_is_kept(tmp_path, file, text, says):
    path = plan(tmp_path, two_rooms())
    (tmp_path / file).write_text(text)
    world = worlds.load(path)
    assert says in world.truth.damage[0]
    assert (world.truth.rooms, world.truth.image) == ((), None)
    assert world.truth.damage[0] in world.remarks[-1]


def test_labels_of_another_size_than_the_plan_are_refused(tmp_path):
    truth = worlds.load(plan(tmp_path, two_rooms()[:30])).truth
    assert "rooms.png: 40 x 30 pixels, but the plan has 40 x 40" in truth.damage[0]
