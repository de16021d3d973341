"""Settings files: accepted as written or refused with line and key."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lemtomap.errors import BadSetting
from lemtomap.robot import config
from lemtomap.robot.devices import bridge
from lemtomap.robot.settings.check import from_mapping
from lemtomap.robot.settings.read import load
from lemtomap.robot.settings.tree import all_settings, to_mapping


def write(tmp_path, text):
    path = tmp_path / "robot.toml"
    path.write_text(text)
    return path


def test_values_from_the_file_and_defaults_for_the_rest(tmp_path):
    path = write(tmp_path, "[ports]\nkobuki = '/dev/x'\n[safety]\nv_max_mps = 0.3\n")
    loaded = load(path)
    assert loaded.ports.kobuki == "/dev/x"
    assert loaded.safety.v_max_mps == 0.3
    assert loaded.safety.base_age_s == config.RobotConfig().safety.base_age_s


def test_a_laser_may_sit_behind_right_of_and_turned_against_the_middle_of_the_base(tmp_path):
    loaded = load(write(tmp_path, "[laser]\nx_m = -0.1\ny_m = -0.02\nyaw_rad = -3.14\n"))
    assert loaded.laser == config.LaserConfig(-0.1, -0.02, -3.14)


def test_what_a_run_used_can_be_read_back():
    used = config.RobotConfig()
    assert from_mapping(to_mapping(used)) == used


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "[safety]\n\nv_max_mps = -0.1\n",
            ["robot.toml:3", "safety.v_max_mps", "-0.1 must lie between 0.05 and 0.65"],
        ),
        ("[safety]\nv_max = 1\n", ["robot.toml:2", "safety.v_max", "unknown key"]),
        ("[saftey]\nv_max_mps = 1\n", ["robot.toml:1", "saftey", "unknown key"]),
        ("# hello\nsafety.v_max_mps = 'fast'\n", ["robot.toml:2", "safety.v_max_mps", "'fast'", "number"]),
        ("[safety]\nbase_age_s = nan\n", ["robot.toml:2", "safety.base_age_s", "finite"]),
        ("[safety]\nscan_valid_beams = 1.5\n", ["robot.toml:2", "safety.scan_valid_beams", "integer"]),
        (
            "[safety]\nown_parts_m = 10\n",
            ["robot.toml:2", "safety.own_parts_m: 10 must lie between 0 and 0.17", "outside the body"],
        ),
        (
            "[safety]\nbrake_mps2 = 0\n",
            ["robot.toml:2", "safety.brake_mps2: 0 must lie between 0.1 and 1.2"],
        ),
        ("[safety]\nv_max_mps = true\n", ["robot.toml:2", "safety.v_max_mps", "true", "number"]),
        ("[slam]\nparticles = true\n", ["robot.toml:2", "slam.particles", "true", "integer"]),
        ("[slam]\nmax_range_m = inf\n", ["robot.toml:2", "slam.max_range_m", "finite"]),
        (
            "[nav.body]\nv_max_mps = 1e12\n",
            ["robot.toml:2", "nav.body.v_max_mps", "1000000000000.0", "between 0.05 and 0.7"],
        ),
        ("[safety\n", ["robot.toml:1", "not TOML"]),
        (f"[safety]\nx = {'[' * 5000}", ["robot.toml", "nested too deep"]),
        (f"[safety]\nv_max_mps = {'9' * 5000}", ["robot.toml", "digits"]),
        ("[ports]\nkobuki='/dev/a'\nhokuyo='/dev/a'\n", ["robot.toml:3", "ports.hokuyo", "both"]),
    ],
    ids=lambda value: str(value)[:40],
)
def test_a_bad_file_is_refused_with_line_key_and_reason(tmp_path, text, words):
    with pytest.raises(BadSetting) as error:
        load(write(tmp_path, text))
    message = str(error.value)
    assert "\n" not in message
    for word in words:
        assert word in message


def test_a_swapped_pair_of_ports_is_noticed_by_usb_identity(tmp_path):
    laser = SimpleNamespace(
        device="/dev/ttyACM0",
        vid=0x15D1,
        pid=0,
        manufacturer="Hokuyo Automatic Co, Ltd.",
        product="URG-Series USB Driver",
        serial_number=None,
    )
    path = write(tmp_path, "[ports]\nkobuki = '/dev/ttyACM0'\nhokuyo = '/dev/ttyUSB0'\n")
    with pytest.raises(BadSetting, match=r"robot.toml:2: ports.kobuki: .*Hokuyo laser.*swapped"):
        load(path, lambda: [laser])


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(BadSetting, match=r"nothing\.toml: no such file"):
        load(tmp_path / "nothing.toml")


NUMBERS = {key: each for key, each in all_settings().items() if each.kind in {int, float}}


def setting(key, value):
    """Return the settings with one key set."""
    data = {key[-1]: value}
    for table in reversed(key[:-1]):
        data = {table: data}
    return from_mapping(data)


def refusal(key, value):
    """Return why a value is refused, empty when it is not."""
    try:
        setting(key, value)
    except BadSetting as error:
        return str(error)
    return ""


def test_every_number_has_a_range_and_its_default_lies_within():
    assert len(NUMBERS) > 200
    for number in NUMBERS.values():
        assert number.allowed is not None, number.name
        assert number.default is None or number.default in number.allowed, number.name


@pytest.mark.parametrize("value", [1e12, -1e12, float("nan"), float("inf"), True, "1"], ids=str)
def test_no_number_takes_nonsense(value):
    assert [key for key in NUMBERS if not refusal(key, value)] == []


@given(st.data())
def test_a_number_is_refused_outside_its_range_with_key_value_and_rule_and_not_for_it_within(data):
    key = data.draw(st.sampled_from(sorted(NUMBERS)))
    allowed = NUMBERS[key].allowed
    if NUMBERS[key].kind is int:
        value = data.draw(
            st.integers(-(10**13), 10**13) | st.integers(int(allowed.low) - 1, int(allowed.high) + 1)
        )
    else:
        value = data.draw(
            st.floats(allow_nan=False, allow_infinity=False)
            | st.floats(allowed.low, allowed.high)
            | st.sampled_from([0.0, allowed.low, allowed.high])
        )
    rule = f"{'.'.join(key)}: {value!r} must lie {allowed}"
    assert (refusal(key, value) == rule) is (value not in allowed)


def test_zero_is_taken_only_where_nothing_depends_on_it():
    """A list to think about before it grows: none of these divides, none of them disarms anything."""
    zeros = {number.name for number in NUMBERS.values() if 0 in number.allowed}
    assert {name for name in zeros if name.startswith(("safety", "smoother"))} == {"safety.own_parts_m"}
    assert len(zeros) < 60
    assert [name for name in zeros if refusal(tuple(name.split(".")), 0)] == []


def test_the_body_is_said_once_and_reaches_every_stage(tmp_path):
    loaded = load(write(tmp_path, "[body]\nradius_m = 0.3\n"))
    assert loaded.nav.body.radius_m == loaded.topo.robot_radius_m == loaded.safety.body_radius_m == 0.3
    assert loaded.viewer.body_m == 0.3


def test_exploration_is_set_in_its_own_table(tmp_path):
    loaded = load(write(tmp_path, "[explore]\nattempts = 5\n[loops.locator]\nchecks = 4\n"))
    assert loaded.nav.explore.attempts == 5
    assert loaded.loops.locator.checks == 4


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[nav.body]\nradius_m = 0.3\n", "nav.body.radius_m: unknown key; it is said once, by body.radius_m"),
        ("[body]\nradius_m = 0.45\n", "half a door"),
        ("[laser]\nx_m = 0.15\ny_m = 0.15\n", "laser.x_m: 0.212132 m from the middle is outside the body"),
        ("[laser]\nroll_deg = 90\n", "roll_deg = 90: must be 0 or 180"),
        (
            "[safety]\nside_margin_m = 0.02\n",
            "safety.side_margin_m: 0.02 must be below nav.collision.skin_m",
        ),
        ("[safety]\nv_max = 1\n", "is safety.v_max_mps meant?"),
        ("[saftey]\nv_max_mps = 1\n", "is safety meant?"),
    ],
)
def test_settings_that_do_not_go_together_are_told_with_key_value_and_rule(tmp_path, text, words):
    with pytest.raises(BadSetting) as caught:
        load(write(tmp_path, text))
    assert words in str(caught.value)
    assert "robot.toml:" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_laser_upside_down_sees_the_same_room():
    seen = SimpleNamespace(
        stamp_s=0.0,
        ranges_m=np.array([1.0, 2.0, 3.0], np.float32),
        angle_min_rad=-0.5,
        angle_step_rad=0.4,
        time_step_s=0.0,
        range_min_m=0.02,
        range_max_m=5.6,
    )
    upright = bridge.scan_of(seen, np.zeros(3))
    hanging = bridge.scan_of(seen, np.zeros(3), upside_down=True)
    angles = upright.angle_min_rad + upright.angle_step_rad * np.arange(3)
    assert np.allclose(hanging.angle_min_rad + hanging.angle_step_rad * np.arange(3), -angles)


def test_a_laser_at_either_half_turn_hangs_upside_down():
    assert [config.LaserConfig(roll_deg=roll).is_upside_down for roll in (0.0, 180.0, -180.0)] == [
        False,
        True,
        True,
    ]
