"""What a settings file or the command line may get wrong: one line with place, key, value and rule."""

import pytest

from lemtomap.errors import BadSetting
from lemtomap.robot.cli.main import main
from lemtomap.robot.config import RobotConfig
from lemtomap.robot.settings.check import from_mapping
from lemtomap.robot.settings.read import read_settings
from lemtomap.robot.settings.tree import all_settings, to_mapping, unit_of

BAD = {
    "a word for a number": ("[safety]\nv_max_mps = 'fast'\n", "2: safety.v_max_mps: 'fast' must be a number"),
    "a list": ("[safety]\nv_max_mps = [1, 2]\n", "2: safety.v_max_mps: [1, 2] must be a number"),
    "a table for a number": (
        "\n[safety.v_max_mps]\na = 1\n",
        "2: safety.v_max_mps: must be a number, not a table",
    ),
    "a table in line": ("[safety]\nv_max_mps = {a = 1}\n", "2: safety.v_max_mps: must be a number, not a"),
    "a number for a table": ("\nsafety = 3\n", "2: safety: 3 must be a table of settings"),
    "tables in a list": ("[[safety]]\nx = 1\n", "1: safety: [{'x': 1}] must be a table of settings"),
    "a number for a truth": ("[topo]\ndurable = 1\n", "2: topo.durable: 1 must be true or false"),
    "a word for a truth": ("[topo]\ndurable = 'yes'\n", "2: topo.durable: 'yes' must be true or false"),
    "a truth for a number": ("[slam]\nwindow_m = true\n", "2: slam.window_m: true must be a number"),
    "a number for text": ("[ports]\nkobuki = 3\n", "2: ports.kobuki: 3 must be text"),
    "a fraction": ("[slam]\nparticles = 5.0\n", "2: slam.particles: 5.0 must be an integer"),
    "nan": ("[slam]\nwindow_m = nan\n", "2: slam.window_m: nan must be a finite number"),
    "inf": ("[slam]\nwindow_m = -inf\n", "2: slam.window_m: -inf must be a finite number"),
    "negative": ("[slam]\nwindow_m = -20\n", "2: slam.window_m: -20 must lie between 4 and 60"),
    "a long value": (f"[slam]\nwindow_m = '{'x' * 99}'\n", "xxx ... must be a number"),
    "a key in line": ("[nav]\nbody = {v_max_mps = 9}\n", "2: nav.body.v_max_mps: 9 must lie between"),
    "a range too far": (
        "[slam]\nmax_range_m = 12\n",
        "2: slam.max_range_m: max_range_m = 12, window_m = 20: the window must be at least twice as wide",
    ),
    "a window too narrow": (
        "[slam]\n\nwindow_m = 4\nresolution_m = 0.2\nhits_averaged = 3\nmax_range_m = 3",
        "6: slam.max_range_m: max_range_m = 3, window_m = 4: the window must be at least twice as wide",
    ),
    "few cells": ("[slam]\nwindow_m = 3.9\n", "2: slam.window_m: 3.9 must lie between 4 and 60"),
    "collapse above good": (
        "[slam]\ncollapse_share = 0.95\n",
        "2: slam.collapse_share: collapse_share = 0.95",
    ),
    "least above most": (
        "[slam]\nheading_least = 1\nheading_most = 1\nparticles = 0",
        "4: slam.particles: 0",
    ),
    "a margin too wide": (
        "[topo]\nassociation_margin_m = 2\n",
        "2: topo.association_margin_m: association_margin_m = 2, new_node_distance_m = 1: the margin must",
    ),
    "few pages": ("[topo]\npaged_nodes = 100\n", "2: topo.paged_nodes: paged_nodes = 100, local_limit = 400"),
    "many nodes": (
        "[topo]\nlocal_limit = 999\n",
        "2: topo.local_limit: paged_nodes = 1024, local_limit = 999",
    ),
    "a small circle": (
        "[topo]\nlocal_radius_m = 3\n",
        "2: topo.local_radius_m: near_neighbour_max_m = 4, local_radius_m = 3: near_neighbour_max_m must not",
    ),
    "turns for ever": (
        "[nav]\nturn_end_rad = 1.2\n",
        "2: nav.turn_end_rad: turn_end_rad = 1.2, turn_start_rad = 1.05: turn_end_rad must not be above",
    ),
    "looks seldom": (
        "[nav]\nplan_period_s = 3\n",
        "2: nav.plan_period_s: plan_period_s = 3, look_period_s = 1",
    ),
    "plans seldom": ("[nav]\nplan_period_s = 0.05\n", "2: nav.plan_period_s: period_s = 0.1, plan_period_s"),
    "free and occupied": (
        "[loops.locator.match]\nfree_below = 50\n",
        "2: loops.locator.match.free_below: free_below = 50, occupied_from = 40: free_below must not be",
    ),
    "half a door": (
        "[body]\nradius_m = 0.45\n",
        "2: body.radius_m: 0.45 must lie between 0.178 and 0.4 (a Kob",
    ),
    "a laser outside": ("[laser]\ny_m = -0.3\n", "2: laser.y_m: 0.3 m from the middle is outside the body"),
    "a laser aslant": ("[laser]\nroll_deg = 90\n", "2: laser.roll_deg: roll_deg = 90: must be 0 or 180"),
    "a gate too wide": (
        "[safety]\nside_margin_m = 0.015\n",
        "2: safety.side_margin_m: 0.015 must be below nav.collision.skin_m (0.015), or",
    ),
    "a slow cycle": (
        "[safety]\ncycle_age_s = 0.15\n[nav]\nperiod_s = 0.15\n",
        "4: nav.period_s: 0.15 must be below safety.cycle_age_s (0.15)",
    ),
    "an empty battery that is not low": (
        "[devices.kobuki.battery]\nlow_v = 13.0\n",
        "2: devices.kobuki.battery.low_v: critical_v = 13.2 must be below low_v = 13",
    ),
    "a view the wrong way round": (
        "[devices.hokuyo.view]\nangle_min_rad = 1\nangle_max_rad = -1.0",
        "1: devices.hokuyo.view: angle_min 1.0 rad must lie below angle_max -1.0 rad",
    ),
    "a fact of the device": (
        "[devices.kobuki.clock]\nbits = 12\n",
        "2: devices.kobuki.clock.bits: unknown key",
    ),
    "parts outside the body": (
        "[safety]\nown_parts_m = 0.17\n[body]\nradius_m = 0.178\n[laser]\nx_m = 0.2\n",
        "6: laser.x_m: 0.2 m from the middle is outside the body (radius 0.178 m)",
    ),
    "scans left out": (
        "[devices.hokuyo.view]\nskip = 10\n",
        "2: devices.hokuyo.view.skip: 10 must lie between 0 and 9",
    ),
    "twice": ("[slam]\nparticles = 5\nparticles = 6\n", "3: not TOML: "),
    "no value": ("[laser]\nx_m =\n", "2: not TOML: "),
    "not closed": ("[laser\n", "1: not TOML: "),
    "no port": (
        "[ports]\nkobuki = '/dev/x'\nhokuyo = '/dev/x'\n",
        "3: ports.hokuyo: /dev/x is given for both",
    ),
    "a stranger": ("\nwhatsoever = 1\n", "2: whatsoever: unknown key"),
    "a key misspelt": (
        "[nav.body]\nvmax_mps = 1\n",
        "2: nav.body.vmax_mps: unknown key; is nav.body.v_max_mps",
    ),
    "a table misspelt": ("[nav.bdy]\nx = 1\n", "1: nav.bdy: unknown key; is nav.body meant?"),
    "in another table": (
        "[nav]\nv_max_mps = 1\n",
        "2: nav.v_max_mps: unknown key; is nav.body.v_max_mps meant",
    ),
    "said elsewhere": (
        "[topo]\nrobot_radius_m = 1\n",
        "2: topo.robot_radius_m: unknown key; it is said once, by b",
    ),
}


@pytest.mark.parametrize("kind", BAD)
def test_a_bad_file_is_one_line_with_file_line_key_value_and_rule(tmp_path, kind):
    text, said = BAD[kind]
    path = tmp_path / "robot.toml"
    path.write_text(text)
    with pytest.raises(BadSetting) as refused:
        read_settings(path)
    message = str(refused.value)
    assert "\n" not in message
    if said[0].isdigit():
        assert message.startswith(f"{path}:{said}")
    assert said in message


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"[laser]\n# \xff\n", "not UTF-8 text (byte 11)"),
        (b"\x89PNG\r\n", "not UTF-8 text (byte 1)"),
        (b"#" * ((1 << 20) + 1), "larger than 1 MB, no file of settings"),
        (b"x = " + b"[" * 5000, "nested too deep"),
        (b"x = 1\n\ny = '''", ":3: not TOML: "),
    ],
    ids=["latin", "picture", "large", "deep", "cut"],
)
def test_a_file_that_is_no_toml_text_is_told(tmp_path, content, said):
    path = tmp_path / "robot.toml"
    path.write_bytes(content)
    with pytest.raises(BadSetting) as refused:
        read_settings(path)
    assert str(refused.value).startswith(f"{path}:")
    assert said in str(refused.value)


def test_a_file_of_a_megabyte_and_one_with_a_mark_in_front_are_read(tmp_path):
    path = tmp_path / "robot.toml"
    path.write_bytes(b"\xef\xbb\xbf[laser]\r\nx_m = 0.01\r\n")
    assert read_settings(path).config.laser.x_m == 0.01
    path.write_bytes(b"#" * (1 << 20))
    assert read_settings(path).config == RobotConfig()


def test_a_folder_and_a_file_that_is_not_there_are_told(tmp_path):
    with pytest.raises(BadSetting, match=r"cannot be read \(Is a directory\)"):
        read_settings(tmp_path)
    with pytest.raises(BadSetting, match=r"none\.toml: no such file"):
        read_settings(tmp_path / "none.toml")


@pytest.mark.parametrize(
    ("order", "said"),
    [
        ("laser.x_m", "--set laser.x_m: must be KEY=VALUE"),
        ("=3", "--set =3: must be KEY=VALUE"),
        ("laser.x_m=left", "--set laser.x_m=left: laser.x_m: 'left' must be a number"),
        ("laser.x_m=", "laser.x_m: '' must be a number"),
        ("laser=3", "--set laser=3: laser: 3 must be a table"),
        ("laser.x_m=0.3", "--set laser.x_m=0.3: laser.x_m: 0.3 m from the middle is outside"),
        ("laser.z_m=0.3", "--set laser.z_m=0.3: laser.z_m: unknown key"),
        ("lser.x_m=0.3", "--set lser.x_m=0.3: lser: unknown key; is laser meant?"),
        ("slam.window_m=1e999", "slam.window_m: inf must be a finite number"),
    ],
)
def test_a_bad_order_is_told_as_it_was_typed(order, said):
    with pytest.raises(BadSetting) as refused:
        read_settings(orders=["body.radius_m=0.2", order])
    assert said in str(refused.value)


def test_an_order_into_what_a_file_holds_as_a_value_is_told(tmp_path):
    path = tmp_path / "robot.toml"
    path.write_text("laser = 3\n")
    with pytest.raises(BadSetting, match=r"--set laser\.x_m=0: laser is no table"):
        read_settings(path, ["laser.x_m=0"])


def test_an_order_is_over_the_file_and_the_last_of_two_counts(tmp_path):
    path = tmp_path / "robot.toml"
    path.write_text("[laser]\nx_m = 0.05\ny_m = 0.01\n")
    read = read_settings(path, ["laser.x_m=0.06", "laser.x_m = 0.07", "ports.kobuki='/dev/a b'"])
    assert (read.config.laser.x_m, read.config.laser.y_m) == (0.07, 0.01)
    assert read.config.ports.kobuki == "/dev/a b"
    assert read.sources == {
        ("laser", "x_m"): "command line",
        ("laser", "y_m"): f"{path}:3",
        ("ports", "kobuki"): "command line",
    }


def test_an_option_that_was_not_given_says_nothing():
    read = read_settings(
        options={"--window": ("slam.window_m", None), "--max-range": ("slam.max_range_m", 5.6)}
    )
    assert read.config.slam.window_m == 20.0
    assert read.sources == {("slam", "max_range_m"): "command line"}
    with pytest.raises(BadSetting, match=r"^--window: slam\.window_m: 3\.0 must lie between 4 and 60"):
        read_settings(options={"--window": ("slam.window_m", 3.0)})


def test_a_broken_relation_is_told_where_the_setting_that_was_chosen_stands(tmp_path):
    path = tmp_path / "robot.toml"
    path.write_text("[slam]\nwindow_m = 10\n")
    with pytest.raises(BadSetting, match=r"^--set slam\.max_range_m=6: slam\.max_range_m: .*twice"):
        read_settings(path, ["slam.max_range_m=6"])
    base = read_settings(orders=["slam.max_range_m=6"]).config
    with pytest.raises(BadSetting, match=r"^--set slam\.window_m=10: slam\.window_m: .*twice"):
        read_settings(orders=["slam.window_m=10"], base=base)


def test_a_base_is_changed_by_orders_and_replaced_by_a_file(tmp_path):
    base = read_settings(orders=["laser.x_m=0.05", "laser.y_m=0.01"]).config
    assert read_settings(orders=["laser.x_m=0.06"], base=base).config.laser.y_m == 0.01
    path = tmp_path / "robot.toml"
    path.write_text("[laser]\nx_m = 0.02\n")
    assert read_settings(path, base=base).config.laser.y_m == 0.0


def test_a_table_within_keeps_the_defaults_that_its_stage_gave_it():
    """The locator's own search asks for more than the loop closer's."""
    found = from_mapping({"loops": {"locator": {"match": {"rounds": 5}}}}).loops
    assert found.locator.match.least_score == RobotConfig().loops.locator.match.least_score
    assert found.locator.match.least_score != found.match.least_score
    setting = all_settings()["loops", "locator", "match", "least_score"]
    assert setting.default == found.locator.match.least_score


def test_an_integer_is_taken_where_a_number_belongs_and_becomes_one():
    taken = from_mapping({"slam": {"window_m": 12}}).slam.window_m
    assert (taken, type(taken)) == (12.0, float)


def test_a_value_that_the_program_finds_itself_may_be_left_to_it():
    assert from_mapping({"slam": {"max_range_m": None}}).slam.max_range_m is None
    with pytest.raises(BadSetting, match="must be a number"):
        from_mapping({"slam": {"window_m": None}})


def test_what_is_written_down_of_a_run_says_each_setting_once():
    data = to_mapping(RobotConfig())
    assert "radius_m" not in data["nav"]["body"]
    assert "explore" not in data["nav"]
    assert data["loops"]["locator"]["match"]["least_score"] == 0.6


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("v_max_mps", "m/s"),
        ("window_m", "m"),
        ("particles", ""),
        ("evidence_hit", ""),
        ("odometry_rad_per_m", "rad/m"),
        ("along_m_per_sqrt_m", "m/√m"),
        ("metres_per_tick", "m/tick"),
        ("shift_var_m2_per_m", "m²/m"),
        ("points_per_look", ""),
        ("occupied_percent", "%"),
    ],
)
def test_the_unit_is_read_off_the_end_of_the_name(name, unit):
    assert unit_of(name) == unit


def test_a_bad_file_is_refused_by_every_command_that_takes_one_and_nothing_is_left(tmp_path, capsys):
    path, out = tmp_path / "robot.toml", tmp_path / "out"
    path.write_text("[body]\nradius_m = 0.45\n")
    log = tmp_path / "short.clf"
    log.write_text("FLASER 180 " + "2.5 " * 180 + "0 0 0 0 0 0 1.0 host 1.0\n")
    for command in (
        ["map", str(log), "--out", str(out)],
        ["sim", "--fast", "--out", str(out)],
        ["sim", "--serve"],
        ["sim", "--fast", "--nav", "metric", "--mission", "goto:1:1", "--out", str(out)],
        ["run", "--out", str(out)],
        ["record", "--out", str(out)],
        ["teleop", "--out", str(out)],
    ):
        assert main([*command, "--config", str(path)]) == 2, command
        said = capsys.readouterr()
        assert said.out == ""
        assert said.err.startswith(f"lemtomap: {path}:2: body.radius_m: 0.45 must lie between"), said.err
        assert said.err.count("\n") == 1
    assert sorted(tmp_path.iterdir()) == sorted([path, log])
