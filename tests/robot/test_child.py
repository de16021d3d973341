"""What lies in the working directory is data: no process of ours runs it."""

import ast
import subprocess
from pathlib import Path

import pytest

from lemtomap.robot.child import python
from lemtomap.robot.cli.bench import run_bench
from lemtomap.robot.runs.sim_server import FakeHardware

ROOT = Path(__file__).resolve().parents[2]
MODULES = [
    path for part in ("drivers", "lemtomap", "robot", "sim", "tools") for path in (ROOT / part).rglob("*.py")
]
TRAP = "import pathlib\npathlib.Path({caught!r}).write_text(__name__)\n"


@pytest.fixture
def trap(tmp_path, monkeypatch):
    """Stand in a folder whose modules bear the names of ours and of the standard library's."""
    folder, caught = tmp_path / "maps", tmp_path / "caught"
    for name in (
        "json.py",
        "numpy.py",
        "runpy.py",
        "sim/__init__.py",
        "tools/__init__.py",
        "rerun/__init__.py",
    ):
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(TRAP.format(caught=str(caught)))
    monkeypatch.chdir(folder)
    return caught


def test_a_module_in_the_working_directory_is_not_imported(trap):
    subprocess.run(python("-c", "import json, numpy"), check=True)  # noqa: S603 - our own text
    assert not trap.exists()


def test_a_bare_checkout_finds_its_own_modules(tmp_path):
    command = python("-m", "lemtomap.robot.child")
    command.insert(1, "-S")  # as if nothing were installed
    subprocess.run(command, check=True, cwd=tmp_path, env={})  # noqa: S603 - our own module


def test_a_bench_is_not_taken_from_the_working_directory(trap, capfd):
    assert run_bench("logs", ["--help"]) == 0
    assert "lemtomap bench logs" in capfd.readouterr().out
    assert not trap.exists()


@pytest.mark.realtime
def test_the_simulator_is_not_taken_from_the_working_directory(trap):
    pytest.importorskip("pybullet")
    with FakeHardware("office") as hardware:
        assert hardware.kobuki
    assert not trap.exists()


def test_every_process_of_ours_is_started_by_the_one_command_that_looks_nowhere_else():
    """`sys.executable` as a program stands in robot/child.py alone; elsewhere only its path is asked for."""
    starts = [
        f"{path.relative_to(ROOT)}:{node.lineno}"
        for path in MODULES
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.List | ast.Tuple)
        and any(ast.unparse(item) == "sys.executable" for item in node.elts)
    ]
    assert {start.partition(":")[0] for start in starts} == {"robot/child.py"}
