"""`lemtomap map` on a small log: every file is there, says the same thing, and comes out the same twice."""

import json
import sqlite3

import numpy as np
import pytest
import yaml
from PIL import Image

from lemtomap import se2
from lemtomap.robot.cli.main import main

WIDTH_M, DEPTH_M = 7.0, 5.0
SCANS = 60
DRIVE = [(1.0 + 0.06 * k, 1.0 + 0.6 * np.sin(k / 10), 0.4 * np.cos(k / 10)) for k in range(SCANS)]


def flaser(x, y, yaw, stamp_s):
    """One CARMEN line: a SICK at (x, y, yaw) in an empty room with a pillar."""
    bearings = yaw - np.pi / 2 + np.arange(181) * np.pi / 180
    cos, sin = np.cos(bearings), np.sin(bearings)
    with np.errstate(divide="ignore"):
        walls = np.minimum(
            np.where(cos > 0, (WIDTH_M - x) / cos, -x / cos), np.where(sin > 0, (DEPTH_M - y) / sin, -y / sin)
        )
    along = (4.5 - x) * cos + (3.5 - y) * sin
    aside = np.abs((4.5 - x) * sin - (3.5 - y) * cos)
    pillar = np.where((along > 0) & (aside < 0.3), along - np.sqrt(np.maximum(0.09 - aside**2, 0)), np.inf)
    ranges = " ".join(f"{value:.3f}" for value in np.minimum(walls, pillar))
    pose = f"{x:.6f} {y:.6f} {yaw:.6f}"
    return f"FLASER 181 {ranges} {pose} {pose} {stamp_s:.6f} host {stamp_s:.6f}\n"


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "room.clf"
    path.write_text("".join(flaser(*pose, 976052857.25 + 0.2 * k) for k, pose in enumerate(DRIVE)))
    return path


@pytest.fixture(scope="module")
def out(log, tmp_path_factory):
    folder = tmp_path_factory.mktemp("out") / "deep" / "room"
    assert main(["map", str(log), "--out", str(folder), "--seed", "3"]) == 0
    return folder


def test_all_files_are_there_and_nothing_else(out):
    names = sorted(path.name for path in out.iterdir())
    expected = ["grid.pgm", "grid.yaml", "map.lemto", "overview.png", "summary.json", "trajectory.tum"]
    assert names == expected
    assert [path.name for path in out.parent.iterdir()] == [out.name]


def test_the_trajectory_is_the_drive(out):
    rows = np.loadtxt(out / "trajectory.tum")
    assert rows.shape == (SCANS, 8)
    assert rows[0, 0] == 976052857.25
    first, last = (np.array([row[1], row[2], 2 * np.arctan2(row[6], row[7])]) for row in rows[[0, -1]])
    k = SCANS - 1
    truth = se2.between([1.0, 1.0, 0.4], [1.0 + 0.06 * k, 1.0 + 0.6 * np.sin(k / 10), 0.4 * np.cos(k / 10)])
    assert se2.between(first, last) == pytest.approx(truth, abs=0.05)


def test_the_grid_lies_over_the_trajectory(out):
    told = yaml.safe_load((out / "grid.yaml").read_text())
    rows, cols = np.nonzero(np.flipud(np.asarray(Image.open(out / "grid.pgm"))) == 0)
    corner = np.stack([cols + 0.5, rows + 0.5], axis=-1) * told["resolution"]
    first = np.loadtxt(out / "trajectory.tum")[0]
    T_world_map = se2.compose(DRIVE[0], se2.inverse([first[1], first[2], 2 * np.arctan2(first[6], first[7])]))
    walls = se2.transform(se2.compose(T_world_map, told["origin"]), corner)
    off = np.min(np.abs([walls[:, 0], walls[:, 0] - WIDTH_M, walls[:, 1], walls[:, 1] - DEPTH_M]), axis=0)
    off_pillar = np.abs(np.hypot(walls[:, 0] - 4.5, walls[:, 1] - 3.5) - 0.3)
    assert len(walls) > 200
    assert np.quantile(np.minimum(off, off_pillar), 0.95) < 0.1


def test_without_a_clock_no_time_and_no_rate_is_told(tmp_path, capsys):
    lines = [flaser(*pose, 5.0) for pose in DRIVE[:6]]
    (tmp_path / "still.clf").write_text("".join(lines))
    assert main(["map", str(tmp_path / "still.clf"), "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr()
    assert "real time" not in said.out
    assert "the stamps are no clock" in said.err
    assert (
        not {"log_s", "realtime_factor"} & json.loads((tmp_path / "out" / "summary.json").read_text()).keys()
    )


def test_the_user_is_told_in_which_frame_the_grid_lies_and_what_was_odd(log, tmp_path, capsys):
    lines = log.read_text().splitlines(keepends=True)[:8]
    (tmp_path / "odd.LOG").write_text("".join([*lines[:4], lines[4][:200] + "\n", *lines[5:]]))
    assert main(["map", str(tmp_path / "odd.LOG"), "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr()
    assert "lays it into the frame of trajectory.tum" in said.out
    assert said.err.count("broken lines are skipped (line 5: ") == 1


def test_a_field_of_view_can_be_given(tmp_path, capsys):
    line = flaser(*DRIVE[0], 5.0).replace("FLASER 181", "FLASER 179").split(" ")
    (tmp_path / "a.clf").write_text(" ".join(line[:181] + line[183:]))
    arguments = ["map", str(tmp_path / "a.clf"), "--out", str(tmp_path / "out")]
    assert main(arguments) == 2
    assert "--field-of-view" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
    assert main([*arguments, "--field-of-view", "178"]) == 0
    assert main([*arguments, "--field-of-view", "400"]) == 2


def test_summary_map_and_picture_agree(out):
    told = json.loads((out / "summary.json").read_text())
    with sqlite3.connect(out / "map.lemto") as map_file:
        (nodes,) = map_file.execute("SELECT count(*) FROM node").fetchone()
    map_file.close()
    assert told["scans"] == SCANS
    assert told["nodes"] == nodes
    assert nodes >= 4
    assert told["map_bytes"] == (out / "map.lemto").stat().st_size
    assert (told["seed"], told["slam"], told["config"]["slam"]["particles"]) == (3, "window", 1)
    needed = {
        "updates",
        "cpu_s",
        "wall_s",
        "realtime_factor",
        "peak_rss_mb",
        "path_m",
        "edges",
        "loop_closures",
    }
    assert needed | {"config", "versions"} <= told.keys()
    with Image.open(out / "overview.png") as picture:
        assert picture.size == (1800, 1200)


def test_same_log_and_seed_give_the_same_bytes(log, out, tmp_path):
    assert main(["map", str(log), "--out", str(tmp_path / "again"), "--seed", "3"]) == 0
    for name in ("trajectory.tum", "grid.pgm"):
        assert (tmp_path / "again" / name).read_bytes() == (out / name).read_bytes()


@pytest.mark.parametrize(
    ("options", "slam"),
    [(["--slam", "gmapping", "--particles", "2"], "gmapping"), (["--particles", "2"], "rolling")],
)
def test_particles_map_it_too(log, tmp_path, options, slam):
    out = tmp_path / slam
    assert main(["map", str(log), "--out", str(out), *options]) == 0
    assert len((out / "trajectory.tum").read_text().splitlines()) == SCANS
    assert json.loads((out / "summary.json").read_text())["slam"] == slam


def test_a_single_hypothesis_with_particles_is_refused(log, tmp_path, capsys):
    assert main(["map", str(log), "--out", str(tmp_path / "x"), "--slam", "window", "--particles", "2"]) == 2
    assert "follows one pose only" in capsys.readouterr().err
    assert not (tmp_path / "x").exists()


@pytest.fixture
def ask(out, tmp_path, capsys):
    """Run a command on a copy of the map; return (exit code, what it said)."""
    map_file = tmp_path / "room.lemto"
    map_file.write_bytes((out / "map.lemto").read_bytes())

    def run(command, *arguments):
        code = main([command, str(map_file), *(str(argument) for argument in arguments)])
        said = capsys.readouterr()
        return code, (said.out + said.err).strip()

    return run


def test_a_place_is_named_blocked_and_given_back_by_undo(ask):
    assert ask("edit", "name", 2, "kitchen") == (0, "node 2 is now 'kitchen'")
    assert ask("edit", "block", "kitchen", 3)[0] == 0
    assert "kitchen = 2" in ask("info")[1]
    assert ask("edit", "undo")[0] == ask("edit", "undo")[0] == 0
    assert "names         none" in ask("info")[1]
    assert ask("edit", "undo") == (0, "nothing to take back")


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["dance"], "must be one of name, unname"),
        (["name", "2"], "needs NODE NAME"),
        (["name", "9999", "x"], "'9999'"),
        (["level", "2", "upstairs"], "'upstairs'"),
    ],
)
def test_an_edit_that_cannot_be_is_one_line(ask, words, reason):
    code, said = ask("edit", *words)
    assert code == 2
    assert reason in said
    assert said.count("\n") == 0


@pytest.mark.parametrize("suffix", ["geojson", "tmap2", "g2o", "graphml", "png"])
def test_the_map_is_written_for_other_programs(ask, tmp_path, suffix):
    target = tmp_path / f"room.{suffix}"
    assert ask("export", target)[0] == 0
    assert target.stat().st_size > 100


def test_an_export_nobody_knows_is_refused(ask, tmp_path):
    code, said = ask("export", tmp_path / "room.doc")
    assert (code, (tmp_path / "room.doc").exists()) == (2, False)
    assert ".geojson" in said
