"""Figures 5-3 to 5-8: CPU time, CPU load and memory over the drive."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tools.bench.thesis_parts.readings import Curve, SystemReadings

COLOURS = {"lemtomap": "#1d5fa8", "lemtomap5": "#2a9d8f", "baseline": "#c0392b"}
PART_COLOURS = {
    "metric mapping": "#1d5fa8",
    "topological mapping": "#d1792a",
    "metric navigation": "#2a8a4a",
    "topological navigation": "#7b4ba0",
}
Row = tuple[str, Callable[[Curve], NDArray[np.float64]]]
ROWS: Sequence[Row] = (
    ("CPU time (s)", lambda curve: curve.cpu_s),
    ("CPU load (% of one core)", lambda curve: curve.load_percent),
    ("resident memory (MB)", lambda curve: curve.memory_mb),
)


def draw_totals(systems: Mapping[str, tuple[str, SystemReadings]], path: Path) -> None:
    """Draw all subsystems of each system together (figures 5-3 and 5-6)."""
    figure = Figure(figsize=(11, 3.3), dpi=100, layout="constrained")
    for axes, (title, of) in zip(figure.subplots(1, 3), ROWS, strict=True):
        for key, (name, readings) in systems.items():
            curve = readings.total
            axes.plot(curve.drive_s / 60.0, of(curve), color=COLOURS[key], label=name)
        _finish(axes, title)
    figure.axes[0].legend(fontsize=8)
    figure.savefig(path)


def draw_parts(
    ours: tuple[str, SystemReadings], theirs: tuple[str, SystemReadings], path: Path, *, same_scale: bool
) -> None:
    """Draw each subsystem for itself, ours left and the baseline right (figures 5-4, 5-5, 5-7, 5-8)."""
    figure = Figure(figsize=(9, 7.5), dpi=100, layout="constrained")
    grid = figure.subplots(3, 2)
    for column, (name, readings) in enumerate((ours, theirs)):
        for row, (title, of) in enumerate(ROWS):
            axes = grid[row, column]
            for part, curve in readings.parts.items():
                axes.plot(curve.drive_s / 60.0, of(curve), color=PART_COLOURS[part], label=part)
            _finish(axes, f"{name}: {title}")
        grid[0, column].legend(fontsize=8)
    for left, right in grid if same_scale else ():
        top = max(left.get_ylim()[1], right.get_ylim()[1])
        left.set_ylim(top=top)
        right.set_ylim(top=top)
    figure.savefig(path)


def _finish(axes: Axes, title: str) -> None:
    axes.set_title(title, fontsize=9)
    axes.set_xlabel("drive (min)", fontsize=8)
    axes.tick_params(labelsize=8)
    axes.set_ylim(bottom=0)
