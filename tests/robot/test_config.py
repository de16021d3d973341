"""Settings files: accepted as written or refused with line and key."""

from types import SimpleNamespace

import pytest

from lemtomap.errors import BadSetting
from robot import config


def write(tmp_path, text):
    path = tmp_path / "robot.toml"
    path.write_text(text)
    return path


def test_values_from_the_file_and_defaults_for_the_rest(tmp_path):
    path = write(tmp_path, "[ports]\nkobuki = '/dev/x'\n[safety]\nv_max_mps = 0.3\n")
    loaded = config.load(path)
    assert loaded.ports.kobuki == "/dev/x"
    assert loaded.safety.v_max_mps == 0.3
    assert loaded.safety.base_age_s == config.RobotConfig().safety.base_age_s


def test_a_laser_may_sit_behind_right_of_and_turned_against_the_middle_of_the_base(tmp_path):
    loaded = config.load(write(tmp_path, "[laser]\nx_m = -0.1\ny_m = -0.02\nyaw_rad = -3.14\n"))
    assert loaded.laser == config.LaserConfig(-0.1, -0.02, -3.14)


def test_what_a_run_used_can_be_read_back():
    used = config.RobotConfig()
    assert config.from_mapping(config.to_mapping(used)) == used


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[safety]\n\nv_max_mps = -0.1\n", ["robot.toml:3", "safety.v_max_mps", "-0.1", "greater"]),
        ("[safety]\nv_max = 1\n", ["robot.toml:2", "safety.v_max", "unknown key"]),
        ("[saftey]\nv_max_mps = 1\n", ["robot.toml:1", "saftey", "unknown key"]),
        ("# hello\nsafety.v_max_mps = 'fast'\n", ["robot.toml:2", "safety.v_max_mps", "'fast'", "number"]),
        ("[safety]\nbase_age_s = nan\n", ["robot.toml:2", "safety.base_age_s", "finite"]),
        ("[safety]\nscan_valid_beams = 1.5\n", ["robot.toml:2", "safety.scan_valid_beams", "integer"]),
        ("[safety\n", ["robot.toml", "line 1"]),
        (f"[safety]\nx = {'[' * 5000}", ["robot.toml", "nested too deep"]),
        (f"[safety]\nv_max_mps = {'9' * 5000}", ["robot.toml", "digits"]),
        ("[ports]\nkobuki='/dev/a'\nhokuyo='/dev/a'\n", ["robot.toml:3", "ports.hokuyo", "both"]),
    ],
    ids=lambda value: str(value)[:40],
)
def test_a_bad_file_is_refused_with_line_key_and_reason(tmp_path, text, words):
    with pytest.raises(BadSetting) as error:
        config.load(write(tmp_path, text))
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
        config.load(path, lambda: [laser])


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(BadSetting, match=r"nothing\.toml: no such file"):
        config.load(tmp_path / "nothing.toml")
