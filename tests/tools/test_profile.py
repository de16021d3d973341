"""The profile of a drive: its parts add up, and kernels are told from Python."""

import pytest

from lemtomap.robot.child import ROOT
from tools.bench.profile import Called, Profile, Spent, is_kernel, part_of, shared_out, told

GRID = f"{ROOT}/lemtomap/grid/mapper.py"
KERNEL = f"{ROOT}/lemtomap/grid/kernels/matching.py"
CLOSING = f"{ROOT}/lemtomap/topo/loops/matcher.py"


def test_a_file_belongs_to_the_nearest_part():
    assert part_of(CLOSING) == "closing"
    assert part_of(f"{ROOT}/lemtomap/topo/kernels/search.py") == "closing"
    assert part_of(f"{ROOT}/lemtomap/topo/mapper.py") == "topology"
    assert part_of("/usr/lib/python3/json/encoder.py") == "libraries and the rest"


def test_only_our_own_compiled_files_are_kernels():
    assert is_kernel(KERNEL)
    assert not is_kernel(GRID)
    assert not is_kernel("/opt/numba/kernels/x.py")


def test_the_parts_add_up_to_the_run_and_the_profiler_slows_python_alone():
    parts = shared_out(10.0, [(GRID, 6.0), (KERNEL, 4.0), (CLOSING, 18.0)])
    assert parts["grid"] == Spent(kernel_s=4.0, python_s=pytest.approx(1.5))
    assert sum(spent.kernel_s + spent.python_s for spent in parts.values()) == pytest.approx(10.0)


def test_the_table_tells_every_part_and_what_a_scan_costs():
    found = Profile("a.clf", scans=1000, cpu_s=2.0, parts={"grid": Spent(0.5, 1.5)})
    found.functions = [Called("matching.match", kernel=True, calls=1234, own_s=0.5)]
    assert "| grid | 0.50 | 1.50 | 2000 |" in told(found)
    assert "| matching.match | kernel | 1,234 | 0.50 |" in told(found)
