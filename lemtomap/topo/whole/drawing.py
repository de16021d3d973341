"""The graph on a figure's axes: for the overview of a drive, the picture of a map and the reports."""

from collections.abc import Iterable, Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from lemtomap import palette
from lemtomap.se2 import Pose
from lemtomap.types import EdgeType

WIDTHS: Mapping[EdgeType, float] = {
    EdgeType.NEAR_NEIGHBOUR: 0.8,
    EdgeType.ODOMETRY: 1.4,
    EdgeType.LOOP_CLOSING: 2.2,
}
"""Points, as in the overview."""
LABELS: Mapping[EdgeType, str] = {
    EdgeType.NEAR_NEIGHBOUR: "near neighbour",
    EdgeType.ODOMETRY: "driven",
    EdgeType.LOOP_CLOSING: "loop closing",
}


def draw_edges(
    axes: Axes,
    places: Mapping[int, Pose],
    ends: Iterable[tuple[int, int]],
    kind: EdgeType,
    *,
    label: str = "",
    colour: str = "",
    dotted: bool = False,
) -> None:
    """Draw edges of one kind between nodes at these places, (2+,) metres.

    label: in the legend, with how many there are. An edge to a node without a place is left out.
    """
    lines = [(places[a][:2], places[b][:2]) for a, b in ends if a in places and b in places]
    axes.add_collection(
        LineCollection(
            lines,
            colors=colour or palette.EDGES[kind],
            linewidths=WIDTHS[kind],
            linestyles=":" if dotted else "-",
            zorder=3 + list(palette.EDGES).index(kind),
            alpha=0.9,
            label=f"{label} ({len(lines)})" if label else None,
        )
    )


def draw_graph(axes: Axes, places: Mapping[int, Pose], edges: Iterable[tuple[int, int, EdgeType]]) -> None:
    """Draw all edges, closures on top, and the nodes."""
    sorted_edges = list(edges)
    for kind in palette.EDGES:
        draw_edges(axes, places, [(a, b) for a, b, its in sorted_edges if its == kind], kind)
    draw_nodes(axes, places)


def draw_nodes(axes: Axes, places: Mapping[int, Pose], *, label: str = "") -> None:
    """Draw nodes, the smaller the more there are."""
    told = f"{label} ({len(places)})" if label else None
    if places:
        at = np.array([place[:2] for place in places.values()])
        size = node_size(len(at))
        axes.scatter(at[:, 0], at[:, 1], s=size, color=palette.NODE, zorder=7, linewidths=0, label=told)


def node_size(count: int) -> float:
    """Return how large each of so many nodes is drawn, points squared."""
    return float(np.clip(4000 / count, 3, 18))
