"""A picture of the whole map for a person: nodes, edges by type, names."""

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from lemtomap.errors import BadInput
from lemtomap.topo.export import APPROXIMATE
from lemtomap.topo.layout import lay_out
from lemtomap.topo.store import TopoStore
from lemtomap.types import EdgeType

COLOURS = {
    EdgeType.NEAR_NEIGHBOUR: "#b8c4d0",
    EdgeType.ODOMETRY: "#3b6ea5",
    EdgeType.LOOP_CLOSING: "#d1495b",
}
MAX_INCHES = 16.0


def write_png(store: TopoStore, path: Path, dots_per_inch: int = 110) -> None:
    """Draw the map. Raises BadInput when it has no node or the file cannot be written."""
    layout = lay_out(store)
    if not layout.T_map_node:
        raise BadInput(f"{store.path}: an empty map has no picture")
    at = np.array(list(layout.T_map_node.values()))
    size = np.clip(np.ptp(at[:, :2], axis=0) / 4.0 + 3.0, 5.0, MAX_INCHES)
    figure = Figure(figsize=(float(size[0]), float(size[1])), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot(aspect="equal", xlabel="x, m", ylabel="y, m")
    edges = list(store.edges())
    for kind, colour in COLOURS.items():
        lines = [
            [layout.T_map_node[edge.source_id][:2], layout.T_map_node[edge.target_id][:2]]
            for edge in edges
            if edge.type is kind
        ]
        label = f"{kind.value.replace('_', ' ')} ({len(lines)})"
        axes.add_collection(LineCollection(lines, colors=colour, linewidths=1.2, label=label))
    axes.plot(at[:, 0], at[:, 1], ".", color="#14213d", markersize=4, label=f"nodes ({len(at)})")
    for name, node_id in store.names().items():
        at_node = layout.T_map_node[node_id]
        axes.annotate(name, (at_node[0], at_node[1]), textcoords="offset points", xytext=(5, 5))
    axes.legend(loc="upper left", fontsize="small")
    axes.set_title(f"{store.path.name}: {APPROXIMATE}", fontsize="small")
    axes.autoscale_view()
    try:
        figure.savefig(path, dpi=dots_per_inch, format="png")
    except OSError as error:
        raise BadInput(f"{path}: cannot be written ({error.strerror})") from None
