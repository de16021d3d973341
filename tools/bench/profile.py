"""Where `lemtomap map` spends its CPU: kernels and Python apart, by part; calls and allocations of a scan.

    lemtomap bench profile intel.clf.xz [--slam rolling] [--out runs/profile]

The log is mapped three times: once for its CPU time, once under Python's profiler, which counts calls and
times the kernels (compiled code runs as fast under it), and in part with every allocation traced. What is
Python's is the first time less that of the kernels, shared out as the profiler saw it. Leaves profile.md,
profile.json (two of them: `lemtomap bench compare OLD NEW`) and profile.png.
"""

import argparse
import cProfile
import json
import pstats
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from lemtomap.errors import LemtomapError
from lemtomap.grid import SLAMS
from lemtomap.pipeline import Mapper
from lemtomap.robot.build_map import build_slam, build_topo
from lemtomap.robot.child import ROOT
from lemtomap.robot.output.progress import progress_bar
from lemtomap.robot.runs.map_log import MapLogOptions, chosen, map_log
from lemtomap.topo.file.store import TopoStore
from tools.bench.parts.mapping_runs import table

TRACED_SCANS = 3000
SHOWN = 20
PARTS = {  # what a module's path begins with: the part it belongs to; the first that fits
    "lemtomap/robot/logs": "reading",
    "robot/logs": "reading",
    "lemtomap/grid": "grid",
    "lemtomap/areas": "doors and areas",
    "lemtomap/topo/loops": "closing",
    "lemtomap/topo/kernels/search": "closing",
    "lemtomap/topo/whole": "whole map",
    "lemtomap/topo/solve/whole": "whole map",
    "lemtomap/topo": "topology",
    "lemtomap/displacement": "displacement",
    "robot/output": "pictures and files",
}
OTHER = "libraries and the rest"
KERNEL, PYTHON = "#c0392b", "#2a6f97"


@dataclass(slots=True)
class Spent:
    """CPU of one part, seconds."""

    kernel_s: float = 0.0
    python_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Called:
    """One function."""

    name: str
    kernel: bool
    calls: int
    own_s: float


@dataclass(slots=True)
class Profile:
    """What was measured on one log."""

    log: str
    scans: int
    cpu_s: float
    parts: dict[str, Spent] = field(default_factory=dict)
    functions: list[Called] = field(default_factory=list)
    calls_per_scan: float = 0.0
    kernel_calls_per_scan: float = 0.0
    kept_blocks_per_scan: float = 0.0
    """Blocks of memory that outlive their scan."""
    transient_kb_median: float = 0.0
    """The most memory that a scan held beyond what was there before it."""
    transient_kb_p99: float = 0.0


def part_of(path: str) -> str:
    """Return the part of the program that a file belongs to."""
    inside = path.removeprefix(f"{ROOT}/")
    return next((part for begin, part in PARTS.items() if inside.startswith(begin)), OTHER)


def is_kernel(path: str) -> bool:
    """Return True if a file's functions are compiled."""
    return path.startswith(str(ROOT)) and "/kernels/" in path


def shared_out(cpu_s: float, functions: Sequence[tuple[str, float]]) -> dict[str, Spent]:
    """Return the CPU time of a run by part, from (file, own time under the profiler) of each function.

    Holds: the parts add up to cpu_s, unless the kernels alone took longer.
    """
    parts: dict[str, Spent] = {}
    for path, own_s in functions:
        spent = parts.setdefault(part_of(path), Spent())
        if is_kernel(path):
            spent.kernel_s += own_s
        else:
            spent.python_s += own_s
    slowed_s = sum(spent.python_s for spent in parts.values())
    share = max(0.0, cpu_s - sum(spent.kernel_s for spent in parts.values())) / max(slowed_s, 1e-9)
    for spent in parts.values():
        spent.python_s *= share
    return parts


def profiled(options: MapLogOptions) -> Profile:
    """Map the log and measure. Raises BadLog, BadSetting."""
    _, scans = _mapped(options)  # loads the kernels
    cpu_s, _ = _mapped(options)
    profiler = cProfile.Profile(time.process_time)
    with progress_bar("under the profiler") as bar:
        profiler.runcall(map_log, options, bar)
    stats: Mapping[tuple[str, int, str], tuple[int, int, float, float, Any]] = pstats.Stats(profiler).stats  # type: ignore[attr-defined]
    found = Profile(options.log.name, scans, cpu_s)
    found.parts = shared_out(cpu_s, [(path, told[2]) for (path, _, _), told in stats.items()])
    called = [
        Called(f"{Path(path).stem}.{name}", is_kernel(path), told[1], told[2])
        for (path, _, name), told in stats.items()
    ]
    found.functions = sorted(called, key=lambda each: -each.own_s)
    found.calls_per_scan = sum(each.calls for each in called) / scans
    found.kernel_calls_per_scan = sum(each.calls for each in called if each.kernel) / scans
    _trace(options, found)
    return found


def _mapped(options: MapLogOptions) -> tuple[float, int]:
    """Map the log; return the CPU time it took, and the number of scans."""
    with progress_bar(f"mapping {options.log.name}") as bar:
        begun_s = time.process_time()
        map_log(options, bar)
        cpu_s = time.process_time() - begun_s
    return cpu_s, int(json.loads((options.out / "summary.json").read_text())["scans"])


def _trace(options: MapLogOptions, found: Profile) -> None:
    """Measure what the first scans allocate."""
    log, kb = options.open_log(), []
    with tempfile.TemporaryDirectory() as folder:
        store = TopoStore.create(Path(folder) / "map.lemto", durable=False)
        topo = build_topo(options.slam, options.config, store)
        mapper = Mapper(lambda: build_slam(options.slam, options.config, 0), topo, watched=False)
        scans = islice(log, TRACED_SCANS)
        for odometry, scan in islice(scans, TRACED_SCANS // 10):
            mapper.update(scan, odometry)
        before = sys.getallocatedblocks()
        tracemalloc.start()
        for odometry, scan in scans:
            tracemalloc.reset_peak()
            held, _ = tracemalloc.get_traced_memory()
            mapper.update(scan, odometry)
            kb.append((tracemalloc.get_traced_memory()[1] - held) / 1000)
        tracemalloc.stop()
        found.kept_blocks_per_scan = (sys.getallocatedblocks() - before) / max(len(kb), 1)
        mapper.close()
    if kb:
        found.transient_kb_median, found.transient_kb_p99 = np.percentile(kb, [50, 99]).tolist()


def told(found: Profile) -> str:
    """Return the figures as Markdown."""
    us = 1e6 / found.scans
    parts = sorted(found.parts.items(), key=lambda each: -_whole_s(each[1]))
    rows = [
        [part, f"{spent.kernel_s:.2f}", f"{spent.python_s:.2f}", f"{us * _whole_s(spent):.0f}"]
        for part, spent in parts
    ]
    whole = [sum(getattr(spent, name) for spent in found.parts.values()) for name in ("kernel_s", "python_s")]
    rows.append(["all", f"{whole[0]:.2f}", f"{whole[1]:.2f}", f"{us * sum(whole):.0f}"])
    dearest = [
        [each.name, "kernel" if each.kernel else "", f"{each.calls:,}", f"{each.own_s:.2f}"]
        for each in found.functions[:SHOWN]
    ]
    return (
        f"# {found.log}: {found.scans:,} scans, {found.cpu_s:.1f} s of CPU\n\n"
        f"{table(['part', 'kernels s', 'Python s', 'us a scan'], rows)}\n\n"
        f"A scan makes {found.calls_per_scan:.0f} calls, {found.kernel_calls_per_scan:.1f} of kernels; "
        f"it holds {found.transient_kb_median:.0f} kB while it is mapped (99 %: below "
        f"{found.transient_kb_p99:.0f} kB) and leaves {found.kept_blocks_per_scan:.1f} blocks behind.\n\n"
        f"{table(['function', '', 'calls', 'own s, profiled'], dearest)}\n"
    )


def _whole_s(spent: Spent) -> float:
    return spent.kernel_s + spent.python_s


def draw(path: Path, found: Profile) -> None:
    """Draw where the time goes: the parts, and the dearest functions."""
    figure = Figure(figsize=(13, 6), dpi=110, layout="constrained")
    left, right = figure.subplots(1, 2)
    parts = sorted(found.parts.items(), key=lambda each: _whole_s(each[1]))
    names = [name for name, _ in parts]
    kernels = np.array([spent.kernel_s for _, spent in parts])
    left.barh(names, kernels, color=KERNEL, label="kernels")
    left.barh(names, [spent.python_s for _, spent in parts], left=kernels, color=PYTHON, label="Python")
    left.set_xlabel("CPU, s")
    left.set_title(f"{found.log}: {found.cpu_s:.1f} s, {1e6 * found.cpu_s / found.scans:.0f} us a scan")
    left.legend(loc="lower right")
    dearest = found.functions[:SHOWN][::-1]
    colours = [KERNEL if each.kernel else PYTHON for each in dearest]
    right.barh(range(len(dearest)), [each.own_s for each in dearest], color=colours)
    right.set_yticks(range(len(dearest)), [f"{each.name}  {each.calls:,}x" for each in dearest], fontsize=8)
    right.set_xlabel("own time under the profiler, s")
    figure.savefig(path)


def main(arguments: Sequence[str] | None = None, say: Callable[[str], None] = print) -> int:
    """Measure one log."""
    parser = argparse.ArgumentParser(
        prog="lemtomap bench profile",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("log", type=Path)
    parser.add_argument("--slam", default="window", choices=sorted(SLAMS))
    parser.add_argument("--out", type=Path, default=Path("runs/profile"))
    args = parser.parse_args(arguments)
    try:
        config = chosen(args.slam, None, [])
        found = profiled(MapLogOptions(args.log, args.out / "map", args.slam, config))
    except LemtomapError as error:
        print(f"lemtomap bench profile: {error}", file=sys.stderr)
        return 2
    text = told(found)
    (args.out / "profile.md").write_text(text)
    shown = {**asdict(found), "functions": [asdict(each) for each in found.functions[:SHOWN]]}
    (args.out / "profile.json").write_text(json.dumps(shown, indent=2) + "\n")
    draw(args.out / "profile.png", found)
    say(f"{text}\n{args.out / 'profile.png'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
