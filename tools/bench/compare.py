"""What got better or worse: two reports, or two versions of the program measured in turns.

    lemtomap bench compare OLD.json NEW.json              reports of any bench
    lemtomap bench compare OLD.json [--pairs 7]           a report of `bench thesis`, made by an older version
    lemtomap bench compare --against REVISION LOG         any git revision, on any recorded log

The last two forms check the old version out beside this one and map the same log with both in turns (old,
new, new, old ...): what a busy machine does to one it does to the other, so the ratio of a pair is far
steadier than either time. Ratios are new over old; a change counts when its 95 % range leaves out 1.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from lemtomap.robot.child import python
from tools.bench.parts.mapping_runs import slam_cpu_s, table

NOISE = 0.05  # without repetitions, ratios this near to 1 say nothing on a shared machine
MEASURES: Mapping[str, Callable[[dict[str, Any]], float]] = {
    "CPU of the metric layer, s": lambda told: float(told["cpu_by_part_s"]["grid"]),
    "CPU of the topological layer, s": lambda told: float(told["cpu_by_part_s"]["topo"]),
    "CPU of mapping, s": slam_cpu_s,
    "peak memory, MB": lambda told: float(told["peak_rss_mb"]),
    "map on disk, kB": lambda told: float(told["map_bytes"]) / 1000.0,
}


def numbers(report: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, list[float]]]:
    """Yield every number of a report with its path; a list of numbers is one quantity, repeated."""
    for key, value in report.items():
        if isinstance(value, Mapping):
            yield from numbers(value, f"{prefix}{key} ")
        elif isinstance(value, int | float) and not isinstance(value, bool):
            yield f"{prefix}{key}", [float(value)]
        elif isinstance(value, list) and value and all(isinstance(each, int | float) for each in value):
            yield f"{prefix}{key}", [float(each) for each in value]


def ratio(old: Sequence[float], new: Sequence[float]) -> tuple[float, float, float]:
    """Return new over old and its 95 % range: paired where both have as many values, NaN range for one."""
    a, b = np.array(old), np.array(new)
    if len(a) != len(b) or len(a) < 2:
        return float(b.mean() / a.mean()), float("nan"), float("nan")
    logs = np.log(b / a)
    half = float(stats.t.ppf(0.975, len(logs) - 1) * logs.std(ddof=1) / np.sqrt(len(logs)))
    middle = float(logs.mean())
    return float(np.exp(middle)), float(np.exp(middle - half)), float(np.exp(middle + half))


def changed(old: Sequence[float], new: Sequence[float]) -> bool:
    """Return True if two values or two series differ by more than noise."""
    middle, low, high = ratio(old, new)
    return abs(middle - 1.0) > NOISE if np.isnan(low) else not low <= 1.0 <= high


def compare(old: Mapping[str, Any], new: Mapping[str, Any]) -> str:
    """Return a table of what changed between two reports."""
    before, rows = dict(numbers(old)), []
    for name, values in numbers(new):
        was = before.get(name)
        if was is None or min(was) <= 0.0 or min(values, default=0.0) <= 0.0 or not changed(was, values):
            continue
        middle, low, high = ratio(was, values)
        spread = "" if np.isnan(low) else f"{low:.2f} to {high:.2f}"
        rows.append([name, f"{np.mean(was):.4g}", f"{np.mean(values):.4g}", f"x{middle:.2f}", spread])
    return (
        table(["figure", "old", "new", "ratio", "95 % range"], rows)
        if rows
        else "nothing changed beyond noise"
    )


def compare_files(old: Path, new: Path) -> str:
    """Return what changed between two report files."""
    return compare(json.loads(old.read_text()), json.loads(new.read_text()))


def source_of(report: Path) -> tuple[str, Path]:
    """Return the version that wrote a report of `bench thesis` and the log it is to be repeated on."""
    told = json.loads(report.read_text())
    revision, log = told.get("revision"), report.parent / str(told.get("log"))
    if not revision or not log.exists():
        raise ValueError(f"{report}: names no version, or its log {log.name} is gone; give NEW.json as well")
    return revision, log


def paired(revision: str, log: Path, pairs: int, slam: str) -> str:
    """Map a log with an old revision and with this one in turns; return the table of ratios."""
    here = Path(__file__).resolve().parents[2]
    with tempfile.TemporaryDirectory() as folder:
        there = Path(folder) / "old"
        commit = _git(here, "rev-parse", "--verify", f"{revision}^{{commit}}")
        _git(here, "clone", "--quiet", "--shared", str(here), str(there))
        _git(there, "checkout", "--quiet", "--detach", commit)
        found: dict[Path, list[dict[str, Any]]] = {here: [], there: []}
        for pair in range(-1, pairs):  # the first one compiles
            for root in (there, here) if pair % 2 else (here, there):
                told = _map(root, log, Path(folder) / "out", slam)
                if pair >= 0:
                    found[root].append(told)
            print(f"pair {pair + 1} of {pairs}", file=sys.stderr, flush=True)
    rows = []
    for name, of in MEASURES.items():
        old, new = ([float(of(told)) for told in found[root]] for root in (there, here))
        middle, low, high = ratio(old, new)
        verdict = ("worse" if middle > 1.0 else "better") if changed(old, new) else "no change shown"
        row = [
            name,
            f"{np.mean(old):.4g}",
            f"{np.mean(new):.4g}",
            f"x{middle:.3f}",
            f"{low:.3f} to {high:.3f}",
        ]
        rows.append([*row, verdict])
    return table(["figure", "old", "new", "ratio", "95 % range", ""], rows)


def _map(root: Path, log: Path, out: Path, slam: str) -> dict[str, Any]:
    shutil.rmtree(out, ignore_errors=True)
    program = "lemtomap" if (root / "lemtomap" / "__main__.py").exists() else "robot"  # before it had rooms
    command = python("-m", program, "map", str(log.resolve()), "--out", str(out), "--slam", slam)
    environment = {**os.environ, "PYTHONPATH": str(root)}  # this version's own modules
    subprocess.run(command, check=True, env=environment, stdout=subprocess.DEVNULL)  # noqa: S603 - our own program
    told: dict[str, Any] = json.loads((out / "summary.json").read_text())
    return told


def _git(root: Path, *arguments: str) -> str:
    """Return what git says. Raises ValueError with its reason."""
    git = shutil.which("git") or "git"
    done = subprocess.run(  # noqa: S603 - git itself
        [git, "-C", str(root), *arguments], check=False, capture_output=True, text=True
    )
    if done.returncode:
        raise ValueError(f"git {arguments[0]} {arguments[-1]}: {done.stderr.strip().splitlines()[-1]}")
    return done.stdout.strip()


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="lemtomap bench compare",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("files", type=Path, nargs="+", metavar="FILE", help="OLD.json NEW.json, or a LOG")
    parser.add_argument("--against", metavar="REVISION", help="the old version, as git names it")
    parser.add_argument("--pairs", type=int, default=7)
    parser.add_argument("--slam", default="window")
    options: Any = parser.parse_args(arguments)
    if len(options.files) > (1 if options.against else 2):
        print(f"expected {'one LOG' if options.against else 'OLD.json NEW.json'}", file=sys.stderr)
        return 2
    missing = [path for path in options.files if not path.exists()]
    if missing:
        print(f"{missing[0]}: no such file", file=sys.stderr)
        return 2
    try:
        if len(options.files) == 1:
            revision, log = options.against, options.files[0]
            if revision is None:
                revision, log = source_of(log)
            print(paired(revision, log, options.pairs, options.slam))
        else:
            print(compare_files(*options.files))
    except ValueError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
