"""`lemtomap config`: every setting, what it is now, and who said so."""

import json
import os
import pty
import tomllib

import pytest

from lemtomap.robot.cli.main import main
from lemtomap.robot.config import RobotConfig
from lemtomap.robot.settings.read import load
from lemtomap.robot.settings.tree import all_settings

FILE = """\
# what is special about this robot
[laser]
x_m = 0.05

[nav]
body = { v_max_mps = 0.3 }
recovery.attempts = 3
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "robot.toml"
    path.write_text(FILE)
    return path


@pytest.fixture
def told(capsys):
    """Run the command and return what it prints."""

    def run(*arguments):
        assert main(["config", *map(str, arguments)]) == 0
        return capsys.readouterr().out

    return run


@pytest.fixture
def refused(capsys):
    """Run the command, which must refuse; return the one line it says."""

    def run(*arguments):
        assert main(["config", *map(str, arguments)]) == 2
        said = capsys.readouterr()
        assert said.out == ""
        assert said.err.count("\n") == 1
        return said.err.removeprefix("lemtomap: ").rstrip()

    return run


def rows(text):
    """Return the lines below the heading, by the name of their setting."""
    return {line.split()[0]: line.split()[1:] for line in text.splitlines()[1:]}


def test_every_setting_has_a_line_with_value_unit_default_and_source(told):
    lines = rows(told())
    assert list(lines) == [setting.name for setting in all_settings().values()]
    assert lines["nav.body.v_max_mps"] == ["0.5", "m/s", "0.5", "default"]
    assert lines["slam.particles"] == ["5", "5", "default"]
    assert lines["slam.max_range_m"] == ["none", "m", "none", "default"]
    assert lines["topo.durable"] == ["true", "true", "default"]
    assert lines["ports.kobuki"] == ['""', '""', "default"]


def test_a_value_of_a_file_is_shown_with_file_and_line_and_the_default_beside_it(told, file):
    lines = rows(told(file))
    assert lines["laser.x_m"] == ["0.05", "m", "0.0", f"{file}:3"]
    assert lines["laser.y_m"] == ["0.0", "m", "0.0", "default"]
    assert lines["nav.body.v_max_mps"] == ["0.3", "m/s", "0.5", f"{file}:6"]
    assert lines["nav.body.w_max_radps"][-1] == "default"
    assert lines["nav.recovery.attempts"] == ["3", "2", f"{file}:7"]


def test_the_command_line_is_over_the_file(told, file):
    lines = rows(told(file, "--set", "laser.x_m=-0.1", "--set", "ports.kobuki=/dev/my base"))
    assert lines["laser.x_m"] == ["-0.1", "m", "0.0", "command", "line"]
    assert lines["ports.kobuki"] == ['"/dev/my', 'base"', '""', "command", "line"]
    assert lines["nav.body.v_max_mps"][0] == "0.3"


def test_a_value_said_to_be_the_default_still_names_who_said_it(told, tmp_path):
    path = tmp_path / "robot.toml"
    path.write_text("[body]\nradius_m = 0.18\n")
    assert rows(told(path, "--section", "body")) == {"body.radius_m": ["0.18", "m", "0.18", f"{path}:2"]}


def test_a_section_is_shown_with_those_within_it_and_no_other(told):
    names = [setting.name for setting in all_settings().values()]
    assert list(rows(told("--section", "nav.body"))) == [n for n in names if n.startswith("nav.body.")]
    assert list(rows(told("--section", "nav"))) == [n for n in names if n.startswith("nav.")]
    assert "navel" not in told("--section", "loops.locator.match")


def test_a_section_that_is_none_is_refused_with_those_there_are(refused):
    said = refused("--section", "motor")
    assert "--section motor: no such section; there are body, ports, devices, laser" in said
    assert "--section" in refused("--section", "nav.body.v_max_mps")


def test_programs_get_json_with_value_range_unit_and_source(told, file):
    found = json.loads(told(file, "--json"))
    assert list(found) == [setting.name for setting in all_settings().values()]
    assert found["nav.body.v_max_mps"] == {
        "value": 0.3,
        "default": 0.5,
        "unit": "m/s",
        "range": [0.05, 0.7],
        "source": f"{file}:6",
        "about": "thesis' DWA setting; the base can do 0.7",
    }
    assert found["ports.kobuki"]["range"] is None


def test_a_written_file_holds_every_default_and_changes_nothing(told, tmp_path):
    path = tmp_path / "new.toml"
    assert str(path) in told("--write", path)
    assert load(path) == RobotConfig()
    data = tomllib.loads(path.read_text())
    for setting in all_settings().values():
        at = data
        for name in setting.key[:-1]:
            at = at[name]
        assert at.get(setting.key[-1]) == setting.default, setting.name


def test_a_written_file_says_what_each_setting_is_for_its_unit_and_its_range(told, tmp_path):
    path = tmp_path / "new.toml"
    told("--write", path)
    comment = path.read_text().split("\nv_max_mps")[0].rsplit("\n\n", 1)[1]
    assert comment == "# thesis' DWA setting; the base can do 0.7; m/s between 0.05 and 0.7"
    assert max(map(len, path.read_text().splitlines())) <= 100


def test_a_file_that_is_there_is_not_overwritten(refused, file):
    assert refused("--write", file) == f"{file}: exists already, and is not overwritten"
    assert file.read_text() == FILE


def test_a_file_that_cannot_be_written_is_named_and_nothing_is_left(refused, tmp_path, monkeypatch):
    assert "No such file" in refused("--write", tmp_path / "none" / "new.toml")
    monkeypatch.setattr("pathlib.Path.open", lambda *_args, **_kwargs: open("/dev/full", "w"))  # noqa: SIM115, PTH123
    path = tmp_path / "new.toml"
    path.write_text("")
    assert "No space left" in refused("--write", path)
    assert not path.exists()


def test_on_a_terminal_what_differs_from_the_default_stands_out(file, monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "400")
    ours, theirs = pty.openpty()
    with os.fdopen(theirs, "w") as terminal:
        monkeypatch.setattr("sys.stdout", terminal)
        assert main(["config", str(file), "--section", "laser"]) == 0
    text = os.read(ours, 100_000).decode()
    os.close(ours)
    changed, default = (next(line for line in text.splitlines() if name in line) for name in ("x_m", "y_m"))
    assert "\x1b[1" in changed
    assert "\x1b[1" not in default
    assert f"{file}:3" in changed


def test_a_reader_that_has_gone_is_no_fault(monkeypatch):
    class Gone:
        def isatty(self):
            return False

        def write(self, _text):
            raise BrokenPipeError

        def flush(self):
            raise BrokenPipeError

    monkeypatch.setattr("sys.stdout", Gone())
    assert main(["config"]) == 0
