"""Every metric layer on recorded logs: error against the official relations, CPU, memory, map size.

    lemtomap bench logs intel.clf.xz aces.clf.xz [--out runs/logs] [--seeds 3] [--compare OLD/logs.json]
    lemtomap bench logs FOLDER                       every log below it

Relations are looked for beside each log (intel.clf.xz: intel.relations). A run that is there already is not
repeated, so the bench can be stopped and taken up again. Leaves logs.md, logs.json and a picture of each
log: the tracks of all layers, and their CPU time and memory over the log. The map of each run stands in its
folder.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from lemtomap.errors import LemtomapError
from lemtomap.robot.logs import open_log
from tools.bench.compare import compare_files
from tools.bench.parts.mapping_runs import MappingRun, slam_cpu_s, table
from tools.truth.relations import read_relations, read_tum, relation_errors

LAYERS = {"rolling": 5, "gmapping": 30, "window": 1}  # particles
COLOURS = {"rolling": "#2a9d8f", "gmapping": "#c0392b", "window": "#1d5fa8"}
KINDS = (".clf", ".log", ".dat")
HEADER = ["log", "layer", "mean m", "median m", "CPU s", "peak MB", "grew MB", "map kB", "nodes", "closures"]
"""Peak: the whole process, the log in it; grew: from the first scans to the end, the drive's record in it."""


@dataclass(frozen=True, slots=True)
class LogRuns:
    """All runs of one layer on one log."""

    log: Path
    layer: str
    seeds: int
    out: Path

    def runs(self) -> list[MappingRun]:
        """Return one run for each seed."""
        stem = self.log.name.split(".")[0]
        return [
            MappingRun(
                self.log, self.layer, LAYERS[self.layer], seed, self.out / f"{stem}-{self.layer}-{seed}"
            )
            for seed in range(self.seeds)
        ]

    def figures(self) -> dict[str, Any]:
        """Run what has not been run; return the figures, the errors' worst over the seeds."""
        told = [run.summary() for run in self.runs()]
        errors = [errors_m(self.log, run.out) for run in self.runs()]
        memory = np.array([row[3] for row in told[0]["profile"]])
        return {
            "log": self.log.name,
            "layer": self.layer,
            "mean_m": max(mean for mean, _ in errors),
            "median_m": max(median for _, median in errors),
            "cpu_s": [slam_cpu_s(each) for each in told],
            "peak_mb": max(each["peak_rss_mb"] for each in told),
            "grew_mb": float(memory[-1] - memory[len(memory) // 20]),
            "map_kb": told[0]["map_bytes"] / 1000,
            "nodes": told[0]["nodes"],
            "closures": told[0]["loop_closures"],
        }


def errors_m(log: Path, out: Path) -> tuple[float, float]:
    """Return mean and median translational error, NaN where the log has no relations beside it."""
    relations = log.with_name(log.name.split(".")[0] + ".relations")
    if not relations.exists():
        return float("nan"), float("nan")
    errors, _, _ = relation_errors(read_relations(relations), *read_tum(out / "trajectory.tum"))
    lengths = np.hypot(errors[:, 0], errors[:, 1])
    return float(lengths.mean()), float(np.median(lengths))


def draw(log: Path, runs: Sequence[LogRuns], path: Path) -> None:
    """Draw the tracks of all layers, their CPU time and their memory over the log."""
    figure = Figure(figsize=(13, 4.2), dpi=100, layout="constrained")
    tracks, cpu, memory = figure.subplots(1, 3)
    for each in runs:
        run = each.runs()[0]
        told, colour = run.summary(), COLOURS[each.layer]
        _, T_map_base = read_tum(run.out / "trajectory.tum")
        tracks.plot(T_map_base[:, 0], T_map_base[:, 1], color=colour, linewidth=0.7, label=each.layer)
        rows = np.array(told["profile"])
        minutes = (
            rows[:, 0] * told.get("log_s", np.nan) / 60
        )  # a log without a clock has no time to draw over
        cpu.plot(minutes, rows[:, 1] + rows[:, 2], color=colour, label=each.layer)
        memory.plot(minutes, rows[:, 3], color=colour)
    tracks.set_aspect("equal")
    tracks.set_title(f"{log.name}: tracks, each in the frame of its first scan (m)", fontsize=9)
    cpu.set_title("CPU time of mapping (s)", fontsize=9)
    cpu.legend(fontsize=8)
    memory.set_title("resident memory, the log in it (MB)", fontsize=9)
    for axes in (cpu, memory):
        axes.set_xlabel("log (min)", fontsize=8)
        axes.set_ylim(bottom=0)
    figure.savefig(path)


def found_logs(paths: Sequence[Path]) -> list[Path]:
    """Return the logs meant by files and folders. Raises FileNotFoundError."""
    logs: list[Path] = []
    for path in paths:
        if path.is_dir():
            inside = sorted(p for p in path.rglob("*") if _plain_name(p).endswith(KINDS))
            if not inside:
                raise FileNotFoundError(f"{path}: no log in this folder")
            logs += inside
        elif path.exists():
            logs.append(path)
        else:
            raise FileNotFoundError(f"{path}: no such file")
    return logs


def _plain_name(path: Path) -> str:
    return path.name.removesuffix(".xz").removesuffix(".gz")


def row_of(found: dict[str, Any]) -> list[str]:
    """Return one line of the table."""
    return [
        found["log"],
        found["layer"],
        *(f"{found[key]:.4f}" if np.isfinite(found[key]) else "-" for key in ("mean_m", "median_m")),
        f"{np.mean(found['cpu_s']):.1f}",
        f"{found['peak_mb']:.0f}",
        f"{found['grew_mb']:.1f}",
        f"{found['map_kb']:.0f}",
        str(found["nodes"]),
        str(found["closures"]),
    ]


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="lemtomap bench logs", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("logs", type=Path, nargs="+", metavar="LOG")
    parser.add_argument("--out", type=Path, default=Path("runs/logs"))
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--layers", nargs="+", choices=LAYERS, default=list(LAYERS))
    parser.add_argument("--compare", type=Path, metavar="OLD.json")
    options = parser.parse_args(arguments)
    try:
        logs = found_logs(options.logs)
        for log in logs:
            open_log(log)  # whatever is wrong with one is told before hours of work
    except (FileNotFoundError, LemtomapError) as error:
        print(error, file=sys.stderr)
        return 2
    options.out.mkdir(parents=True, exist_ok=True)
    found = []
    for log in logs:
        runs = [LogRuns(log, layer, options.seeds, options.out) for layer in options.layers]
        found += [each.figures() for each in runs]
        draw(log, runs, options.out / f"{log.name.split('.')[0]}.png")
    report = options.out / "logs.json"
    report.write_text(json.dumps({f"{each['log']} {each['layer']}": each for each in found}, indent=1))
    text = table(HEADER, [row_of(each) for each in found])
    pictures = [f"![{log.name}]({log.name.split('.')[0]}.png)" for log in logs]
    (options.out / "logs.md").write_text("\n\n".join([text, *pictures]) + "\n")
    print(text)
    if options.compare is not None:
        print(compare_files(options.compare, report))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
