"""The files a run leaves are exact, and appear whole or not at all."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from lemtomap.errors import BadSetting
from lemtomap.robot.output import files as outputs
from lemtomap.robot.runs.folder import RunFolder
from lemtomap.types import GridView


def test_trajectory_has_one_tum_line_per_scan_in_order_even_when_stamps_go_back(tmp_path):
    poses = np.array([[1.0, -2.0, np.pi / 2], [0.1234567, 0.0, -0.5]])
    outputs.write_trajectory(tmp_path / "t.tum", [976052857.334949, 5.0], poses)
    first, second = (tmp_path / "t.tum").read_text().splitlines()
    assert first == "976052857.334949 1.000000 -2.000000 0.000000 0.000000 0.000000 0.70710678 0.70710678"
    stamp, x, *_, qz, qw = (float(text) for text in second.split())
    assert (stamp, x) == (5.0, 0.123457)
    assert 2 * np.arctan2(qz, qw) == pytest.approx(-0.5)


def test_grid_is_what_map_server_reads(tmp_path):
    occupancy = np.array([[-1, 0, 100], [25, 50, 65]], dtype=np.int8)  # row 0 lies lowest
    outputs.write_grid(tmp_path, GridView(0.0, occupancy, 0.05, (-1.5, 2.0)), np.zeros(3))
    data = (tmp_path / "grid.pgm").read_bytes()
    assert data == b"P5\n3 2\n255\n" + bytes([254, 205, 0, 205, 254, 0])
    told = yaml.safe_load((tmp_path / "grid.yaml").read_text())
    assert told == {
        "image": "grid.pgm",
        "mode": "trinary",
        "resolution": 0.05,
        "origin": [-1.5, 2.0, 0.0],
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
    }
    assert told["free_thresh"] < (255 - outputs.GREY_UNKNOWN) / 255, "unknown must not decode as free"


def test_the_origin_lays_the_grid_into_the_frame_of_the_trajectory(tmp_path):
    grid = GridView(0.0, np.zeros((2, 3), np.int8), 0.05, (-1.5, 2.0))
    T_map_grid = np.array([10.0, 20.0, np.pi / 2])
    outputs.write_grid(tmp_path, grid, T_map_grid)
    told = yaml.safe_load((tmp_path / "grid.yaml").read_text())
    assert told["origin"] == pytest.approx([8.0, 18.5, np.pi / 2], abs=1e-6)
    assert "turned by 90.0 degrees" in outputs.told_of_grid(tmp_path, grid, T_map_grid)


def test_summary_is_plain_json_whatever_numbers_come(tmp_path):
    summary = {"a": np.int64(3), "b": np.float32(0.5), "c": float("nan"), "d": [True, None, Path("x")]}
    outputs.write_summary(tmp_path / "summary.json", summary)
    told = json.loads((tmp_path / "summary.json").read_text())
    assert told == {"a": 3, "b": 0.5, "c": None, "d": [True, None, "x"]}


def make(out: Path, text: str, *, fails: bool = False) -> None:
    with outputs.staged(out) as stage:
        (stage / "file").write_text(text)
        if fails:
            raise RuntimeError


def test_nothing_is_left_when_the_work_fails(tmp_path):
    with pytest.raises(RuntimeError):
        make(tmp_path / "deep" / "er" / "out", "half", fails=True)
    assert list(tmp_path.iterdir()) == []


def test_earlier_results_survive_a_failed_run_and_give_way_to_a_good_one(tmp_path):
    out = tmp_path / "out"
    make(out, "first")
    with pytest.raises(RuntimeError):
        make(out, "second", fails=True)
    assert (out / "file").read_text() == "first"
    make(out, "third")
    assert (out / "file").read_text() == "third"
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_an_out_that_is_a_file_is_refused(tmp_path):
    (tmp_path / "out").write_text("mine")
    with pytest.raises(BadSetting, match="is a file"), outputs.staged(tmp_path / "out"):
        pass
    assert (tmp_path / "out").read_text() == "mine"


def test_a_folder_that_a_run_writes_to_is_refused_until_it_ends(tmp_path):
    running = RunFolder(tmp_path / "out")
    with pytest.raises(BadSetting, match="another run writes there"):
        make(tmp_path / "out", "mine")
    running.close()
    make(tmp_path / "out", "mine")
    RunFolder(tmp_path / "out").close()
