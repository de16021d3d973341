import pytest

from lemtomap.errors import BadSetting
from lemtomap.robot.cli.main import main
from lemtomap.robot.doctor import udev_rules


def test_the_rules_are_written_whole_for_all_to_read(tmp_path):
    target = udev_rules.install_udev(tmp_path)
    assert target == tmp_path / "60-lemtomap.rules"
    text = target.read_text()
    assert 'SYMLINK+="kobuki"' in text
    assert 'SYMLINK+="hokuyo"' in text
    assert target.stat().st_mode & 0o777 == 0o644
    assert [path.name for path in tmp_path.iterdir()] == [target.name]


def test_who_may_not_write_there_is_told_in_one_line_how(tmp_path, monkeypatch, capsys):
    def denied(*_):
        raise PermissionError

    monkeypatch.setattr(udev_rules.shutil, "copyfile", denied)
    monkeypatch.setattr(udev_rules, "FOLDER", tmp_path)
    monkeypatch.setattr(udev_rules.install_udev, "__defaults__", (tmp_path,))
    assert main(["doctor", "--install-udev"]) == 2
    said = capsys.readouterr().err
    assert "only root may write there: sudo lemtomap doctor --install-udev" in said
    assert said.count("\n") == 1


def test_a_machine_without_udev_is_told_so(tmp_path):
    with pytest.raises(BadSetting, match="no udev"):
        udev_rules.install_udev(tmp_path / "absent")
