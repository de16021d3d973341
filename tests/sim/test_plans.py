"""ROS maps as people have them: what is wall, floor and unknown in each kind, and where the robot starts."""

import math
import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy import ndimage

pytest.importorskip("pybullet")

from lemtomap.sim import worlds
from lemtomap.sim.errors import BadWorld
from lemtomap.sim.raster import clearance_m, fits
from lemtomap.sim.shelter import walls_around
from lemtomap.sim.simulator import Simulator

CASES = Path(__file__).resolve().parents[3] / "shared/data/cases/plans"
STEP_M = 0.1
WALL, FLOOR, UNKNOWN = 0, 254, 205
WALLS, FLOORS = 154, 30 * 45  # cells of `room`


def room() -> np.ndarray:
    """Return a plan, uint8 (50, 60): a room with walls round it, unknown ground round those."""
    grey = np.full((50, 60), UNKNOWN, dtype=np.uint8)
    grey[9:41, 4:51] = WALL
    grey[10:40, 5:50] = FLOOR
    return grey


def save(folder: Path, image: Image.Image | np.ndarray, settings: str = "", name: str = "m.png") -> Path:
    """Write an image and its YAML; settings said twice count as in `settings`."""
    image = Image.fromarray(image) if isinstance(image, np.ndarray) else image
    image.save(folder / name)
    said = {line.split(":")[0] for line in settings.splitlines()}
    usual = {
        "image": name,
        "resolution": STEP_M,
        "origin": "[1.0, 2.0, 0.0]",
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
    }
    lines = [f"{key}: {value}" for key, value in usual.items() if key not in said]
    (folder / "m.yaml").write_text("\n".join([*lines, settings]) + "\n")
    return folder / "m.yaml"


def with_alpha(mode: str) -> Image.Image:
    """Return the room with its unknown ground transparent white."""
    grey = room()
    alpha = np.where(grey == UNKNOWN, 0, 255).astype(np.uint8)
    grey[grey == UNKNOWN] = FLOOR
    bands = [grey] * (3 if mode == "RGBA" else 1)
    return Image.merge(mode, [Image.fromarray(band) for band in (*bands, alpha)])


def palette_with_transparency() -> Image.Image:
    grey = room()
    image = Image.fromarray(np.select([grey == WALL, grey == FLOOR], [0, 1], 2).astype(np.uint8), mode="P")
    image.putpalette([0, 0, 0, 254, 254, 254, 254, 254, 254])
    image.info["transparency"] = bytes([255, 255, 0])
    return image


def raw() -> np.ndarray:
    return np.select([room() == WALL, room() == FLOOR], [100, 0], 255).astype(np.uint8)


@pytest.mark.parametrize(
    ("image", "settings"),
    [
        (room(), ""),
        (room(), 'negate: "0"'),
        (room(), "negate: false"),
        (room(), "mode: trinary"),
        (255 - room(), "negate: 1"),
        (room(), "mode: scale\nfree_thresh: 0.19"),
        (np.dstack([room()] * 3), ""),
        (np.dstack([np.where(room() == FLOOR, 255, room()), room(), room()]).astype(np.uint8), ""),
        (with_alpha("RGBA"), ""),
        (with_alpha("LA"), ""),
        (with_alpha("LA"), "mode: scale"),
        (palette_with_transparency(), ""),
        (Image.fromarray(room()).convert("P"), ""),
        (room().astype(np.uint16) * 257, ""),
        (np.where(room() == WALL, 5140, room().astype(np.uint16) * 257).astype(np.uint16), ""),
        (raw(), "mode: raw"),
        (raw(), "mode: raw\nnegate: 1"),
        (np.where(raw() == 255, 101, raw()).astype(np.uint8), "mode: raw"),
    ],
)
def test_every_kind_of_image_and_mode_gives_the_same_walls_and_floor(tmp_path, image, settings):
    world = worlds.load(save(tmp_path, image, settings))
    assert world.raster.free.sum() == FLOORS
    assert world.raster.occupied.sum() == WALLS
    assert world.raster.occupied[world.raster.cell(1.0 + 0.45, 2.0 + 2.0)]
    assert world.remarks == ()


def test_sixteen_bit_pgm_is_read_over_the_full_range(tmp_path):
    path = save(tmp_path, room())
    path.write_text(path.read_text().replace("m.png", "m.pgm"))
    (tmp_path / "m.pgm").write_bytes(b"P5\n60 50\n65535\n" + (room().astype(">u2") * 257).tobytes())
    assert worlds.load(path).raster.free.sum() == FLOORS


@pytest.mark.parametrize(
    ("settings", "complaint"),
    [
        ("mode: bogus", r"m\.yaml: 'mode' must be one of trinary, scale, raw, is 'bogus'"),
        ("occupied_thresh: 65\nfree_thresh: 25", r"m\.yaml: 'occupied_thresh' must be a number from 0 to 1"),
        (
            "occupied_thresh: 0.2\nfree_thresh: 0.3",
            r"m\.yaml: occupied_thresh 0\.2 must be above free_thresh",
        ),
        ("negate: maybe", r"m\.yaml: 'negate' must be 0 or 1, is 'maybe'"),
        ("resolution: .nan", r"m\.yaml: 'resolution' must be a number"),
        ("resolution: 1" + "0" * 400, r"m\.yaml: 'resolution' must be a number"),
        ("origin: [0, 1e300, 0]", r"m\.yaml: 'origin' must be a number from -20000"),
        ("origin: [0]", r"m\.yaml: 'origin' must be \[x, y, yaw\]"),
        ("image: [a]", r"m\.yaml: 'image' must be the name of a file"),
        ("image: gone.png", r"gone\.png: no such file"),
        ("image: .", "not a file"),
        ("image: /dev/zero", "/dev/zero: not a file"),
        ('image: "a\\0b"', "cannot be read"),
        ("image: m.yaml", r"m\.yaml: not a readable image"),
        ("origin: &a [*a, *a]", r"m\.yaml: a plan needs no aliases"),
        ("origin: " + "[" * 30 + "]" * 30, r"m\.yaml: more than 20 levels deep"),
        ("origin: " + "[" * 100_000, r"m\.yaml: (more than 20 levels|not a readable YAML)"),
        ("origin: 2024-02-30", r"m\.yaml: not a readable YAML"),
        ("#" * (1 << 20), r"m\.yaml: larger than 1 MB"),
        ("free_thresh: 0", "no free space"),
    ],
)
def test_bad_settings_are_one_line_that_names_the_file_and_the_reason(tmp_path, settings, complaint):
    with pytest.raises(BadWorld, match=complaint) as caught:
        worlds.load(save(tmp_path, room(), settings))
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) <= 400


@pytest.mark.parametrize(
    ("head", "complaint"),
    [
        (b"P5\n200000 200000\n255\n", "the image is too large"),
        (b"P5\n6001 6001\n255\n", "6001 x 6001 pixels are too many"),
        (b"P5\n60 50\n255\n", "not a readable image"),
        (b"P5\n-1 50\n255\n", "not a"),
        (b"P5\n2 50\n255\n", "2 x 50 pixels is no floor plan"),
        (b"P2\n3000 3000\n255\n", "3000 x 3000 pixels as text take too long"),
        (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\3\0\0\0\3\0\0\x08\0\0\0\0", "not a"),
        (b"", "not a readable image"),
    ],
)
def test_images_that_promise_more_than_they_hold_are_refused(tmp_path, head, complaint):
    path = save(tmp_path, room())
    (tmp_path / "m.png").write_bytes(head)
    with pytest.raises(BadWorld, match=rf"m\.png: {complaint}"):
        worlds.load(path)


def test_a_pipe_is_no_image_and_nobody_waits_for_it(tmp_path):
    path = save(tmp_path, room())
    (tmp_path / "m.png").unlink()
    os.mkfifo(tmp_path / "m.png")
    with pytest.raises(BadWorld, match=r"m\.png: not a file"):
        worlds.load(path)


def test_noise_is_no_floor_plan(tmp_path):
    noise = np.indices((500, 500)).sum(axis=0) % 2 * 254
    noise[:20, :20] = FLOOR
    with pytest.raises(BadWorld, match=r"m\.yaml: walls fall into more than"):
        worlds.load(save(tmp_path, noise.astype(np.uint8)))


def test_a_plan_larger_than_the_robot_could_need_is_refused_and_unknown_ground_does_not_count(tmp_path):
    grey = np.full((4100, 4100), UNKNOWN, dtype=np.uint8)
    grey[2000:2050, 3000:3060] = room()
    small = worlds.load(save(tmp_path, grey)).raster
    assert small.free.sum() == FLOORS
    assert small.free[small.cell(1.0 + 302.0, 2.0 + (4100 - 2020) * STEP_M)]
    with pytest.raises(BadWorld, match=r"m\.yaml: 410 x 410 m at 0\.1 m a cell is too large"):
        worlds.load(save(tmp_path, np.full((4100, 4100), FLOOR, dtype=np.uint8)))
    with pytest.raises(BadWorld, match="too large"):
        worlds.load(f"{save(tmp_path, np.pad(room(), 300, constant_values=FLOOR))}@64")


def test_grey_205_is_unknown_though_the_threshold_calls_it_free_and_a_remark_says_so(tmp_path):
    world = worlds.load(save(tmp_path, room(), "free_thresh: 0.25"))
    assert world.raster.free.sum() == FLOORS
    assert len(world.remarks) == 1
    assert "m.png: grey 205 counts as unknown" in world.remarks[0]
    negated = worlds.load(save(tmp_path, 255 - room(), "free_thresh: 0.25\nnegate: 1"))
    assert negated.raster.free.sum() == FLOORS
    assert "grey 50 counts" in negated.remarks[0]


def test_unknown_drawn_as_free_does_not_let_the_robot_out_by_the_front_door(tmp_path):
    grey = room()
    grey[20:32, 50] = FLOOR  # the front door
    world = worlds.load(save(tmp_path, grey, "free_thresh: 0.25"))
    raster = world.raster
    assert raster.free.sum() == FLOORS + 12
    assert raster.occupied[raster.cell(1.0 + 5.15, 2.0 + 2.45)]  # the ground before the door


def test_grey_205_that_does_not_stand_out_is_floor(tmp_path):
    grey = room()
    grey[grey == UNKNOWN] = 100
    grey[10:40, 5:50] = 200 + np.arange(45) % 11  # carpets in all greys
    world = worlds.load(save(tmp_path, grey, "free_thresh: 0.25"))
    assert world.raster.free.sum() == FLOORS
    assert world.remarks == ()
    floor_alone = np.where(room() == FLOOR, UNKNOWN, 100).astype(np.uint8)
    floor_alone[room() == WALL] = WALL
    assert worlds.load(save(tmp_path, floor_alone, "free_thresh: 0.25")).raster.free.sum() == FLOORS


def test_ground_outside_the_image_is_walled_off_where_floor_reaches_its_edge(tmp_path):
    grey = np.full((40, 50), FLOOR, dtype=np.uint8)
    world = worlds.load(save(tmp_path, grey))
    raster = world.raster
    assert raster.free.sum() == grey.size
    rim = np.ones_like(raster.free)
    rim[1:-1, 1:-1] = False
    rim[[0, 0, -1, -1], [0, -1, 0, -1]] = False  # no way over a corner
    assert (raster.occupied == rim).all()
    assert not raster.free[raster.cell(0.95, 3.0)]
    assert raster.free[raster.cell(1.05, 3.0)]
    simulator = Simulator(world, 1)
    simulator.hokuyo.write(b"BM\n")
    simulator.advance(0.5)
    assert np.median(simulator.last_scan.ranges_mm[44:726]) > 500
    simulator.close()


def test_even_the_narrowest_rim_of_a_plan_is_no_speck(tmp_path):
    grey = np.full((120, 120), FLOOR, dtype=np.uint8)
    raster = worlds.load(save(tmp_path, grey, "resolution: 0.01")).raster
    assert raster.free.sum() == grey.size
    assert raster.occupied.sum() == 4 * 120


def test_walls_are_counted_as_far_as_floor_leads():
    plan = ["########", "#.....##", "#....???", "#....??#", "#....???", "#.....##", "########"]
    wall = np.array([[c == "#" for c in line] for line in plan])
    floor = np.array([[c == "." for c in line] for line in plan])
    around = walls_around(wall, floor)
    assert around[3, 3] == 7  # the way to the right ends at unknown ground
    assert around[5, 2] == 8
    assert around[0, 0] == 0
    wall[2:5, 5:] = True
    assert walls_around(wall, floor)[3, 3] == 8
    wall[:, 0] = floor[:, 0] = False
    assert walls_around(wall, floor)[3, 1] < 8


def test_specks_of_unknown_are_floor_in_the_truth_as_in_the_physics(tmp_path):
    grey = room()
    grey[20:22, 20:22] = UNKNOWN  # 0.04 m2
    grey[30:35, 30:35] = UNKNOWN  # 0.25 m2: a thing
    raster = worlds.load(save(tmp_path, grey)).raster
    assert raster.free.sum() == FLOORS - 25
    assert not (raster.free & raster.occupied).any()
    assert raster.occupied.sum() == WALLS + 16


def test_the_start_is_indoors_though_more_room_is_outside(tmp_path):
    grey = np.full((120, 160), FLOOR, dtype=np.uint8)
    grey[9:41, 4:51] = WALL
    grey[10:40, 5:50] = FLOOR
    grey[20:32, 50] = FLOOR  # the front door stands open
    world = worlds.load(save(tmp_path, grey))
    x, y, _ = world.spawn
    assert 1.0 + 0.5 < x < 1.0 + 5.0
    assert 2.0 + 8.0 < y < 2.0 + 11.0
    assert clearance_m(world.raster)[world.raster.cell(x, y)] >= 0.45


def test_a_turned_origin_turns_walls_truth_start_and_physics_alike(tmp_path):
    grey = room()
    grey[10:40, 25] = WALL
    grey[20:32, 25] = FLOOR
    (tmp_path / "locations.yaml").write_text(
        "locations: [a, b]\npolygons:\n- [5, 10, 25, 10, 25, 40, 5, 40]\n- [26, 10, 50, 10, 50, 40, 26, 40]\n"
    )
    (tmp_path / "doors.yaml").write_text("[]\n")
    straight = worlds.load(save(tmp_path, grey, "origin: [1.0, 2.0, 0.0]"))
    yaw = 0.5
    askew = worlds.load(save(tmp_path, grey, f"origin: [1.0, 2.0, {yaw}]"))

    def turned(x: float, y: float) -> tuple[float, float]:
        dx, dy = x - 1.0, y - 2.0
        return 1.0 + math.cos(yaw) * dx - math.sin(yaw) * dy, 2.0 + math.sin(yaw) * dx + math.cos(yaw) * dy

    assert np.allclose(askew.spawn[:2], turned(*straight.spawn[:2]))
    assert math.isclose(
        math.remainder(askew.spawn[2] - straight.spawn[2] - yaw, 2 * math.pi), 0.0, abs_tol=1e-9
    )
    assert fits(askew.raster, askew.spawn[0], askew.spawn[1], 0.3)
    assert askew.raster.free.sum() == pytest.approx(straight.raster.free.sum(), rel=0.02)
    assert ndimage.label(askew.raster.occupied, np.ones((3, 3)))[1] == 1  # no gap that lets the truth out
    agreeing = [
        straight.raster.occupied[straight.raster.cell(x, y)]
        == askew.raster.occupied[askew.raster.cell(*turned(x, y))]
        for x in np.arange(1.7, 5.8, 0.13)
        for y in np.arange(3.2, 5.8, 0.13)
    ]
    assert np.mean(agreeing) > 0.97
    assert askew.truth.room_at(*turned(2.0, 4.0)) == "a"
    assert askew.truth.room_at(*turned(5.0, 4.0)) == "b"
    seen = []
    for world in (straight, askew):
        simulator = Simulator(world, 1)
        seen.append(simulator.perfect_scan_m(simulator.base.body.state))
        simulator.close()
    assert np.allclose(seen[0], seen[1], atol=1e-3)


def test_a_quarter_turn_keeps_every_cell(tmp_path):
    straight = worlds.load(save(tmp_path, room())).raster
    turned = worlds.load(save(tmp_path, room(), f"origin: [1.0, 2.0, {math.pi / 2}]")).raster
    assert (turned.occupied == np.rot90(straight.occupied, -1)).all()
    assert np.allclose(turned.origin_m, (1.0 - 50 * STEP_M, 2.0))


@pytest.mark.parametrize(
    ("name", "floor", "wall"),
    [
        ("openborder", 11_960, 480),
        ("rgb", 7_200, 800),
        ("rgba", 7_200, 800),
        ("palette", 7_200, 800),
        ("la", 7_200, 800),
        ("pgm16", 7_200, 800),
        ("png16", 7_200, 800),
        ("pgm16grey", 7_200, 800),
        ("raw", 7_200, 800),
        ("raw2", 7_296, 704),
        ("negstr", 7_200, 800),
        ("allfree", 12_000, 440),
    ],
)
def test_plans_people_have_are_driven_in(name, floor, wall):
    if not CASES.exists():
        pytest.skip(f"no plans in {CASES}")
    world = worlds.load(CASES / f"{name}.yaml")
    assert world.raster.free.sum() == floor
    assert world.raster.occupied.sum() == wall
    simulator = Simulator(world, 1)
    simulator.hokuyo.write(b"BM\n")
    simulator.advance(0.4)
    assert simulator.truth().contact_count == 0
    assert (simulator.last_scan.ranges_mm[44:726] > 400).any()
    simulator.close()


def test_raw_plan_has_its_room_where_it_says():
    if not CASES.exists():
        pytest.skip(f"no plans in {CASES}")
    raster = worlds.load(CASES / "raw2.yaml").raster
    rows, cols = np.nonzero(raster.free)
    low, high = raster.point(rows.min(), cols.min()), raster.point(rows.max(), cols.max())
    assert np.allclose([*low, *high], [3.0, 3.0, 8.0, 7.0], atol=0.15)


@pytest.mark.parametrize("name", ["badmode", "thpercent"])
def test_plans_that_say_nonsense_are_refused_in_one_line(name):
    if not CASES.exists():
        pytest.skip(f"no plans in {CASES}")
    with pytest.raises(BadWorld, match=rf"{name}\.yaml: '(mode|occupied_thresh)' must be"):
        worlds.load(CASES / f"{name}.yaml")
