"""A picture of the whole map for a person: nodes, edges by type, names."""

import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from lemtomap.errors import BadInput
from lemtomap.se2 import Pose
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.graph import Edge
from lemtomap.topo.naming import shown
from lemtomap.topo.whole.export import APPROXIMATE, write_whole
from lemtomap.topo.whole.layout import lay_out
from lemtomap.types import EdgeType

COLOURS = {
    EdgeType.NEAR_NEIGHBOUR: "#b8c4d0",
    EdgeType.ODOMETRY: "#3b6ea5",
    EdgeType.LOOP_CLOSING: "#d1495b",
}
CLOSED, UNPROVEN = "#14213d", "#d1495b"
MAX_INCHES = 16.0
LABEL = 40  # characters of a name in a picture


@contextmanager
def plain_text() -> Iterator[None]:
    """Draw every text as it stands: a name is no formula, a letter that the font lacks is a box."""
    with rc_context({"text.parse_math": False}), warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"Glyph \d+ .*missing from", UserWarning)
        yield


def write_name(axes: Axes, name: str, place: Pose, **how: Any) -> None:
    """Write a name beside a place, float64 (2+,). However long, the rest of the picture keeps its size."""
    at = (float(place[0]), float(place[1]))
    label = axes.annotate(shown(name, LABEL), at, textcoords="offset points", **how)
    label.set_in_layout(False)


def write_png(
    store: TopoStore,
    path: Path,
    dots_per_inch: int = 110,
    paint: Callable[[Axes, Mapping[int, Pose]], None] | None = None,
) -> None:
    """Draw the map. Raises BadInput when it has no node or the file cannot be written.

    `paint` may draw over it, and is told where each node stands, T_map_node.
    """
    with plain_text():
        figure = _drawn(store, paint)
        picture = BytesIO()
        figure.savefig(picture, dpi=dots_per_inch, format="png")
    write_whole(path, picture.getvalue())


def _drawn(store: TopoStore, paint: Callable[[Axes, Mapping[int, Pose]], None] | None = None) -> Figure:
    layout = lay_out(store)
    if not layout.T_map_node:
        raise BadInput(f"{store.path}: an empty map has no picture")
    at = np.array(list(layout.T_map_node.values()))
    size = np.clip(np.ptp(at[:, :2], axis=0) / 4.0 + 3.0, 5.0, MAX_INCHES)
    figure = Figure(figsize=(float(size[0]), float(size[1])), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot(aspect="equal", xlabel="x, m", ylabel="y, m")
    open_edges, closed, unproven = _sorted(list(store.edges()))
    kinds = [(kind.value.replace("_", " "), colour, "-") for kind, colour in COLOURS.items()]
    styles = [*kinds, ("closed by hand", CLOSED, ":"), ("loop closing, not driven yet", UNPROVEN, ":")]
    for (label, colour, style), edges in zip(styles, (*open_edges, closed, unproven), strict=True):
        lines = [
            [layout.T_map_node[edge.source_id][:2], layout.T_map_node[edge.target_id][:2]] for edge in edges
        ]
        if lines or style == "-":
            axes.add_collection(
                LineCollection(
                    lines, colors=colour, linewidths=1.2, linestyles=style, label=f"{label} ({len(lines)})"
                )
            )
    axes.plot(at[:, 0], at[:, 1], ".", color="#14213d", markersize=4, label=f"nodes ({len(at)})")
    for name, node_id in store.names().items():
        write_name(axes, name, layout.T_map_node[node_id], xytext=(5, 5))
    if paint is not None:
        paint(axes, layout.T_map_node)
    axes.legend(loc="upper left", fontsize="small")
    axes.set_title(f"{shown(store.path.name)}: {APPROXIMATE}", fontsize="small")
    axes.autoscale_view()
    return figure


def _sorted(edges: list[Edge]) -> tuple[list[list[Edge]], list[Edge], list[Edge]]:
    """Return the open ways by type, those closed by hand, and closures that nobody has driven."""
    closed = [edge for edge in edges if edge.is_closed]
    unproven = [edge for edge in edges if not edge.is_closed and not edge.is_proven]
    ways = [edge for edge in edges if not edge.is_closed and edge.is_proven]
    return [[edge for edge in ways if edge.type is kind] for kind in COLOURS], closed, unproven
