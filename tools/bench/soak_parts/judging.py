"""What a soak showed, from the files it left: slopes with their errors, limits, a picture."""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tools.bench.parts.mapping_runs import table
from tools.bench.thesis_parts.drives import is_wrong

SETTLED_S = 900.0  # the first quarter of an hour may fill caches
MOST_MB_PER_H = 1.0
BLOCK = 10  # minutes that are averaged before a trend is fitted: neighbours are not independent
NO_TREND_PER_H = 0.01  # share; less than this is none, however exactly it is known


@dataclass(frozen=True, slots=True)
class Trend:
    """A straight line through a curve."""

    per_h: float
    error_per_h: float
    """Standard error of the slope, from means over blocks."""
    mean: float


def told(trend: Trend) -> str:
    """Return a slope with its error."""
    return f"{trend.per_h:+.2f} ± {trend.error_per_h:.2f}"


@dataclass(frozen=True, slots=True)
class Verdict:
    """Figures of a soak beside what is asked of them."""

    world: str
    hours: float
    path_m: float
    speed: float
    """Simulated time over wall time."""
    nodes: int
    explored_min: float | None
    memory: Trend
    """MB, after the first quarter of an hour."""
    memory_at_mb: tuple[float, float]
    """After the quarter of an hour, and at the end."""
    cpu: Trend
    """CPU seconds per simulated minute, all parts of the robot, once it is explored."""
    cpu_parts: dict[str, float]
    """The same by part, over the whole soak."""
    closures: int
    wrong: list[dict[str, Any]] = field(default_factory=list)
    reached: int = 0
    failed: list[dict[str, Any]] = field(default_factory=list)
    contacts: int = 0
    lost_s: float = 0.0

    @property
    def checks(self) -> list[tuple[str, str, bool]]:
        """What is asked, what was found, and whether that will do."""
        trend = abs(self.cpu.per_h) / max(self.cpu.mean, 1e-9)
        sure = abs(self.cpu.per_h) > 2.0 * self.cpu.error_per_h and trend > NO_TREND_PER_H
        return [
            (
                f"resident memory after 15 min grows by at most {MOST_MB_PER_H:g} MB/h",
                f"{told(self.memory)} MB/h ({self.memory_at_mb[0]:.1f} to {self.memory_at_mb[1]:.1f} MB)",
                self.memory.per_h <= MOST_MB_PER_H,
            ),
            (
                "CPU per simulated minute without trend",
                f"{self.cpu.mean:.2f} s a minute, {told(self.cpu)} s per hour",
                not sure,
            ),
            ("no wrong closure", f"{len(self.wrong)} of {self.closures}", not self.wrong),
            (
                "every goal reached",
                f"{self.reached} of {self.reached + len(self.failed)}",
                not self.failed and self.reached > 0,
            ),
        ]

    @property
    def passed(self) -> bool:
        """Whether every limit held."""
        return all(held for _, _, held in self.checks)

    def text(self) -> str:
        """Return the report as Markdown."""
        rows = [[asked, found, "yes" if held else "**no**"] for asked, found, held in self.checks]
        parts = ", ".join(f"{name} {value:.2f} s" for name, value in self.cpu_parts.items())
        explored = (
            "still exploring" if self.explored_min is None else f"explored for {self.explored_min:.0f} min"
        )
        head = (
            f"{self.hours:.2f} h of {self.world}, {self.path_m / 1000:.2f} km, {self.nodes} nodes, "
            f"{explored}; {self.speed:.1f}x real time; {self.contacts} contacts, {self.lost_s:.0f} s lost. "
            f"CPU of a simulated minute: {parts}."
        )
        lines = [head, table(["asked", "found", "held"], rows)]
        lines += [
            f"not reached: node {each['node_id']} after {each['ended_s'] - each['begun_s']:.0f} s at "
            f"{each['ended_s'] / 60:.0f} min: {each['text']}"
            for each in self.failed
        ]
        lines += [
            f"wrong closure: edge {each['edge_id']}, {each['source_id']} to {each['target_id']}: "
            f"{each['off_m']:.2f} m and {np.rad2deg(each['off_rad']):.1f} degrees off"
            f", {each['sigmas']:.1f} of its own sigmas"
            for each in self.wrong
        ]
        return "\n\n".join(lines)


def judge(out: Path) -> Verdict:
    """Read what a soak left in its folder, draw soak.png, and return what it showed."""
    options = json.loads((out / "options.json").read_text())
    samples = _lines(out / "samples.jsonl")
    errands = _lines(out / "errands.jsonl")
    closures_file = out / "closures.json"
    closures = json.loads(closures_file.read_text()) if closures_file.exists() else []
    if len(samples) < 2:
        raise SystemExit(f"{out / 'samples.jsonl'}: less than two simulated minutes, nothing to tell")
    column = {key: np.array([sample[key] for sample in samples], dtype=np.float64) for key in samples[0]}
    hours = column["stamp_s"] / 3600.0
    cpu = sum(column[f"{part}_cpu_s"] for part in ("mapping", "navigation", "base"))
    per_minute = np.diff(cpu, prepend=0.0)
    settled = column["stamp_s"] >= min(SETTLED_S, 0.5 * column["stamp_s"][-1])
    driving = (column["explored"] > 0) & settled
    driving = driving if driving.sum() >= 4 else settled
    _draw(out / "soak.png", hours, column, per_minute)
    last, minutes = samples[-1], len(samples)
    explored = np.flatnonzero(column["explored"])
    return Verdict(
        world=options["world"],
        hours=float(hours[-1]),
        path_m=last["path_m"],
        speed=last["stamp_s"] / last["wall_s"],
        nodes=last["nodes"],
        explored_min=float(explored[0]) if explored.size else None,
        memory=trend(hours[settled], column["resident_mb"][settled]),
        memory_at_mb=(float(column["resident_mb"][settled][0]), last["resident_mb"]),
        cpu=trend(hours[driving], per_minute[driving]),
        cpu_parts={part: last[f"{part}_cpu_s"] / minutes for part in ("mapping", "navigation", "base")},
        closures=len(closures) if closures else last["closures"],
        wrong=[one for one in closures if is_wrong(np.array([one["off_m"], 0.0, one["off_rad"]]))],
        reached=sum(one["reached"] for one in errands),
        failed=[one for one in errands if not one["reached"]],
        contacts=last["contacts"],
        lost_s=last["lost_s"],
    )


def trend(x: NDArray[np.float64], y: NDArray[np.float64]) -> Trend:
    """Fit a line through means over blocks; float64 (N,) each."""
    block = max(1, min(BLOCK, len(x) // 6))
    count = len(x) // block
    if count < 3:
        return Trend(0.0, float("inf"), float(y.mean()))
    xs, ys = (values[: count * block].reshape(count, block).mean(axis=1) for values in (x, y))
    slope, offset = np.polyfit(xs, ys, 1)
    residual = ys - (slope * xs + offset)
    error = np.sqrt((residual**2).sum() / (count - 2) / ((xs - xs.mean()) ** 2).sum())
    return Trend(float(slope), float(error), float(y.mean()))


def _lines(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def _draw(
    path: Path,
    hours: NDArray[np.float64],
    column: dict[str, NDArray[np.float64]],
    per_minute: NDArray[np.float64],
) -> None:
    figure = Figure(figsize=(12, 3.4), dpi=110, layout="constrained")
    memory, cpu, work = figure.subplots(1, 3)
    memory.plot(hours, column["resident_mb"], color="#1d5fa8")
    memory.set_title("resident memory, robot and simulator (MB)", fontsize=10)
    memory.set_ylim(bottom=0)
    cpu.plot(hours, per_minute, color="#1d5fa8", label="all")
    for part, style in (("mapping", "--"), ("navigation", ":"), ("base", "-.")):
        values = np.diff(column[f"{part}_cpu_s"], prepend=0.0)
        cpu.plot(hours, values, linestyle=style, linewidth=1, label=part)
    cpu.set_title("CPU of a simulated minute (s)", fontsize=10)
    cpu.set_ylim(bottom=0)
    cpu.legend(fontsize=8)
    work.plot(hours, column["nodes"], color="#444", label="nodes")
    other = work.twinx()
    other.plot(hours, column["reached"], color="#2a8a4a", label="goals reached")
    other.plot(hours, column["closures"], color="#c0392b", label="closures")
    work.set_title("nodes (left), goals and closures (right)", fontsize=10)
    other.legend(fontsize=8)
    for axes in (memory, cpu, work):
        axes.set_xlabel("simulated hours")
        axes.axvline(SETTLED_S / 3600.0, color="#bbb", linewidth=0.8)
    figure.savefig(path)
