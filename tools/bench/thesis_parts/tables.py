"""The report's tables, ours beside the baseline's and the thesis' own."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tools.bench.parts.mapping_runs import table
from tools.bench.thesis_parts import published
from tools.bench.thesis_parts.chain import BASELINE, OURS, System
from tools.bench.thesis_parts.readings import SystemReadings

Readings = Mapping[str, SystemReadings]


def difference(ours: float, theirs: float) -> str:
    """Return ours against theirs in percent; negative is less."""
    return f"{100.0 * (ours / theirs - 1.0):+.1f} %" if theirs else "-"


def resources(systems: Sequence[System], readings: Readings) -> str:
    """Return the headline of one drive: CPU, memory, their course at the end, size, errors."""
    rows = []
    base = readings[BASELINE.key]
    measures: list[tuple[str, Any, int]] = [
        ("CPU time of all parts, s", lambda r: float(np.mean(r.cpu_s)), 1),
        ("of that, metric mapping, s", lambda r: r.parts["metric mapping"].cpu_s[-1], 1),
        ("memory of all parts at the end, MB", lambda r: r.total.memory_mb[-1], 1),
        ("of that, metric mapping, MB", lambda r: r.parts["metric mapping"].memory_mb[-1], 1),
        ("map on disk, kB", lambda r: r.disk_kb, 1),
        ("mean error over 10 m of way, m", lambda r: r.local_m, 3),
        ("mean error of the whole track, m", lambda r: r.whole_m, 3),
    ]
    for name, of, digits in measures:
        values = [of(readings[system.key]) for system in systems]
        row = [name, *(f"{value:.{digits}f}" for value in values)]
        rows.append([*row, *(difference(value, of(base)) for value in values[:-1])])
    told = [(readings[s.key].closures, readings[s.key].wrong_closures) for s in systems]
    wrong = ["-" if s is BASELINE else f"{b} of {a}" for s, (a, b) in zip(systems, told, strict=True)]
    rows.append(["wrong loop closures, all repetitions", *wrong, *("" for _ in systems[:-1])])
    spread = [
        f"± {np.ptp(each) / 2.0:.1f}" if len(each) > 1 else "-"
        for each in (readings[s.key].cpu_s for s in systems)
    ]
    rows.insert(1, ["spread of the repetitions, s", *spread, *("" for _ in systems[:-1])])
    header = ["", *(s.title for s in systems), *(f"{s.title} against baseline" for s in systems[:-1])]
    return table(header, rows)


def course(systems: Sequence[System], readings: Readings) -> str:
    """Return how memory and load go on at the end of the drive: flat or not."""
    rows = []
    for system in systems:
        found = readings[system.key]
        for name, curve in {**found.parts, "all": found.total}.items():
            slope, growth = curve.memory_slope_mb_per_h(), curve.load_growth()
            load = float(curve.load_percent[curve.last_third()].mean())
            rows.append(
                [
                    system.title,
                    name,
                    f"{curve.start_mb:.0f}",
                    f"{curve.memory_mb[-1]:.1f}",
                    f"{slope:+.1f}",
                    f"{load:.1f}",
                    f"{growth:.2f}",
                ]
            )
    header = [
        "system",
        "part",
        "process before it began, MB",
        "memory it took, MB",
        "slope in the last third, MB/h",
        "load in the last third, % of a core",
        "load there over that in the middle third",
    ]
    return table(header, rows)


def sizes(drives: Mapping[str, Readings], bare_kb: Mapping[str, float]) -> str:
    """Return table 5-1; bare_kb: size of our maps without localisation data, by drive."""
    rows = []
    for name, readings in drives.items():
        ours, theirs = readings[OURS.key].disk_kb, readings[BASELINE.key].disk_kb
        then, base = published.SIZE_KB.get(name, (0, 0))
        rows.append(
            [
                name,
                f"{ours:.1f}",
                f"{theirs:.1f}",
                difference(ours, theirs),
                f"{bare_kb[name]:.1f}",
                difference(bare_kb[name], theirs),
                f"{then}",
                f"{base}",
                difference(then, base),
            ]
        )
    header = [
        *("drive", "LEMTOMap, kB", "baseline, kB", "difference"),
        *("without localisation data, kB", "difference", "2014: V0.5", "baseline", "difference"),
    ]
    return table(header, rows)


def navigation(tasks: Mapping[str, Mapping[str, Mapping[str, float]]]) -> str:
    """Return table 5-2; tasks: short or long, then topological or metric, then the means of a leg."""
    rows = []
    for name, kinds in tasks.items():
        ours, theirs = kinds["topological"], kinds["metric"]
        for key, (title, short, long) in published.NAVIGATION.items():
            then, base = short if name == "small" else long
            now = [f"{ours[key]:.2f}", f"{theirs[key]:.2f}", difference(ours[key], theirs[key])]
            rows.append([name, title, *now, f"{then:.2f}", f"{base:.2f}", difference(then, base)])
        for key, title in (
            ("reached", "legs reached"),
            ("stops", "stops on the way, in all"),
            ("contacts", "contacts, in all"),
        ):
            rows.append([name, title, f"{ours[key]:.0f}", f"{theirs[key]:.0f}", "", "", "", ""])
    header = ["task", "mean of a leg", "LEMTOMap", "baseline", "diff.", "2014: V0.5", "baseline", "diff."]
    return table(header, rows)


def where_the_baseline_wins(drives: Mapping[str, Readings], tasks: Mapping[str, Any]) -> str:
    """Return a sentence for each figure in which the baseline is better; says so when there is none."""
    found = []
    for name, readings in drives.items():
        ours, theirs = readings[OURS.key], readings[BASELINE.key]
        pairs = {
            "CPU time of all parts": (float(np.mean(ours.cpu_s)), float(np.mean(theirs.cpu_s))),
            "memory of all parts": (ours.total.memory_mb[-1], theirs.total.memory_mb[-1]),
            "process memory, interpreters and libraries included": (
                ours.total.memory_mb[-1] + ours.total.start_mb,
                theirs.total.memory_mb[-1] + theirs.total.start_mb,
            ),
            "map on disk": (ours.disk_kb, theirs.disk_kb),
            "error over 10 m of way": (ours.local_m, theirs.local_m),
            "error of the whole track": (ours.whole_m, theirs.whole_m),
        }
        found += [f"{name} drive, {what}: {a:.4g} against {b:.4g}" for what, (a, b) in pairs.items() if a > b]
    for name, kinds in tasks.items():
        for key, (title, _, _) in published.NAVIGATION.items():
            a, b = kinds["topological"][key], kinds["metric"][key]
            if a > b:
                found.append(f"{name} task, {title}: {a:.4g} against {b:.4g} ({difference(a, b)})")
    if not found:
        return "The baseline is ahead in none of the figures of this run."
    return "The baseline is ahead in (ours against its):\n\n" + "\n".join(f"- {line}" for line in found)
