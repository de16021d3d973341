"""docs/commands.md names everything that can be typed."""

import re
from pathlib import Path

import pytest
import typer.main

from lemtomap.errors import BadSetting
from lemtomap.robot.cli.main import INTERRUPTED, app
from lemtomap.robot.missions.missions import parse_mission

PAGE = (Path(__file__).resolve().parent.parent.parent / "docs" / "commands.md").read_text(encoding="utf-8")


def rows(heading):
    """Return the first cells of the table under a heading."""
    part = PAGE.split(f"# {heading}\n")[1].split("\n## ")[0]
    return [line.split("|")[1].strip() for line in part.splitlines() if line.startswith("| ")][1:]


def test_every_command_is_in_the_table():
    named = [name for cell in rows("Commands") for name in re.findall(r"`(\w+)`", cell)]
    assert sorted(named) == sorted(typer.main.get_command(app).commands)


def test_every_mission_of_the_table_is_taken_and_none_is_left_out():
    words = [re.findall(r"`(.+)`", cell)[0] for cell in rows("Missions")]
    for word in words:
        parse_mission(word.replace("N", "2"))
    with pytest.raises(BadSetting) as refused:
        parse_mission("fly")
    offered = re.findall(r"[a-z]+(?::[A-Z]+)?", str(refused.value).split("must be ")[1].split(", or")[0])
    assert set(offered) <= set(words)


def test_the_exit_codes_are_those_of_the_program():
    assert rows("Exit codes") == ["0", "1", "2", str(INTERRUPTED)]
