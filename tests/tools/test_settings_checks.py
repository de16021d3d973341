"""Every setting is read by its stage, and every number of a stage can be set or says why not."""

import dataclasses

import pytest

from lemtomap.robot.settings.tree import all_settings
from tools.checks import settings


def test_no_setting_is_read_by_nothing():
    assert settings.unread() == []


def test_no_settings_and_no_number_with_a_unit_is_out_of_reach_without_a_reason():
    assert settings.out_of_reach() == []


def reads_of(tmp_path, source):
    path = tmp_path / "stage.py"
    path.write_text(source)
    return settings._reads(path)


V_MAX = all_settings()["nav", "body", "v_max_mps"]


@pytest.mark.parametrize(
    ("source", "read"),
    [
        ("def go(body): return body.v_max_mps", True),
        ("def go(robot): return robot._body.v_max_mps", True),
        ("def go(config: BodyLimits): return config.v_max_mps", True),
        ("def go(nav):\n    config = nav.body\n    return config.v_max_mps", True),
        ("class BodyLimits:\n    def half(self): return self.v_max_mps / 2", True),
        ("class BodyLimits:\n    def __post_init__(self): check(self.v_max_mps)", False),
        ("def _relations(config: BodyLimits): return config.v_max_mps", False),
        ("class Robot:\n    def go(self, x: BodyLimits): return self.v_max_mps", False),
        ("def go(config): return config.v_max_mps", False),
        ("def go(sample): return sample.v_max_mps", False),
        ("def go(body): body.v_max_mps = 1", False),
        ("v_max_mps = 1", False),
    ],
)
def test_a_setting_is_read_where_its_table_or_its_class_is_known(tmp_path, source, read):
    assert settings._is_read(V_MAX, [reads_of(tmp_path, source)]) is read


def test_what_is_said_once_is_read_where_a_stage_reads_it_by_its_own_name(tmp_path):
    radius = all_settings()["body", "radius_m"]
    assert settings._is_read(radius, [reads_of(tmp_path, "def go(safety): return safety.body_radius_m")])
    assert not settings._is_read(radius, [reads_of(tmp_path, "def go(safety): return safety.own_parts_m")])


def test_a_setting_that_nobody_reads_is_found(monkeypatch):
    idle = dataclasses.replace(V_MAX, key=("nav", "body", "colour_m"))
    monkeypatch.setattr(settings, "all_settings", lambda: {idle.key: idle, V_MAX.key: V_MAX})
    assert settings.unread() == ["nav.body.colour_m"]


@pytest.mark.parametrize(
    ("source", "bare"),
    [
        ("FAR_M = 3.0\n", ["FAR_M"]),
        ("_FAR_M: float = 3.0\n", ["_FAR_M"]),
        ("FAR_M, TURN_RAD = 3.0, -0.5\n", ["FAR_M", "TURN_RAD"]),
        ("STEPS_S = (0.1, 0.2)\n", ["STEPS_S"]),
        ("FAR_M = 2 * 1.5\nNEAR_M = 1.0\n", ["FAR_M", "NEAR_M"]),
        ("FAR_M = 3.0  # as far as it sees\n", []),
        ('FAR_M = 3.0\n"""As far as it sees."""\n', []),
        ("# As far as it sees.\nFAR_M = 3.0\n", []),
        ("HEADER = 3\n", []),
        ("FAR_M = reach()\n", []),
        ("def go():\n    FAR_M = 3.0\n", []),
    ],
)
def test_a_number_with_a_unit_needs_a_reason(source, bare):
    assert settings.bare_numbers(source) == bare


def test_settings_beside_the_tree_are_found(tmp_path):
    path = tmp_path / "stage.py"
    path.write_text("class NavConfig: ...\nclass ArmConfig: ...\nclass ArmLimits: ...\nclass Arm: ...\n")
    assert settings.stray_tables(path) == ["ArmConfig", "ArmLimits"]
