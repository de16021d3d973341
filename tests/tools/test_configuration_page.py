"""docs/configuration.md says what the program does."""

import dataclasses
import tomllib

from lemtomap.robot.settings.check import from_mapping
from lemtomap.robot.settings.tree import all_settings, notes_of
from lemtomap.settings import within
from tools.configuration_page import HEAD, PAGE, page


def test_the_page_is_current():
    assert PAGE.read_text(encoding="utf-8") == page(), "run python tools/configuration_page.py"


def test_every_key_stands_in_its_table():
    tables = {part.partition("]")[0]: part for part in page().split("\n## [")[1:]}
    keys = [(".".join(key[:-1]), key[-1]) for key in all_settings()]
    missing = [(table, key) for table, key in keys if f"\n| `{key}` |" not in tables[table]]
    assert missing == []


def test_the_example_of_the_page_is_a_settings_file():
    lines = HEAD[HEAD.index("    # robot.toml") :].split("\nA key")[0]
    assert from_mapping(tomllib.loads(lines)).nav.body.v_max_mps == 0.3


@dataclasses.dataclass
class Example:
    """Settings."""

    # a heading, which belongs to no key

    beside_m: float = within(1.0, 0.0, 2.0)  # it stands beside
    below_m: float = within(1.0, 0.0, 2.0)
    """It stands
    below.
    """
    bare_m: float = within(1.0, 0.0, 2.0)


def test_what_stands_beside_and_below_a_field_is_what_the_page_says():
    assert notes_of(Example) == {"beside_m": "it stands beside", "below_m": "It stands below.", "bare_m": ""}
