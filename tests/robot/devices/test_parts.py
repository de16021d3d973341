"""Recordings stay below a limit, in parts that can each be used by itself."""

import json
import shutil
from importlib.util import find_spec

import numpy as np
import pytest

from lemtomap.errors import BadSetting
from lemtomap.robot.cli.main import main
from lemtomap.robot.devices.parts import (
    PARTS,
    PartFiles,
    parse_size,
    part_number,
    part_path,
    parts_of,
)
from lemtomap.robot.devices.recorded import Recording
from lemtomap.robot.output.view import find_recording
from lemtomap.robot.output.viewer import Viewer


def fill(files, size):
    files.path.write_bytes(bytes(size))


def test_the_oldest_part_goes_when_there_are_too_many(tmp_path):
    files = PartFiles(tmp_path / "run.mcap", limit_bytes=8000)
    for _ in range(PARTS + 3):
        fill(files, 1000)
        assert files.full
        files.advance()
    fill(files, 10)
    held = parts_of(tmp_path / "run.mcap")
    assert [part_number(path) for path in held] == list(range(5, 13))
    assert (files.number, files.dropped, files.full) == (12, 4, False)
    assert files.written_bytes == 11 * 1000 + 10


def test_parts_are_found_in_their_order_and_nothing_else_is(tmp_path):
    first = tmp_path / "run.mcap"
    for name in ("run.mcap", "run.0002.mcap", "run.0010.mcap", "run.10000.mcap", "run.rrd", "run.old.mcap"):
        (tmp_path / name).touch()
    assert [path.name for path in parts_of(first)] == [
        "run.mcap",
        "run.0002.mcap",
        "run.0010.mcap",
        "run.10000.mcap",
    ]
    assert all(part_path(first, part_number(path)) == path for path in parts_of(first))


@pytest.mark.parametrize(
    ("text", "size"), [("8MB", 8 * 10**6), ("2GB", 2 * 10**9), ("1.5 G", 15 * 10**8), ("9000000", 9 * 10**6)]
)
def test_sizes_are_read_as_people_write_them(text, size):
    assert parse_size(text) == size


@pytest.mark.parametrize("text", ["", "much", "-2GB", "2GiB", "1MB", "nan", "1e9", "9" * 400])
def test_other_sizes_are_refused(text):
    with pytest.raises(BadSetting, match="size"):
        parse_size(text)


def test_a_bad_limit_is_refused_before_anything_moves(tmp_path, capsys):
    assert main(["sim", "--fast", "--record-limit", "lots", "--out", str(tmp_path / "out")]) == 2
    assert "size 'lots'" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_the_view_goes_on_in_parts_that_each_can_be_opened(tmp_path):
    viewer = Viewer(tmp_path / "run.rrd", print, live=False, limit_bytes=PARTS * 1000)
    viewer.show_world([np.array([[0.0, 0.0], [5.0, 5.0]])])
    for step in range(40 * PARTS):
        viewer.show_robot(10.0 * step, np.array([0.1 * step, 0.0, 0.0]), np.zeros((700, 2)))
        viewer.keep_within_limit(10.0 * step)
    viewer.close()
    parts = parts_of(tmp_path / "run.rrd")
    assert 1 < len(parts) <= PARTS
    assert all(find_recording(path) == path for path in parts)
    assert find_recording(tmp_path) == parts[0]
    assert b"truth/walls" in parts[-1].read_bytes()


@pytest.mark.skipif(find_spec("pybullet") is None, reason="needs pybullet")
def test_a_run_says_how_fast_its_recordings_grow_and_a_new_run_clears_all_parts(tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    for name in ("run.0007.mcap", "run.0009.rrd"):
        (out / name).touch()
    assert main(["sim", "--fast", "--duration", "2", "--mission", "explore", "--out", str(out)]) == 0
    assert not (out / "run.0007.mcap").exists()
    assert not (out / "run.0009.rrd").exists()
    recorded = json.loads((out / "summary.json").read_text())["recorded"]
    for name in ("run.mcap", "run.rrd"):
        size = (out / name).stat().st_size
        assert recorded[name]["bytes"] == pytest.approx(size, rel=0.01)
        assert recorded[name]["mb_per_hour"] == pytest.approx(size / 1e6 / (2.0 / 3600.0), rel=0.1)
        assert recorded[name]["parts_dropped"] == 0
    shutil.copy(out / "run.mcap", out / "run.0003.mcap")
    assert "a part is gone" in Recording.open(out).told_gaps()
