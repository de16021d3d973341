"""What somebody meets who has only just installed the program."""

import subprocess
import sys
from importlib.metadata import version

import pytest

from lemtomap.robot.child import python
from lemtomap.robot.cli.main import main

WITHOUT_PHYSICS = """
import sys
sys.modules["pybullet"] = None
from lemtomap.robot.cli.main import main
print([main(options) for options in {}])
"""


def without_physics(folder, *commands):
    """Return what a machine without pybullet says to some commands, one after another."""
    code = WITHOUT_PHYSICS.format([command.split() for command in commands])
    return subprocess.run(python("-c", code), check=True, capture_output=True, text=True, cwd=folder)  # noqa: S603


def test_the_simulator_without_pybullet_says_how_to_get_it(tmp_path):
    done = without_physics(tmp_path, "sim", "sim --serve", "sim --fast --nav metric")
    assert done.stdout == "[2, 2, 2]\n"
    lines = done.stderr.splitlines()
    assert len(lines) == 3
    assert len(set(lines)) == 1
    for words in ("needs pybullet", "pip install 'lemtomap[sim]'", "pip install '.[sim]'"):
        assert words in lines[0]
    assert ("made for Python 3.11" in lines[0]) is (sys.version_info >= (3, 12))
    assert not list(tmp_path.iterdir())


def test_everything_but_driving_a_simulated_robot_works_without_pybullet(tmp_path):
    done = without_physics(tmp_path, "--version", "run --help", "bench", "sim --world list")
    assert done.stdout.splitlines()[-1] == "[0, 0, 0, 0]"


def test_the_version_is_told_first(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.splitlines()[0] == f"lemtomap {version('lemtomap')}"


def test_the_shell_completes_commands_and_options(capsys, monkeypatch):
    monkeypatch.setenv("_LEMTOMAP_COMPLETE", "complete_bash")
    for typed, offered in (("lemtomap re", {"record", "replay"}), ("lemtomap run --mis", {"--mission"})):
        monkeypatch.setenv("COMP_WORDS", typed)
        monkeypatch.setenv("COMP_CWORD", str(len(typed.split()) - 1))
        with pytest.raises(SystemExit, match="0"):
            main([])
        assert set(capsys.readouterr().out.split()) == offered
    monkeypatch.delenv("_LEMTOMAP_COMPLETE")
    assert main(["--help"]) == 0
    assert "--install-completion" in capsys.readouterr().out.split("Options:")[1]
