"""A command imports what it needs and no more: neither memory nor time goes into what is not used."""

import json
import subprocess
import sys

import numpy as np
import pytest

from lemtomap.robot.child import ROOT

HEAVY = {"numba", "matplotlib", "networkx", "pybullet", "rerun", "pyarrow", "PIL", "mcap"}
TOLD = "import json, sys; print(json.dumps(sorted(sys.modules)))"


def modules_after(code, *arguments):
    told = subprocess.run(  # noqa: S603
        [sys.executable, "-c", f"import sys; sys.path.append({str(ROOT)!r})\n{code}\n{TOLD}", *arguments],
        check=True,
        capture_output=True,
        text=True,
    )
    return set(json.loads(told.stdout.splitlines()[-1]))


def heavy(modules):
    return {name for name in modules if name in HEAVY or name in {"scipy.stats", "scipy.sparse"}}


def command(*arguments):
    return f"from lemtomap.robot.cli.main import main; main({list(arguments)!r})"


@pytest.mark.parametrize("arguments", [("--help",), ("map", "--help"), ("run", "--help"), ("sim", "--help")])
def test_help_imports_nothing_heavy(arguments):
    assert not heavy(modules_after(command(*arguments)))


def test_mapping_a_log_imports_no_viewer_no_plotter_and_no_simulator(tmp_path):
    readings = " ".join(f"{r:.2f}" for r in 3.0 + np.sin(np.arange(180) / 9.0))
    way_m = np.arange(0.0, 3.0, 0.1)
    lines = [f"FLASER 180 {readings} {x:.2f} 0 0 {x:.2f} 0 0 {x:.2f} host {x:.2f}" for x in way_m]
    (tmp_path / "a.clf").write_text("\n".join(lines) + "\n")
    modules = modules_after(command("map", str(tmp_path / "a.clf"), "--out", str(tmp_path / "out")))
    assert (tmp_path / "out" / "overview.png").read_bytes().startswith(b"\x89PNG")
    assert heavy(modules) == {"numba", "scipy.sparse"}  # kernels, and the one solve of the whole map


def test_the_robot_imports_no_plotter_no_simulator_and_no_solver_before_it_drives():
    modules = modules_after("import lemtomap.robot.runs.real")
    assert heavy(modules) == {"numba", "rerun", "pyarrow", "PIL", "mcap"}  # viewer, recorder, preview
    assert not {name for name in modules if name.startswith(("scipy.ndimage", "scipy.spatial"))}
