"""Figures 5-9 to 5-11: what each system made of the building, laid onto the true plan."""

from pathlib import Path
from typing import Any

import numpy as np
import yaml
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from lemtomap.se2 import (
    Pose,
    compose,
    inverse,
    transform,
)
from lemtomap.sim import worlds
from lemtomap.topo.whole.drawing import draw_graph
from lemtomap.types import EdgeType
from tools.truth.tour_error import truth_and_odometry

MARGIN_M = 3.0


def draw_maps(world: str, log: Path, ours: Path, theirs: Path, path: Path) -> None:
    """Draw LEMTOMap's map and the baseline's, each turned and moved as a whole onto the truth."""
    truth, _ = truth_and_odometry(log)
    low, high = truth.min(axis=0) - 6.0 - MARGIN_M, truth.max(axis=0) + 6.0 + MARGIN_M
    width, height = high - low
    wide = width > 1.3 * height
    shape = (2, 1) if wide else (1, 2)
    figure = Figure(
        figsize=(10, 20 * height / width + 0.6) if wide else (11, 5.5 * height / width + 0.6), dpi=100
    )
    figure.set_layout_engine("constrained")
    axes_of = figure.subplots(*shape)
    for axes, title, draw, folder in (
        (axes_of[0], "LEMTOMap", _draw_graph, ours),
        (axes_of[1], "baseline", _draw_grid, theirs),
    ):
        _draw_plan(axes, world, low, high)
        draw(axes, folder, fit(np.load(folder / "track.npy")[:, :2], truth))
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
        axes.set_title(title, fontsize=10)
        axes.tick_params(labelsize=8)
    figure.savefig(path)


def fit(points: NDArray[np.float64], onto: NDArray[np.float64]) -> Pose:
    """Return T_world_map that lays points onto others best, float64 (N, 2) each."""
    middle, other = points.mean(axis=0), onto.mean(axis=0)
    a, b = points - middle, onto - other
    yaw = float(np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum()))
    return compose(np.array([*other, yaw]), inverse(np.array([*middle, 0.0])))


def _draw_plan(axes: Any, world: str, low: NDArray[np.float64], high: NDArray[np.float64]) -> None:
    """Draw the true walls, pale red."""
    raster = worlds.load(world).raster
    rows, cols = np.nonzero(raster.occupied)
    points = np.array(raster.origin_m) + (np.stack([cols, rows], axis=-1) + 0.5) * raster.resolution_m
    points = points[((points > low) & (points < high)).all(axis=1)]
    axes.plot(*points.T, ",", color="#e9a79f", zorder=0)


def _draw_graph(axes: Any, folder: Path, T_world_map: Pose) -> None:
    with np.load(folder / "picture.npz") as saved:
        node, edge, walls = saved["node"], saved["edge"], saved["walls"]
    axes.plot(*transform(T_world_map, walls).T, ".", markersize=0.6, color="#555555")
    place = {int(row[0]): transform(T_world_map, row[1:3]) for row in node}
    kinds = list(EdgeType)
    draw_graph(axes, place, [(a, b, kinds[number]) for a, b, number in edge.tolist()])


def _draw_grid(axes: Any, folder: Path, T_world_map: Pose) -> None:
    grey = np.flipud(np.asarray(Image.open(folder / "grid.pgm")))
    told = yaml.safe_load((folder / "grid.yaml").read_text())
    step, origin = float(told["resolution"]), told["origin"][:2]
    for value, colour, size in ((254, "#eeeeee", 1.0), (0, "#222222", 0.8)):
        rows, cols = np.nonzero(grey == value)
        if value == 254:  # the floor needs no more than every fourth cell
            keep = (rows % 2 == 0) & (cols % 2 == 0)
            rows, cols = rows[keep], cols[keep]
        points = np.array(origin) + (np.stack([cols, rows], axis=-1) + 0.5) * step
        order = -1 if value == 254 else 1
        axes.plot(*transform(T_world_map, points).T, "s", markersize=size, color=colour, mew=0, zorder=order)
