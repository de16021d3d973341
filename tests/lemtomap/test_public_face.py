"""What a program that uses the library meets first."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import lemtomap
from tests.lemtomap.grid.rooms import box, scan_at

README = Path(__file__).resolve().parents[2] / "README.md"


def test_the_names_of_the_public_face_are_pinned():
    assert set(lemtomap.__all__) == {
        "BadInput",
        "BadLog",
        "BadMap",
        "BadSample",
        "BadSetting",
        "Goal",
        "LemtomapError",
        "MapView",
        "Mapper",
        "Navigator",
        "NoRoute",
        "NotStarted",
        "Odometry",
        "Scan",
        "Twist",
        "__version__",
    }
    assert all(getattr(lemtomap, name) is not None for name in lemtomap.__all__)


def test_type_checkers_are_told_the_same_names():
    stub = Path(lemtomap.__file__).with_name("__init__.pyi").read_text()
    told = set(re.findall(r"import \w+ as (\w+)", stub)) | set(re.findall(r"^(\w+):", stub, re.MULTILINE))
    assert told == set(lemtomap.__all__)
    assert Path(lemtomap.__file__).with_name("py.typed").exists()


def test_importing_the_library_loads_nothing_heavy():
    ask = "import sys, lemtomap; print(sorted({'numpy', 'numba', 'scipy', 'sqlite3'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", ask], check=True, capture_output=True, text=True)  # noqa: S603 - our own text
    assert done.stdout.strip() == "[]"


def test_a_name_that_is_not_there_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'Robot'"):
        _ = lemtomap.Robot


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda: lemtomap.Scan(0.0, [[1.0, 2.0]], 0.0, 0.1), r"Scan.ranges_m: .* shape \(1, 2\)"),
        (lambda: lemtomap.Scan(0.0, "far", 0.0, 0.1), "Scan.ranges_m: must be numbers, is 'far'"),
        (lambda: lemtomap.Scan(0.0, [1.0], 0.0, 0.1, T_base_laser=(0.1, 0.0)), r"Scan.T_base_laser .*\(2,\)"),
        (lambda: lemtomap.Odometry(0.0, (1.0, 2.0)), r"T_odom_base \(x m, y m, yaw rad\): must be 3 numbers"),
        (lambda: lemtomap.Odometry(0.0, None), "T_odom_base .* must be numbers, is None"),
        (lambda: lemtomap.Odometry(0.0, [1.0, [2.0], 3.0]), "must be numbers"),
    ],
)
def test_a_wrong_argument_is_told_in_the_callers_words_with_its_shape(make, told):
    with pytest.raises(lemtomap.BadSample, match=told):
        make()


def test_arrays_that_fit_are_taken_as_they_are():
    ranges, pose = np.ones(5, np.float32), np.zeros(3)
    assert lemtomap.Scan(0.0, ranges, 0.0, 0.1).ranges_m is ranges
    assert lemtomap.Odometry(0.0, pose).T_odom_base is pose


def test_a_pose_that_is_no_number_is_refused_before_it_is_mapped(tmp_path):
    with lemtomap.Mapper.open(tmp_path / "my.lemto") as mapper:
        scan = lemtomap.Scan(0.0, [1.0] * 90, -1.0, 0.02)
        with pytest.raises(lemtomap.BadSample, match="must be finite"):
            mapper.update(scan, lemtomap.Odometry(0.0, (np.nan, 0.0, 0.0)))


def test_the_ten_lines_of_the_readme_map_a_drive_and_go_on_with_the_map(tmp_path, monkeypatch, capsys):
    (text,) = re.findall(r"## From a program\n\n```python\n(.*?)```", README.read_text(), re.DOTALL)
    walls = box(-4.0, -2.0, 4.0, 3.0)

    def my_robot():
        for step in range(40):
            pose = (0.1 * step - 2.0, 0.0, 0.0)
            yield 0.1 * step, pose, scan_at(pose, walls, beams=686).ranges_m.tolist()

    monkeypatch.chdir(tmp_path)
    for parts in (1, 2):
        exec(compile(text, "README.md", "exec"), {"my_robot": my_robot})  # noqa: S102 - our own README
        said = capsys.readouterr().out
        assert re.search(r"at node \d+ of \d+ in sight, quality", said)
        store = lemtomap.Mapper.open("my.lemto")
        nodes = sum(1 for _ in store.topo.store.nodes())
        store.close()
        assert nodes >= 3 * parts - 1
