"""The examples run as a newcomer runs them: each as a program, in a folder of its own."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


def run(name, folder, *arguments, code=0):
    """Return what the example printed."""
    command = [sys.executable, "-W", "error", str(ROOT / "examples" / name), *map(str, arguments)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300, check=False)  # noqa: S603 - our own
    assert done.returncode == code, done.stderr
    return done.stdout + done.stderr


def test_an_example_is_short_and_says_what_to_see():
    assert len(EXAMPLES) >= 6
    for path in EXAMPLES:
        text = path.read_text(encoding="utf-8")
        assert text.startswith('"""'), path.name
        assert len(text.splitlines()) < 60, path.name
        assert re.search(r"\b(prints?|says)\b", text.split('"""')[1]), path.name


def test_own_scans_ends_with_the_ten_lines_of_the_readme():
    (lines,) = re.findall(
        r"```python\nimport lemtomap\n\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL
    )
    assert len(lines.splitlines()) <= 10
    assert (ROOT / "examples" / "own_scans.py").read_text().endswith("\n\n\n" + lines)


def test_own_scans_are_mapped_and_the_map_can_be_read_and_gone_on_with(tmp_path):
    assert re.fullmatch(r"at node 6 of 6 in sight, quality 1\.00\n", run("own_scans.py", tmp_path))
    told = run("read_map.py", tmp_path, "my.lemto").splitlines()
    assert len(told) == 6
    assert re.fullmatch(r"node 2  at x 1\.\d\d m, y -?0\.00 m; to 3 \(1\.10 m, 2\.\d s\), 1 \(.*\)", told[1])
    assert "at node 6 of " in run("own_scans.py", tmp_path)


def test_a_map_that_is_none_is_told_in_one_line(tmp_path):
    (tmp_path / "none.lemto").write_text("nothing")
    assert len(run("read_map.py", tmp_path, "none.lemto", code=2).splitlines()) == 1


def test_the_robot_drives_to_the_place_it_is_told(tmp_path):
    told = run("drive_there.py", tmp_path)
    assert "arrived: arrived at node 1" in told
    away_m = float(told.splitlines()[-1].split()[0])
    assert away_m < 0.15


def test_a_laser_of_ones_own_loses_only_what_is_damaged(tmp_path):
    told = run("own_laser.py", tmp_path).splitlines()
    assert told == [f"{beams} beams, wall at 2.0 m" for beams in (360, 354, 360)]


def test_a_mission_of_ones_own_is_driven(tmp_path):
    pytest.importorskip("pybullet")
    told = run("own_mission.py", tmp_path)
    assert len(re.findall(r"at corner", told)) == 4
    assert told.endswith("done: all corners driven\n")


def test_a_world_of_ones_own_is_explored_without_a_touch(tmp_path):
    pytest.importorskip("pybullet")
    told = run("own_world.py", tmp_path)
    assert told.startswith("done after")
    assert told.endswith(", 0 contacts\n")
