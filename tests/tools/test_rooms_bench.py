"""What the rooms bench calls found, passed and right."""

import json
import math
import sys
from pathlib import Path

import numpy as np
import pytest

from lemtomap.sim.errors import BadWorld
from lemtomap.sim.truth.model import Doorway
from lemtomap.sim.world import Raster
from tools.bench import rooms
from tools.bench.rooms_parts.drive import Step
from tools.bench.rooms_parts.judge import nearest_visible, passages
from tools.bench.rooms_parts.score import adjusted_rand, match_doors, room_f1

REFERENCE = Path(__file__).parents[3] / "shared" / "data" / "plans" / "score_reference.txt"
HALVES = np.repeat([1, 2], 50)
CASES = {
    "right": (HALVES, HALVES + 4),
    "merged": (HALVES, np.full(100, 7)),
    "split": (np.full(100, 1), HALVES),
    "shifted": (HALVES, np.repeat([3, 4], [60, 40])),
    "three of four": (np.repeat([1, 2, 3, 4], 25), np.repeat([1, 2, 3], [25, 25, 50])),
    "holes": (np.repeat([0, 1, 2], [20, 40, 40]), np.repeat([1, 0, 2], [50, 10, 40])),
}


@pytest.mark.parametrize(
    ("case", "f1", "ari"),
    [("right", 1.0, 1.0), ("merged", 0.0, 0.0), ("split", 0.0, 0.0), ("shifted", 1.0, 0.6365)],
)
def test_scores_of_small_cases_are_as_worked_out_by_hand(case, f1, ari):
    assert room_f1(*CASES[case]) == pytest.approx(f1)
    assert adjusted_rand(*CASES[case]) == pytest.approx(ari, abs=1e-3)


@pytest.mark.skipif(not REFERENCE.exists(), reason="needs the reference scorer beside the plans")
@pytest.mark.parametrize("case", CASES)
def test_scores_are_those_of_the_reference_scorer(case):
    names = {}
    exec(REFERENCE.read_text(), names)  # noqa: S102 - a scorer that lies beside the data
    with np.errstate(all="ignore"):  # one of its other figures divides by nothing where all is one room
        expected = names["score"](*(labels.reshape(10, 10) for labels in CASES[case]))
    assert room_f1(*CASES[case]) == pytest.approx(expected["F1_50"])
    assert adjusted_rand(*CASES[case]) == pytest.approx(expected["ARI"])


def matched(true, counts, found):
    shaped = (np.array(rows, dtype=float).reshape(-1, 3) for rows in (true, found))
    true, found = shaped
    return match_doors(true, np.array(counts, dtype=bool), found)


def test_a_door_is_found_within_30_cm_and_20_cm_of_width_and_only_once():
    result = matched([[0, 0, 0.9]], [True], [[0.29, 0, 1.09]])
    assert (result.precision, result.recall) == (1.0, 1.0)
    assert matched([[0, 0, 0.9]], [True], [[0.31, 0, 0.9]]).recall == 0.0
    assert matched([[0, 0, 0.9]], [True], [[0, 0, 1.11]]).recall == 0.0
    twice = matched([[0, 0, 0.9]], [True], [[0, 0, 0.9], [0.1, 0, 0.9]])
    assert (twice.precision, twice.recall) == (0.5, 1.0)


def test_a_true_door_that_was_not_seen_open_is_neither_missed_nor_false_when_found():
    result = matched([[0, 0, 0.9], [5, 0, 0.9]], [True, False], [[0, 0, 0.9], [5, 0, 0.9], [9, 9, 0.9]])
    assert (result.counted, result.hits, result.found) == (1, 1, 2)
    assert result.precision == 0.5


def test_no_doors_at_all_are_no_mistake():
    result = matched([], [], [])
    assert (result.precision, result.recall) == (1.0, 1.0)


def way(areas, step_m=0.5):
    return [Step(np.array([k * step_m, 0.0, 0.0]), k * step_m, area) for k, area in enumerate(areas)]


def door_at(x, width_m=0.9):
    return Doorway("d", ((x, -width_m / 2), (x, width_m / 2)), ("a", "b"))


def test_a_door_passed_is_noticed_when_the_area_changes_within_1_5_m():
    rooms_on_way = ["a"] * 4 + ["b"] * 16
    for behind, noticed in ((5, 1), (6, 1), (7, 0)):  # passed at 2.0 m, changed at 2.5, 3.0 or 3.5+ m
        areas = [1] * (behind + 1) + [2] * (19 - behind)
        assert passages((door_at(1.75),), way(areas), rooms_on_way)[:2] == (1, noticed)


def test_a_change_far_from_every_true_change_is_false_and_one_at_an_opening_is_not():
    areas = [1] * 10 + [2] * 10
    assert passages((), way(areas), ["a"] * 20) == (0, 0, 1)
    assert passages((), way(areas), ["a"] * 9 + ["b"] * 11) == (0, 0, 0)
    assert passages((door_at(4.6, width_m=3.0),), way(areas), ["a"] * 20) == (0, 0, 0)


def test_floor_belongs_to_the_nearest_node_in_view_not_behind_a_wall():
    occupied = np.zeros((20, 40), dtype=bool)
    occupied[:, 20] = True
    raster = Raster(occupied, ~occupied, 0.1, (0.0, 0.0))
    nodes = {1: np.array([0.5, 1.0, 0.0]), 2: np.array([2.3, 1.0, 0.0])}
    areas = nearest_visible(raster, nodes, {1: 5, 2: 6})
    assert areas[10, 18] == 5  # nearer to node 2, but that one stands behind the wall
    assert areas[10, 25] == 6


def test_plans_are_sorted_by_kind_and_files_without_rooms_left_out(tmp_path):
    for name, kind in (("a/map", "bare"), ("a/furnished", "furnished"), ("gdc/2/2", "gdc")):
        path = tmp_path / f"{name}.yaml"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("image: map.png\n")
        (path.parent / "locations.yaml").write_text("locations: []\npolygons: []\n")
        assert (str(path), kind) in rooms.plans_in(tmp_path)
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "map.yaml").write_text("image: map.png\n")
    assert len(rooms.plans_in(tmp_path)) == 3


def test_a_world_without_rooms_or_a_folder_without_plans_is_one_line_and_exit_code_2(
    tmp_path, monkeypatch, capsys
):
    with pytest.raises(BadWorld, match="no rooms are known"):
        rooms.load(_bare_plan(tmp_path))
    out = tmp_path / "out"
    monkeypatch.setattr(sys, "argv", ["rooms", "--plans", str(tmp_path / "nowhere"), "--out", str(out)])
    with pytest.raises(SystemExit) as ended:
        rooms.main()
    assert ended.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1


def _bare_plan(folder):
    grey = np.full((40, 60), 254, dtype=np.uint8)
    grey[0] = grey[-1] = grey[:, 0] = grey[:, -1] = 0
    (folder / "m.pgm").write_bytes(b"P5\n60 40\n255\n" + grey.tobytes())
    (folder / "m.yaml").write_text("image: m.pgm\nresolution: 0.1\norigin: [0, 0, 0]\nnegate: 0\n")
    return str(folder / "m.yaml")


def test_a_run_that_was_kept_is_not_run_again(tmp_path):
    job = rooms.Job("nowhere.yaml", "bare", 1, 60.0, twice=False, out=tmp_path)
    kept = rooms.Figures(
        "x", "bare", 1, "done", 3, 4, 3, 5, 4, 1, 250.0, 20, 0.9, 0.8, 2, None, 0.3, 0.05, 9.0
    )
    rooms._keep(job.kept, kept)
    assert rooms.measure(job) == kept
    assert not list(tmp_path.glob("*.part"))
    line = rooms.summary("bare", [kept])
    assert line[2:6] == ["1.000", "0.750", "0.800 of 5", "2.00"]
    assert math.isclose(json.loads(job.kept.read_text())["f1"], 0.8)
