"""Chapter 5 of the thesis again: mapping two simulated buildings beside the 2014 baseline, as a report.

    lemtomap bench thesis --quick         the small building once, the large one cut to 3 minutes
    lemtomap bench thesis                 both drives, three repetitions each, navigation there and back twice

The drives (about 3 and 11 minutes at constant speed, section 5-2-1) are recorded in simulation once; the same
recordings go to LEMTOMap (rolling window, 5 particles) and to the baseline (GMapping on a growing grid, 80
particles), each run in a process of its own. Finished runs are kept: stop it and take it up again. Leaves
report.html (self-contained), report.md and thesis.json; --compare OLD.json tells what changed.
"""

import argparse
import base64
import json
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from sim import carmen
from tools.bench_compare import compare
from tools.mapping_runs import MappingRun, slam_cpu_s, table

WILLOW = (
    Path(__file__).resolve().parents[2] / "shared" / "data" / "maps" / "willow" / "willowgarage_perfect.yaml"
)
OURS, BASELINE = "rolling", "gmapping"
PARTICLES = {OURS: 5, BASELINE: 80}  # section 5-2-1
TITLES = {OURS: "LEMTOMap", BASELINE: "baseline (GMapping)"}
COLOURS = {OURS: "#1d5fa8", BASELINE: "#c0392b"}
THESIS_SIZE_KB = {"small": (24, 710), "large": (72, 2671)}  # table 5-1
THESIS_NAVIGATION = [  # table 5-2, short and long trajectory: LEMTOMap-V0.5, baseline
    ("CPU time to the global plan, ms", 17.74, 24.29, 24.19, 97.62),
    ("total CPU time, s", 18.91, 16.01, 74.48, 89.08),
    ("time to the goal, s", 88.66, 82.90, 375.25, 341.27),
    ("distance, m", 38.81, 38.25, 171.56, 167.86),
]


@dataclass(slots=True)
class Experiment:
    """One building: its recording and what each system made of it."""

    name: str
    world: str
    duration_s: float
    told: dict[str, list[dict[str, Any]]] = field(default_factory=dict)
    folders: dict[str, Path] = field(default_factory=dict)

    def run(self, out: Path, repetitions: int) -> None:
        """Record the drive and map it, whatever of it has not been done yet."""
        log = out / f"{self.name}.clf"
        if not log.exists():
            print(f"recording {self.duration_s:.0f} s in {self.world}", flush=True)
            partial = log.with_suffix(".part.clf")
            code = carmen.main([self.world, str(partial), str(self.duration_s)])
            if code:
                raise SystemExit(code)
            partial.rename(log)
        for slam in (OURS, BASELINE):
            runs = [
                MappingRun(log, slam, PARTICLES[slam], seed, out / f"{self.name}-{slam}-{seed}")
                for seed in range(repetitions)
            ]
            self.told[slam] = [run.summary() for run in runs]
            self.folders[slam] = runs[0].out

    def figures(self) -> dict[str, Any]:
        """Return the numbers of this experiment."""
        found: dict[str, Any] = {"log_s": self.told[OURS][0]["log_s"], "path_m": self.told[OURS][0]["path_m"]}
        for slam, told in self.told.items():
            cpu_s = [cpu_of(slam, each) for each in told]
            found[slam] = {
                "cpu_s": float(np.mean(cpu_s)),
                "cpu_spread_s": float(np.ptp(cpu_s)),
                "peak_mb": float(np.mean([each["peak_rss_mb"] for each in told])),
                "growth_mb_per_h": float(np.mean([growth_mb_per_h(each) for each in told])),
                "disk_kb": self._disk_kb(slam),
            }
        return found

    def _disk_kb(self, slam: str) -> float:
        """Return what has to be kept of the map: ours the .lemto file, the baseline's the whole grid."""
        name = "map.lemto" if slam == OURS else "grid.pgm"
        return (self.folders[slam] / name).stat().st_size / 1000


def cpu_of(slam: str, told: dict[str, Any]) -> float:
    """Return the CPU time of a system; the baseline has no topological map to pay for."""
    return float(told["cpu_by_part_s"]["grid"]) if slam == BASELINE else slam_cpu_s(told)


def growth_mb_per_h(told: dict[str, Any]) -> float:
    """Return the slope of resident memory over the last two thirds of the drive."""
    rows = np.array(told["profile"])
    late = rows[len(rows) // 3 :]
    hours = late[:, 0] * told["log_s"] / 3600
    return float(np.polyfit(hours, late[:, 3], 1)[0])


def draw_resources(experiment: Experiment, path: Path) -> None:
    """Draw figures 5-3 to 5-8: CPU time, CPU load and memory over the drive, each layer for itself."""
    figure = Figure(figsize=(12, 3.6), dpi=110, layout="constrained")
    time_axes, load_axes, memory_axes = figure.subplots(1, 3)
    for slam, told in experiment.told.items():
        rows = np.array(told[0]["profile"])
        minutes = rows[:, 0] * told[0]["log_s"] / 60
        total = rows[:, 1] + rows[:, 2] * (slam == OURS)
        colour, title = COLOURS[slam], TITLES[slam]
        time_axes.plot(minutes, total, color=colour, label=title)
        if slam == OURS:
            time_axes.plot(minutes, rows[:, 1], color=colour, linestyle="--", label="its window")
            time_axes.plot(minutes, rows[:, 2], color=colour, linestyle=":", label="its topology")
        window = max(1, len(rows) // 40)
        step_s = 60 * (minutes[window:] - minutes[:-window])
        load_axes.plot(minutes[window:], 100 * (total[window:] - total[:-window]) / step_s, color=colour)
        memory_axes.plot(minutes, rows[:, 3], color=colour)
    for axes, title in (
        (time_axes, "CPU time (s)"),
        (load_axes, "CPU load at real-time speed (%)"),
        (memory_axes, "resident memory of the process (MB)"),
    ):
        axes.set_title(title, fontsize=10)
        axes.set_xlabel("drive (min)")
        axes.set_ylim(bottom=0)
    time_axes.legend(fontsize=8)
    figure.savefig(path)


def difference(ours: float, theirs: float) -> str:
    """Return ours against theirs in percent."""
    return f"{100 * (ours / theirs - 1):+.1f} %" if theirs else "-"


def mapping_table(experiments: Sequence[Experiment]) -> str:
    """Return the resources of both systems side by side."""
    rows = []
    for each in experiments:
        found = each.figures()
        for key, name in (
            ("cpu_s", "CPU time, s"),
            ("peak_mb", "peak memory, MB"),
            ("growth_mb_per_h", "growth of memory, MB/h"),
            ("disk_kb", "map on disk, kB"),
        ):
            ours, theirs = found[OURS][key], found[BASELINE][key]
            rows.append([each.name, name, f"{ours:.1f}", f"{theirs:.1f}", difference(ours, theirs)])
    return table(["drive", "", "LEMTOMap", "baseline", "difference"], rows)


def thesis_tables() -> str:
    """Return the thesis' own numbers."""
    sizes = [
        [name, str(ours), str(theirs), difference(ours, theirs)]
        for name, (ours, theirs) in THESIS_SIZE_KB.items()
    ]
    routes = [
        [name, f"{a:.2f}", f"{b:.2f}", difference(a, b), f"{c:.2f}", f"{d:.2f}", difference(c, d)]
        for name, a, b, c, d in THESIS_NAVIGATION
    ]
    return "\n\n".join(
        [
            "Table 5-1, size on disk in kB (2014, without any localisation data):",
            table(["drive", "V0.5", "baseline", "difference"], sizes),
            "Table 5-2, navigation (2014):",
            table(["", "short V0.5", "baseline", "diff.", "long V0.5", "baseline", "diff."], routes),
        ]
    )


def navigation(out: Path, world: str) -> dict[str, Any]:
    """Run the navigation tasks unless they were run here before; return means per navigator."""
    told = out / "nav_tasks.json"
    if not told.exists():
        command = [sys.executable, "-m", "tools.bench_nav", "tasks", "--world", world, "--out", str(out)]
        subprocess.run([*command, "--seeds", "1"], check=True)  # noqa: S603 - our own interpreter and module
    legs = json.loads(told.read_text())
    keys = ("time_s", "path_m", "first_plan_ms", "planner_cpu_s", "stops", "contacts")
    return {
        kind: {key: float(np.mean([leg[key] for leg in legs if leg["kind"] == kind])) for key in keys}
        for kind in ("topological", "metric")
    }


def navigation_table(found: dict[str, Any]) -> str:
    """Return the navigation figures side by side."""
    ours, theirs = found["topological"], found["metric"]
    rows = [
        [key, f"{ours[key]:.2f}", f"{theirs[key]:.2f}", difference(ours[key], theirs[key])] for key in ours
    ]
    return table(["mean of a leg", "LEMTOMap", "metric baseline", "difference"], rows)


def write_report(out: Path, parts: Sequence[tuple[str, str, Sequence[Path]]]) -> None:
    """Write report.md and report.html; each part is a heading, Markdown text and pictures."""
    markdown, html = ["# Chapter 5 again"], [HEAD]
    for heading, text, pictures in parts:
        markdown += [f"## {heading}", text, *(f"![]({picture.relative_to(out)})" for picture in pictures)]
        html += [f"<h2>{heading}</h2>", to_html(text)]
        for picture in pictures:
            data = base64.b64encode(picture.read_bytes()).decode()
            html.append(f'<img src="data:image/png;base64,{data}" alt="{picture.stem}">')
    (out / "report.md").write_text("\n\n".join(markdown) + "\n")
    (out / "report.html").write_text("\n".join(html) + "\n")


HEAD = """<!doctype html><meta charset="utf-8"><title>LEMTOMap: chapter 5 again</title>
<style>body{font:15px/1.5 sans-serif;max-width:1150px;margin:2em auto;padding:0 1em}img{max-width:100%}
table{border-collapse:collapse;margin:1em 0}td,th{border:1px solid #ccc;padding:.3em .8em;text-align:right}
td:first-child,th:first-child{text-align:left}</style><h1>LEMTOMap: chapter 5 of the thesis again</h1>"""


def to_html(text: str) -> str:
    """Turn paragraphs and tables of Markdown into HTML."""
    blocks = []
    for block in text.split("\n\n"):
        lines = block.splitlines()
        if lines and lines[0].startswith("|"):
            cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
            head = "".join(f"<th>{cell}</th>" for cell in cells[0])
            body = "".join("<tr>" + "".join(f"<td>{c}</td>" for c in row) + "</tr>" for row in cells[2:])
            blocks.append(f"<table><tr>{head}</tr>{body}</table>")
        else:
            blocks.append(f"<p>{block}</p>")
    return "\n".join(blocks)


def experiments_of(options: argparse.Namespace) -> list[Experiment]:
    """Return the two drives; the thesis' own building when its plan is at hand."""
    small = options.small or (str(WILLOW) if WILLOW.exists() else "office")
    large = options.large or (f"{WILLOW}@4" if WILLOW.exists() else "office@4")
    return [Experiment("small", small, 180.0), Experiment("large", large, 180.0 if options.quick else 660.0)]


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="lemtomap bench thesis",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--quick", action="store_true", help="one repetition, the large drive cut to 3 minutes"
    )
    parser.add_argument("--out", type=Path, default=Path("runs/thesis"))
    parser.add_argument("--small", metavar="WORLD", help="default: the thesis' world if at hand, else office")
    parser.add_argument("--large", metavar="WORLD", help="default: four copies of it")
    parser.add_argument("--no-navigation", action="store_true")
    parser.add_argument("--compare", type=Path, metavar="OLD.json")
    options = parser.parse_args(arguments)
    out = options.out / ("quick" if options.quick else "full")
    out.mkdir(parents=True, exist_ok=True)
    experiments = experiments_of(options)
    found: dict[str, Any] = {}
    parts = []
    for each in experiments:
        each.run(out, 1 if options.quick else 3)
        found[each.name] = each.figures()
        picture = out / f"{each.name}-resources.png"
        draw_resources(each, picture)
        maps = [each.folders[slam] / "overview.png" for slam in (OURS, BASELINE)]
        parts.append(
            (f"Mapping, {each.name} drive (figures 5-3 to 5-11)", drive_text(each), [picture, *maps])
        )
    parts.insert(0, ("Mapping in numbers", f"{mapping_table(experiments)}\n\n{thesis_tables()}", []))
    if not options.no_navigation:
        found["navigation"] = navigation(out, experiments[0].world)
        text = navigation_table(found["navigation"])
        parts.append(("Navigation (table 5-2, figure 5-13)", text, [out / "nav_velocity.png"]))
    write_report(out, parts)
    (out / "thesis.json").write_text(json.dumps(found, indent=1))
    print(mapping_table(experiments))
    print(f"\nreport: {out / 'report.html'}")
    if options.compare is not None:
        print(compare(json.loads(options.compare.read_text()), found))
    return 0


def drive_text(each: Experiment) -> str:
    """Return a sentence about one drive."""
    ours = each.told[OURS][0]
    return (
        f"{ours['path_m']:.0f} m in {ours['log_s'] / 60:.1f} min through {Path(each.world).name}, "
        f"{ours['scans']} scans; LEMTOMap with {PARTICLES[OURS]} particles in a 20 m window, "
        f"the baseline with {PARTICLES[BASELINE]} on a growing grid. Memory is that of the whole process: "
        "Python, the compiled kernels, the log itself and the scans kept for the picture are in it."
    )


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
