"""A picture of the whole map for a person: nodes, edges by type, names."""

from collections.abc import Callable, Mapping
from io import BytesIO
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from lemtomap import palette
from lemtomap.errors import BadInput
from lemtomap.se2 import Pose
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.graph import Edge
from lemtomap.topo.naming import shown
from lemtomap.topo.whole.drawing import LABELS, draw_edges, draw_nodes
from lemtomap.topo.whole.export import APPROXIMATE, write_whole
from lemtomap.topo.whole.layout import lay_out
from lemtomap.topo.whole.lettering import plain_text, write_name
from lemtomap.types import EdgeType

MAX_INCHES = 16.0


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
    edges = list(store.edges())
    ways = [edge for edge in edges if not edge.is_closed and edge.is_proven]
    for kind in palette.EDGES:
        ends = [_ends(edge) for edge in ways if edge.type is kind]
        draw_edges(axes, layout.T_map_node, ends, kind, label=LABELS[kind])
    closed = [_ends(edge) for edge in edges if edge.is_closed]
    unproven = [_ends(edge) for edge in edges if not edge.is_closed and not edge.is_proven]
    dotted = (
        (closed, EdgeType.ODOMETRY, "closed by hand", palette.CLOSED),
        (unproven, EdgeType.LOOP_CLOSING, "loop closing, not driven yet", ""),
    )
    for ends, kind, label, colour in dotted:
        if ends:
            draw_edges(axes, layout.T_map_node, ends, kind, label=label, colour=colour, dotted=True)
    draw_nodes(axes, layout.T_map_node, label="nodes")
    for name, node_id in store.names().items():
        write_name(axes, name, layout.T_map_node[node_id], xytext=(5, 5))
    if paint is not None:
        paint(axes, layout.T_map_node)
    axes.legend(loc="upper left", fontsize="small")
    axes.set_title(f"{shown(store.path.name)}: {APPROXIMATE}", fontsize="small")
    axes.autoscale_view()
    return figure


def _ends(edge: Edge) -> tuple[int, int]:
    return edge.source_id, edge.target_id
