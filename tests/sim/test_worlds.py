"""Worlds: what they promise as ground truth is there, and bad descriptions are one line."""

import math
import os
import re

import numpy as np
import pytest
from scipy import ndimage

from lemtomap.sim import raster as raster_module
from lemtomap.sim import worlds
from lemtomap.sim.errors import BadWorld
from lemtomap.sim.picture import save_picture
from lemtomap.sim.raster import clearance_m
from lemtomap.sim.world import Box

HOME = """
name = "home"
spawn = [1.0, 1.0, 0.0]
[[wall]]
points = [[0, 0], [8, 0], [8, 5], [0, 5], [0, 0]]
[[wall]]
points = [[4, 0], [4, 5]]
[[room]]
name = "kitchen"
low = [0, 0]
high = [4, 5]
[[room]]
name = "hall"
low = [4, 0]
high = [8, 5]
[[door]]
at = [4.0, 2.5]
rooms = ["kitchen", "hall"]
leaf = "swings"
[[furniture]]
kind = "sofa"
at = [6.0, 4.4, 0.0]
moved = [[1, 6.0, 0.6, 0.0]]
"""


@pytest.mark.parametrize(
    "name", ["office", "office@2", "offices:24:3", "loop:2:1", "campus:3:2", "storeys:2", "home"]
)
def test_doors_of_the_ground_truth_can_be_driven_through_and_join_their_rooms(name):
    world = worlds.load(name)
    rooms = {room.name: room for room in world.truth.rooms}
    clearance = clearance_m(world.raster)
    labels, _ = ndimage.label(clearance > 0.2)
    spawn_label = labels[world.raster.cell(*world.spawn[:2])]
    assert spawn_label
    for door in world.truth.doors:
        (x0, y0), (x1, y1) = door.ends
        length = math.hypot(x1 - x0, y1 - y0)
        nx, ny = -(y1 - y0) / length * 0.4, (x1 - x0) / length * 0.4
        cx, cy = door.centre
        sides = ((cx + nx, cy + ny), (cx - nx, cy - ny))
        a, b = (rooms[room] for room in door.rooms)
        assert any(a.contains(*p) and b.contains(*q) for p, q in (sides, sides[::-1])), door
        if a.level == b.level == 0:
            assert labels[world.raster.cell(cx, cy)] == spawn_label, door


def test_generated_worlds_repeat_by_seed_and_differ_between_seeds():
    assert worlds.load("offices:24:3").boxes == worlds.load("offices:24:3").boxes
    assert worlds.load("offices:24:3").boxes != worlds.load("offices:24:4").boxes


def test_sixty_rooms_are_sixty_rooms():
    world = worlds.load("offices:60")
    assert sum(room.kind == "room" for room in world.truth.rooms) == 60
    assert len(world.truth.graph()) == len(world.truth.rooms)


def test_copies_of_the_office_look_the_same_and_join_up():
    world = worlds.load("office@3")
    step = round(16.0 / world.raster.resolution_m)
    first = world.raster.occupied[20:180, 30:300]
    second = world.raster.occupied[20:180, 30 + step : 300 + step]
    assert (first != second).sum() < 0.002 * first.sum() + 20  # cells that a wall's end cuts in half
    assert "1/corridor" in world.truth.graph()["2/corridor"]


def test_copies_of_a_map_stand_in_a_row(tmp_path):
    grey = np.full((60, 80), 254, dtype=np.uint8)
    grey[10, 10:70] = grey[50, 10:70] = grey[10:51, 10] = grey[10:51, 69] = 0
    (tmp_path / "m.pgm").write_bytes(b"P5\n80 60\n255\n" + grey.tobytes())
    (tmp_path / "m.yaml").write_text("image: m.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\n")
    one, three = worlds.load(tmp_path / "m.yaml"), worlds.load(f"{tmp_path / 'm.yaml'}@3")
    assert three.raster.occupied.shape[1] > 3 * 60
    assert len(three.boxes) == 3 * len(one.boxes) + 4


def test_unmapped_ground_is_walled_off_where_a_plan_has_a_gap(tmp_path):
    grey = np.full((60, 80), 205, dtype=np.uint8)
    grey[11:50, 11:69] = 254
    grey[10, 10:70] = grey[50, 10:70] = grey[10:51, 10] = grey[10:51, 69] = 0
    grey[10, 30:50] = 205  # a metre of glass that the mapping laser saw through
    grey[30, 40] = 205  # a speck
    (tmp_path / "m.pgm").write_bytes(b"P5\n80 60\n255\n" + grey.tobytes())
    (tmp_path / "m.yaml").write_text("image: m.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\n")
    raster = worlds.load(tmp_path / "m.yaml").raster
    assert raster.occupied[49, 30:50].all()
    assert not raster.occupied[29, 40]


def test_toml_world_is_built_and_furniture_moves_by_day(tmp_path):
    path = tmp_path / "home.toml"
    path.write_text(HOME)
    world = worlds.load(path)
    assert world.name == "home"
    assert world.truth.graph() == {"kitchen": {"hall"}, "hall": {"kitchen"}}
    assert len(world.movers) == 1
    sofa = world.raster.cell(6.0, 4.4)
    assert world.raster.occupied[sofa]
    assert not worlds.load(path, day=1).raster.occupied[sofa]
    assert worlds.load(f"{path}#1").boxes == worlds.load(path, day=1).boxes


@pytest.mark.parametrize(
    ("before", "after", "complaint"),
    [
        (
            'kind = "sofa"',
            'kind = "sofa"\ncolour = "red"',
            r"home\.toml:22: \[furniture\] unknown key 'colour'",
        ),
        ("spawn = [1.0, 1.0, 0.0]", "spawn = [4.0, 0.5, 0.0]", r"home\.toml:3: spawn \(4, 0\.5\) overlaps"),
        (
            "at = [4.0, 2.5]",
            "at = [5.0, 2.5]",
            r"home\.toml:17: \[door\] door 'door 1' .* lies in no wall",
        ),
        ('kind = "sofa"', 'kind = "boat"', r"home\.toml:21: .*'kind' must be one of cabinet"),
        ("low = [4, 0]", "low = [nan, 0]", r"home\.toml:14: .*'low' must be 2 numbers"),
        ('name = "home"', "name = ", r"home\.toml: not a readable TOML file"),
        ('name = "home"', 'name = "home"\nghosts = 3', r"home\.toml:3: unknown key 'ghosts'"),
        ('rooms = ["kitchen", "hall"]', "", r"home\.toml:16: \[door\] key 'rooms' is missing"),
    ],
)
def test_bad_world_files_are_one_line_with_file_and_place(tmp_path, before, after, complaint):
    path = tmp_path / "home.toml"
    path.write_text(HOME.replace(before, after))
    with pytest.raises(BadWorld, match=complaint) as caught:
        worlds.load(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("before", "after", "complaint"),
    [
        ("[8, 0], [8, 5]", "[8000, 0], [8000, 5000]", r"home\.toml: 8\d\d\d x 5\d\d\d m .* is too large"),
        ("[8, 0], [8, 5]", "[1e8, 0], [1e8, 5]", r"home\.toml: something reaches more than 20 km"),
        ("[8, 0], [8, 5]", "[1e308, 0], [8, 5]", r"home\.toml:5: .*'points' must be 2 numbers"),
        ("[8, 0], [8, 5]", f"[{'9' * 500}, 0], [8, 5]", r"home\.toml:5: .*'points' must be 2 numbers"),
        ("[8, 0], [8, 5]", f"[0x{'f' * 9000}, 0]", r"home\.toml:5: .*number of thousands of digits"),
        ("[8, 0], [8, 5]", f"[{'9' * 9000}, 0]", r"home\.toml: not a readable TOML file"),
        ("[8, 0], [8, 5]", ", ".join(["[8, 0], [8, 5]"] * 2500), r"home\.toml.*'points' has .* at most 4000"),
        ('name = "home"', "name = " + "[" * 100_000, r"home\.toml: not a readable TOML file"),
        ('name = "home"', 'name = "a\\u001b[2J"', r"home\.toml:2: 'name' must be one line"),
        ('name = "home"', 'name = "home"\n"bad\\nkey" = 1', r"home\.toml.*unknown key 'bad key'"),
        ('name = "hall"', "name = []", r"home\.toml:13: .*'name' must be one line"),
        ('["kitchen", "hall"]', '["kitchen", 3]', r"home\.toml:18: .*'rooms' must be one line"),
        ('kind = "sofa"', 'kind = ["sofa"]', r"home\.toml:21: .*'kind' must be one of"),
        ("moved = [[1,", "moved = [[nan,", r"home\.toml:23: .*'moved' must be 4 numbers"),
        ("[[furniture]]", "[[hole]]\nlow = [1, 1]\nhigh = [2, 2]\n" * 1001 + "[[furniture]]", "at most 1000"),
        ('leaf = "swings"', 'leaf = "swings"\nperiod = inf', r"home\.toml:20: .*'period' must be a number"),
    ],
)
def test_worlds_without_end_and_damaged_numbers_are_one_line_too(tmp_path, before, after, complaint):
    path = tmp_path / "home.toml"
    path.write_text(HOME.replace(before, after))
    with pytest.raises(BadWorld, match=complaint) as caught:
        worlds.load(path)
    assert str(caught.value).isprintable()


def test_a_world_file_that_is_a_pipe_or_too_long_is_refused_before_it_is_read(tmp_path):
    os.mkfifo(tmp_path / "pipe.toml")
    with pytest.raises(BadWorld, match=r"pipe\.toml: not a file"):
        worlds.load(tmp_path / "pipe.toml")
    (tmp_path / "long.toml").write_text(HOME + "#" * (1 << 20))
    with pytest.raises(BadWorld, match=r"long\.toml: larger than 1 MB"):
        worlds.load(tmp_path / "long.toml")


def test_a_long_wall_askew_is_drawn_strip_by_strip_as_at_once(monkeypatch):
    box = Box((40.0, 30.0, 0.5), (49.0, 0.06, 0.5), yaw_rad=0.64)
    other = Box((0.0, 0.0, 0.5), (0.1, 0.1, 0.5))
    at_once = raster_module.rasterise([box, other], (1.0, 5.0)).occupied
    monkeypatch.setattr(raster_module, "STRIP_CELLS", 5000)
    assert (raster_module.rasterise([box, other], (1.0, 5.0)).occupied == at_once).all()
    monkeypatch.setattr(raster_module, "MAX_DRAWN_CELLS", 5000)
    with pytest.raises(BadWorld, match="too many long walls askew"):
        raster_module.rasterise([box, other], (1.0, 5.0))


def test_room_to_stand_found_strip_by_strip_is_what_the_distances_say(monkeypatch):
    raster = worlds.load("office").raster
    monkeypatch.setattr(raster_module, "STRIP_CELLS", 5000)
    assert (raster_module.roomy(raster, 0.45) == (clearance_m(raster) >= 0.45)).all()
    for x, y in np.random.default_rng(0).uniform((-1, -1), (17, 11), (200, 2)):
        row, col = raster.cell(x, y)
        inside = 0 <= row < raster.free.shape[0] and 0 <= col < raster.free.shape[1]
        roomy = inside and bool(clearance_m(raster)[row, col] >= 0.3)
        assert raster_module.fits(raster, x, y, 0.3) == roomy


@pytest.mark.parametrize(
    "name", ["office@0", "office#x", "office@x", "loop@2", "offices:5:x", "offices:99999", "gone.toml"]
)
def test_bad_names_are_refused(name):
    with pytest.raises(BadWorld):
        worlds.load(name)


def test_rooms_and_doors_beside_a_map_become_its_ground_truth(tmp_path):
    grey = np.full((40, 60), 254, dtype=np.uint8)
    grey[0] = grey[-1] = grey[:, 0] = grey[:, -1] = grey[:15, 30] = grey[25:, 30] = 0
    (tmp_path / "m.pgm").write_bytes(b"P5\n60 40\n255\n" + grey.tobytes())
    (tmp_path / "m.yaml").write_text("image: m.pgm\nresolution: 0.1\norigin: [-1, -2, 0]\nnegate: 0\n")
    (tmp_path / "locations.yaml").write_text(
        "locations: [a, b]\npolygons:\n- [0, 0, 30, 0, 30, 40, 0, 40]\n- [30, 0, 60, 0, 60, 40, 30, 40]\n"
    )
    (tmp_path / "doors.yaml").write_text(
        "- name: d\n  approach: [{from: a}, {from: b}]\n"
        "  door_corner_pt_1: [2.0, -0.5]\n  door_corner_pt_2: [2.0, 0.5]\n"
    )
    truth = worlds.load(tmp_path / "m.yaml").truth
    assert truth.graph() == {"a": {"b"}, "b": {"a"}}
    assert truth.room_at(1.9, 1.9) == "a"
    assert truth.room_at(2.1, 1.9) == "b"
    (tmp_path / "locations.yaml").write_text("locations: [a, b]\npolygons: []\n")
    damaged = worlds.load(tmp_path / "m.yaml").truth
    assert re.search(r"locations\.yaml: locations and polygons do not fit", damaged.damage[0])
    assert (damaged.rooms, damaged.doors) == ((), ())


@pytest.mark.parametrize(
    ("file", "text"),
    [
        ("locations.yaml", "locations: [a]\npolygons: [[0, 0, 1e300, 0, 30, 40]]\n"),
        ("locations.yaml", "locations: [a]\npolygons: [[0, 0, 30, 0]]\n"),
        ("locations.yaml", "locations: [a]\npolygons: [[0, 0, .nan, 0, 30, 40]]\n"),
        ("locations.yaml", "locations: &a [*a]\n"),
        ("locations.yaml", "[]\n"),
        ("doors.yaml", "- 3\n"),
        ("doors.yaml", "- {approach: [{from: a}, {from: b}], door_corner_pt_1: [0, .inf]}\n"),
        ("doors.yaml", f"- {{approach: [{{from: a}}, {{from: b}}], door_corner_pt_1: [0, {'9' * 400}]}}\n"),
    ],
)
def test_damaged_truth_beside_a_map_is_told_in_one_line_and_stops_no_drive(tmp_path, file, text):
    grey = np.full((40, 60), 254, dtype=np.uint8)
    (tmp_path / "m.pgm").write_bytes(b"P5\n60 40\n255\n" + grey.tobytes())
    (tmp_path / "m.yaml").write_text("image: m.pgm\nresolution: 0.1\norigin: [0, 0, 0]\nnegate: 0\n")
    (tmp_path / "locations.yaml").write_text("locations: []\npolygons: []\n")
    (tmp_path / "doors.yaml").write_text("[]\n")
    (tmp_path / file).write_text(text)
    world = worlds.load(tmp_path / "m.yaml")
    (line,) = world.truth.damage
    assert file in line
    assert line.isprintable()
    assert world.remarks[-1] == f"{line}; driving without rooms as ground truth"


def test_names_with_any_signs_can_be_drawn(tmp_path):
    path = tmp_path / "home.toml"
    path.write_text(HOME.replace('"kitchen"', r'"lab $\\foo$"'))
    save_picture(worlds.load(path), tmp_path / "home.png")
    assert (tmp_path / "home.png").stat().st_size > 1000


def test_described_things_can_stand_in_a_ros_map(tmp_path):
    grey = np.full((60, 120), 254, dtype=np.uint8)
    grey[0] = grey[-1] = grey[:, 0] = grey[:, -1] = 0
    (tmp_path / "m.pgm").write_bytes(b"P5\n120 60\n255\n" + grey.tobytes())
    (tmp_path / "m.yaml").write_text("image: m.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\n")
    (tmp_path / "w.toml").write_text(
        'name = "w"\nmap = "m.yaml"\n[[furniture]]\nkind = "sofa"\nat = [4.0, 2.3, 0.0]\n'
        "[[person]]\npoints = [[1, 1], [5, 1]]\n"
    )
    world = worlds.load(tmp_path / "w.toml")
    assert len(world.boxes) == 5
    assert len(world.movers) == 1
    assert world.raster.occupied[world.raster.cell(4.0, 2.3)]
    (tmp_path / "w.toml").write_text('name = "w"\nmap = "gone.yaml"\n')
    with pytest.raises(BadWorld, match=r"gone\.yaml: no such file"):
        worlds.load(tmp_path / "w.toml")


def test_a_picture_takes_no_name_for_a_formula(tmp_path):
    path = tmp_path / "odd.toml"
    path.write_text(HOME.replace('"kitchen"', r"'lab $\foo$'").replace('"home"', r"'home $\bar$'"))
    save_picture(worlds.load(str(path)), tmp_path / "odd.png")
    assert (tmp_path / "odd.png").read_bytes().startswith(b"\x89PNG")
