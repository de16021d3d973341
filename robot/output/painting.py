"""Painting overview.png: the program reads an Overview from stdin and writes the picture to stdout."""

import pickle
import sys
from io import BytesIO

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from lemtomap import se2
from lemtomap.areas.picture import paint as paint_areas
from lemtomap.robot.output.files import grey_levels
from lemtomap.robot.output.overview import Overview
from lemtomap.se2 import Pose
from lemtomap.topo.naming import shown
from lemtomap.topo.whole.lettering import plain_text, write_name
from lemtomap.types import EdgeType, GridView

EDGE_STYLE = {
    EdgeType.ODOMETRY: ("#2a9d8f", 1.4, "driven"),
    EdgeType.NEAR_NEIGHBOUR: ("#e9a23b", 0.8, "near neighbour"),
    EdgeType.LOOP_CLOSING: ("#d62828", 2.2, "loop closing"),
}
NODE_COLOUR, PATH_COLOUR, ROBOT_COLOUR = "#1d3557", "#457b9d", "#d62828"
TITLE = 100  # characters
LONGEST_SIDE_CELLS = 2500  # of the wall picture; more is beyond the paper's resolution


def paint(overview: Overview) -> bytes:
    """Return the picture as PNG, 1800 x 1200 pixels."""
    with plain_text():
        picture = BytesIO()
        _drawn(overview).savefig(picture, format="png")
    return picture.getvalue()


def _drawn(overview: Overview) -> Figure:
    figure = Figure(figsize=(15, 10), dpi=120, layout="constrained", facecolor="white")
    layout = figure.add_gridspec(2, 2, width_ratios=(2.3, 1), height_ratios=(1, 0.8))
    whole = figure.add_subplot(layout[:, 0])
    _draw_whole(whole, overview)
    _draw_window(figure.add_subplot(layout[0, 1]), overview)
    _write_facts(figure.add_subplot(layout[1, 1]), overview)
    figure.legend(handles=_legend(overview), loc="outside lower left", ncols=6, fontsize=9)
    figure.suptitle(shown(overview.title, TITLE), fontsize=15, fontweight="bold")
    return figure


def _draw_whole(axes: Axes, overview: Overview) -> None:
    """Draw the map of the whole drive: walls, trajectory, graph."""
    _draw_walls(axes, overview.walls)
    path = overview.trajectory
    axes.plot(path[:, 0], path[:, 1], color=PATH_COLOUR, linewidth=0.8, alpha=0.7, zorder=2)
    _draw_graph(axes, overview)
    corners = se2.transform(overview.T_map_grid, _corners(overview.grid))
    axes.plot(corners[:, 0], corners[:, 1], color="#888888", linewidth=1, linestyle="--", zorder=2)
    shown = np.concatenate([overview.walls, path[:, :2]])
    low, high = (
        np.quantile(shown, 0.001, axis=0),
        np.quantile(shown, 0.999, axis=0),
    )  # stray beams do not count
    margin_m = 0.04 * float((high - low).max()) + 0.5
    axes.set_xlim(low[0] - margin_m, high[0] + margin_m)
    axes.set_ylim(low[1] - margin_m, high[1] + margin_m)
    _draw_robot(axes, path[-1], max(0.25, 0.012 * float((high - low).max())))
    axes.set_aspect("equal", anchor="N")
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    axes.set_title("the whole map, solved once for this picture", fontsize=11)


def _draw_walls(axes: Axes, walls: NDArray[np.floating]) -> None:
    """Draw beam ends as a density image: a doubled wall shows as two lines."""
    if not len(walls):
        return
    low, high = walls.min(axis=0) - 0.5, walls.max(axis=0) + 0.5
    cell_m = max(0.05, float((high - low).max()) / LONGEST_SIDE_CELLS)
    bins = np.maximum(1, np.ceil((high - low) / cell_m)).astype(int)
    cols, rows = bins.tolist()
    col, row = np.minimum((walls - low) / (high - low) * bins, bins - 1).astype(np.int32).T
    hits = np.bincount(row * cols + col, minlength=rows * cols).reshape(rows, cols)
    shade = np.log1p(hits, dtype=np.float32)
    axes.imshow(
        shade,
        extent=(low[0], high[0], low[1], high[1]),
        origin="lower",
        cmap="Greys",
        vmax=max(1.0, float(np.quantile(shade[shade > 0], 0.9))),
        interpolation="antialiased",
        interpolation_stage="data",  # colours of every cell would take 200 MB
        zorder=0,
    )


def _draw_graph(axes: Axes, overview: Overview) -> None:
    """Draw nodes and edges, closures on top."""
    for order, (kind, (colour, width, _)) in enumerate(EDGE_STYLE.items()):
        ends = [
            (overview.T_map_node[a][:2], overview.T_map_node[b][:2])
            for a, b, edge_kind in overview.edges
            if edge_kind == kind and a in overview.T_map_node and b in overview.T_map_node
        ]
        axes.add_collection(
            LineCollection(ends, colors=colour, linewidths=width, zorder=3 + order, alpha=0.9)
        )
    if overview.T_map_node:
        nodes = np.array([pose[:2] for pose in overview.T_map_node.values()])
        size = float(np.clip(4000 / len(nodes), 3, 18))
        axes.scatter(nodes[:, 0], nodes[:, 1], s=size, color=NODE_COLOUR, zorder=7, linewidths=0)
    if overview.painting is not None and overview.T_map_node:
        paint_areas(axes, overview.painting, overview.T_map_node, size)
    for node_id, name in overview.names.items():
        if node_id in overview.T_map_node:
            write_name(axes, name, overview.T_map_node[node_id], xytext=(4, 4), fontsize=9, zorder=9)


def _draw_robot(axes: Axes, T_map_base: Pose, size_m: float) -> None:
    """Draw the robot where the drive ended, nose forward."""
    nose = se2.transform(T_map_base, size_m * np.array([[1.8, 0.0], [-0.9, 1.0], [-0.9, -1.0]]))
    axes.fill(nose[:, 0], nose[:, 1], color=ROBOT_COLOUR, zorder=8)


def _draw_window(axes: Axes, overview: Overview) -> None:
    """Draw the last window alone, in its own frame, with the nodes in it."""
    grid = overview.grid
    corners = _corners(grid)
    (x0, y0), (x1, y1) = corners.min(axis=0), corners.max(axis=0)
    axes.imshow(grey_levels(grid.occupancy), extent=(x0, x1, y0, y1), cmap="gray", vmin=0, vmax=255)
    T_grid_map = se2.inverse(overview.T_map_grid)
    if overview.T_map_node:
        nodes = np.array(list(overview.T_map_node.values()))[:, :2]
        nodes_grid = se2.transform(T_grid_map, nodes)
        axes.scatter(nodes_grid[:, 0], nodes_grid[:, 1], s=10, color=NODE_COLOUR, linewidths=0)
    _draw_robot(axes, se2.compose(T_grid_map, overview.trajectory[-1]), 0.35)
    axes.set_xlim(x0, x1)
    axes.set_ylim(y0, y1)
    axes.set_aspect("equal")
    axes.set_title(f"the grid at the end: {x1 - x0:.0f} m x {y1 - y0:.0f} m", fontsize=11)


def _write_facts(axes: Axes, overview: Overview) -> None:
    """Write the figures that matter beside the picture."""
    axes.axis("off")
    facts = "\n".join(shown(fact) for fact in overview.facts)
    axes.text(0.02, 0.98, facts, va="top", family="monospace", fontsize=9.5)


def _corners(grid: GridView) -> NDArray[np.float64]:
    """Return the closed outline of the window, float64 (5, 2), metres, grid frame."""
    rows, cols = grid.occupancy.shape
    x, y = grid.origin_m
    width, height = cols * grid.resolution_m, rows * grid.resolution_m
    return np.array([[x, y], [x + width, y], [x + width, y + height], [x, y + height], [x, y]])


def _legend(overview: Overview) -> list[Line2D]:
    """Return one line per thing drawn, with its count."""
    kinds = [kind for _, _, kind in overview.edges]
    return [
        Line2D([], [], color=PATH_COLOUR, linewidth=1, label="trajectory"),
        Line2D(
            [],
            [],
            color=NODE_COLOUR,
            marker="o",
            linestyle="",
            markersize=4,
            label=f"nodes ({len(overview.T_map_node)})",
        ),
        *(
            Line2D([], [], color=colour, linewidth=width + 0.5, label=f"{label} edges ({kinds.count(kind)})")
            for kind, (colour, width, label) in EDGE_STYLE.items()
        ),
        Line2D([], [], color="#888888", linestyle="--", linewidth=1, label="window at the end"),
    ]


def main() -> None:
    """Paint what comes in."""
    overview = pickle.load(sys.stdin.buffer)  # noqa: S301 - from the process that started this one
    sys.stdout.buffer.write(paint(overview))


if __name__ == "__main__":
    main()
