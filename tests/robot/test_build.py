"""A robot is put together as its settings say."""

from pathlib import Path

import pytest

from lemtomap.errors import BadSetting
from lemtomap.robot import build, build_map
from lemtomap.robot.config import RobotConfig
from lemtomap.robot.runs.map_log import chosen
from lemtomap.robot.settings.check import from_mapping


def test_a_slam_that_is_none_is_refused_with_those_there_are():
    with pytest.raises(BadSetting, match=r"slam 'magic': must be one of .*window"):
        build_map.build_slam("magic", RobotConfig(), 0)


def test_the_map_file_is_synced_only_where_both_settings_and_caller_want_it(tmp_path, monkeypatch):
    taken = []

    def create(_path, *, durable, commit_every_s):
        taken.append(durable)
        raise InterruptedError

    monkeypatch.setattr(build.TopoStore, "create", create)
    quick = from_mapping({"topo": {"durable": False}})
    for config, durable in ((RobotConfig(), True), (RobotConfig(), False), (quick, True)):
        with pytest.raises(InterruptedError):
            build.build_core(config, tmp_path / "map.lemto", durable=durable)
    assert taken == [True, False, False]


def test_the_seed_reaches_the_slam(monkeypatch):
    monkeypatch.setitem(build_map.SLAMS, "window", lambda _config, seed: seed)
    assert build_map.build_slam("window", RobotConfig(), 7) == 7


@pytest.mark.parametrize(
    ("slam", "orders", "particles"),
    [
        ("window", [], 1),
        ("window", ["slam.particles=9"], 1),
        ("rolling", [], 5),
        ("rolling", ["slam.particles=9"], 9),
        ("gmapping", [], 30),
        ("gmapping", ["slam.particles=9"], 9),
    ],
)
def test_each_metric_layer_has_its_usual_particles_unless_somebody_says_otherwise(slam, orders, particles):
    assert chosen(slam, None, orders).slam.particles == particles


def test_a_window_slam_takes_no_particles_and_options_are_over_a_file(tmp_path: Path):
    with pytest.raises(BadSetting, match=r"--particles 2: --slam window follows one pose only"):
        chosen("window", None, [], particles=2)
    file = tmp_path / "robot.toml"
    file.write_text("[slam]\nmax_range_m = 4.0\nwindow_m = 12.0\n")
    assert chosen("window", file, [], max_range_m=5.0).slam.max_range_m == 5.0
    assert chosen("window", file, []).slam.window_m == 12.0
