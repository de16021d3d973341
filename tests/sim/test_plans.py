"""Floor plans as people have them: what their greys, colours and keys mean."""

import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("pybullet")

from lemtomap.sim import worlds
from lemtomap.sim.errors import BadWorld
from lemtomap.sim.raster import MAX_BOXES, SPAWN_CLEARANCE_M, clearance_m

CASES = Path(__file__).resolve().parents[3] / "shared" / "data" / "cases" / "plans"
STEP = 0.05
ROWS, COLS = 80, 100
WALL, FLOOR, UNKNOWN = 0, 254, 205


def house():
    """Return greys, uint8 (80, 100), row 0 on top: a house of 3 m x 2.5 m in unknown ground."""
    greys = np.full((ROWS, COLS), UNKNOWN, np.uint8)
    greys[14:66, 19:81] = WALL
    greys[15:65, 20:80] = FLOOR
    return greys


HOUSE_CELLS = 50 * 60


def plan(tmp_path, image, **keys):
    """Write a plan, loadable by its YAML; `image` is an array or a PIL image."""
    drawn = image if isinstance(image, Image.Image) else Image.fromarray(image)
    drawn.save(tmp_path / "plan.png")
    values = {
        "image": "plan.png",
        "resolution": STEP,
        "origin": [0.0, 0.0, 0.0],
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
    } | keys
    (tmp_path / "plan.yaml").write_text("".join(f"{key}: {value}\n" for key, value in values.items()))
    return tmp_path / "plan.yaml"


def free_cells(path):
    return int(worlds.load(str(path)).raster.free.sum())


def with_alpha(greys, mode):
    alpha = np.where(greys == UNKNOWN, 0, 255).astype(np.uint8)
    shown = np.where(greys == UNKNOWN, FLOOR, greys).astype(np.uint8)
    bands = [shown, alpha] if mode == "LA" else [shown, shown, shown, alpha]
    return Image.merge(mode, [Image.fromarray(band) for band in bands])


def in_sixteen_bits(greys):
    return Image.fromarray(greys.astype(np.uint16) * 257)


@pytest.mark.parametrize(
    "drawn",
    [
        Image.fromarray,
        lambda greys: Image.fromarray(greys).convert("RGB"),
        lambda greys: Image.fromarray(greys).convert("P"),
        lambda greys: with_alpha(greys, "LA"),
        lambda greys: with_alpha(greys, "RGBA"),
        in_sixteen_bits,
    ],
    ids=["grey", "colour", "palette", "grey with alpha", "colour with alpha", "16 bit"],
)
def test_a_plan_is_the_same_in_every_kind_of_image(tmp_path, drawn):
    assert free_cells(plan(tmp_path, drawn(house()))) == HOUSE_CELLS


def test_the_grey_of_unknown_ground_is_unknown_whatever_the_thresholds_and_is_told(tmp_path):
    world = worlds.load(str(plan(tmp_path, house(), free_thresh=0.25)))
    assert int(world.raster.free.sum()) == HOUSE_CELLS
    (remark,) = world.remarks
    assert "grey 205 counts as unknown" in remark
    assert "free_thresh 0.25" in remark


def test_floor_that_somebody_drew_in_that_one_grey_is_floor(tmp_path):
    greys = np.where(house() == FLOOR, UNKNOWN, WALL).astype(np.uint8)
    world = worlds.load(str(plan(tmp_path, greys, free_thresh=0.25)))
    assert int(world.raster.free.sum()) == HOUSE_CELLS
    assert world.remarks == ()


def test_negated_plans_are_the_same_plans(tmp_path):
    assert free_cells(plan(tmp_path, 255 - house(), negate=1)) == HOUSE_CELLS


@pytest.mark.parametrize("word", ['"0"', "false", "0"])
def test_a_negate_that_says_no_is_no(tmp_path, word):
    assert free_cells(plan(tmp_path, house(), negate=word)) == HOUSE_CELLS


def test_raw_values_are_percentages_and_beyond_a_hundred_unknown(tmp_path):
    greys = house()
    raw = np.select([greys == WALL, greys == FLOOR], [100, 0], 255).astype(np.uint8)
    assert free_cells(plan(tmp_path, raw, mode="raw", free_thresh=0.25)) == HOUSE_CELLS


@pytest.mark.parametrize(
    ("keys", "reason"),
    [
        ({"mode": "bogus"}, "'mode' must be one of"),
        ({"occupied_thresh": 65, "free_thresh": 19.6}, "'occupied_thresh' must be a number from 0 to 1"),
        ({"occupied_thresh": 0.2, "free_thresh": 0.4}, "must be above free_thresh"),
        ({"negate": "perhaps"}, "'negate' must be 0 or 1"),
        ({"resolution": ".nan"}, "'resolution' must be a number"),
        ({"origin": "[0, 0, .inf]"}, "'origin' must be a number"),
        ({"resolution": "&a [*a]"}, "aliases|not a readable YAML"),
        ({"spare": "[" * 60 + "]" * 60}, "levels deep"),
    ],
)
def test_what_no_map_server_would_take_is_refused_in_one_line(tmp_path, keys, reason):
    with pytest.raises(BadWorld, match=reason) as caught:
        worlds.load(str(plan(tmp_path, house(), **keys)))
    assert "plan.yaml" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("greys", [np.full((60, 60), FLOOR, np.uint8), house()[15:65, 20:80]])
def test_where_floor_reaches_the_edge_of_the_image_a_wall_stands(tmp_path, greys):
    raster = worlds.load(str(plan(tmp_path, greys))).raster
    assert not raster.free[[0, -1]].any()
    assert not raster.free[:, [0, -1]].any()
    assert raster.occupied[0].sum() >= greys.shape[1]


def test_a_robot_starts_indoors_however_large_the_garden_is(tmp_path):
    greys = np.full((400, 400), FLOOR, np.uint8)
    greys[160:240, 160:240] = WALL
    greys[162:238, 162:238] = FLOOR
    greys[238:240, 190:210] = FLOOR  # the front door
    world = worlds.load(str(plan(tmp_path, greys)))
    x, y = world.spawn[:2]
    assert 162 * STEP < x < 238 * STEP
    assert 162 * STEP < y < 238 * STEP


def test_a_speck_of_unknown_is_floor_for_robot_and_truth_alike_and_a_patch_is_neither(tmp_path):
    greys = house()
    greys[30:33, 30:33] = UNKNOWN  # 0.02 m2
    greys[40:52, 40:52] = UNKNOWN  # 0.36 m2
    raster = worlds.load(str(plan(tmp_path, greys))).raster
    rows = ROWS - 1 - np.array([31, 45])
    assert raster.free[rows[0], 31]
    assert not raster.occupied[rows[0], 31]
    assert not raster.free[rows[1], 45]


def test_a_turned_origin_turns_walls_start_and_truth_together(tmp_path):
    straight = worlds.load(str(plan(tmp_path, house())))
    yaw = 0.5
    askew = worlds.load(str(plan(tmp_path, house(), origin=f"[2.0, 1.0, {yaw}]")))
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    assert np.allclose(askew.spawn[:2], turn @ straight.spawn[:2] + [2.0, 1.0], atol=1e-6)
    assert askew.spawn[2] == pytest.approx(straight.spawn[2] + yaw)
    row, col = askew.raster.cell(askew.spawn[0], askew.spawn[1])
    assert clearance_m(askew.raster)[row, col] > SPAWN_CLEARANCE_M - 2 * STEP
    assert askew.raster.free.sum() == pytest.approx(straight.raster.free.sum(), rel=0.02)
    for before, after in zip(straight.boxes, askew.boxes, strict=True):
        assert after.yaw_rad == pytest.approx(before.yaw_rad + yaw)
        assert np.allclose(after.centre[:2], turn @ before.centre[:2] + [2.0, 1.0])


def test_a_pipe_a_folder_and_an_image_of_another_kind_are_no_plans(tmp_path):
    path = plan(tmp_path, house())
    (tmp_path / "plan.png").unlink()
    os.mkfifo(tmp_path / "plan.png")
    with pytest.raises(BadWorld, match="not a file"):
        worlds.load(str(path))
    (tmp_path / "plan.png").unlink()
    (tmp_path / "plan.png").mkdir()
    with pytest.raises(BadWorld, match="not a file"):
        worlds.load(str(path))


def test_an_image_that_claims_to_be_huge_is_refused_before_it_is_read(tmp_path):
    path = plan(tmp_path, house())
    (tmp_path / "plan.png").write_bytes(b"P5\n60000 60000\n255\n" + bytes(100))
    with pytest.raises(BadWorld, match=r"too large|too many"):
        worlds.load(str(path))


def test_noise_is_no_floor_plan(tmp_path):
    greys = np.where(np.random.default_rng(0).random((700, 700)) < 0.4, WALL, FLOOR).astype(np.uint8)
    with pytest.raises(BadWorld, match=f"more than {MAX_BOXES} pieces|no free space"):
        worlds.load(str(plan(tmp_path, greys)))


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ('name = "x"\n[[wall]]\npoints = [[0, 0], [1e8, 0]]\n', "more than 20 km|too large"),
        ('name = "x"\n[[wall]]\npoints = [[0, 0], [9000, 9000]]\n', "too large"),
        ('name = "x"\n[[wall]]\npoints = [[0, 0], [nan, 0]]\n', "2 numbers"),
        ('name = "x"\nspawn = ' + "[" * 5000, "not a readable TOML"),
        ("name = 3\n", "one line of at most"),
    ],
    ids=["kilometres", "nine kilometres", "nan", "deep", "no name"],
)
def test_a_world_file_keeps_within_limits_or_is_refused_in_one_line(tmp_path, text, reason):
    path = tmp_path / "world.toml"
    path.write_text(text)
    with pytest.raises(BadWorld, match=reason) as caught:
        worlds.load(str(path))
    assert "\n" not in str(caught.value)


@pytest.mark.skipif(not CASES.exists(), reason="needs the small plans in ../shared/data/cases")
@pytest.mark.parametrize(
    ("name", "free", "occupied"),
    [
        ("rgb", 7200, 800),
        ("rgba", 7200, 800),
        ("palette", 7200, 800),
        ("la", 7200, 800),
        ("pgm16", 7200, 800),
        ("png16", 7200, 800),
        ("pgm16grey", 7200, 800),
        ("raw", 7200, 800),
        ("negstr", 7200, 800),
        ("allfree", 12000, 440),
    ],
)
def test_plans_that_people_have_are_read_right(name, free, occupied):
    raster = worlds.load(str(CASES / f"{name}.yaml")).raster
    assert (int(raster.free.sum()), int(raster.occupied.sum())) == (free, occupied)


@pytest.mark.skipif(not CASES.exists(), reason="needs the small plans in ../shared/data/cases")
def test_the_room_of_a_raw_plan_lies_where_it_was_drawn():
    raster = worlds.load(str(CASES / "raw2.yaml")).raster
    rows, cols = np.nonzero(raster.free)
    (x0, y0), (x1, y1) = raster.point(rows.min(), cols.min()), raster.point(rows.max(), cols.max())
    assert (x0, y0, x1, y1) == pytest.approx((3.0, 3.0, 8.0, 7.0), abs=0.2)
