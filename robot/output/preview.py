"""overview.png while a run is still going on: the window and the graph in it, drawn in some 10 ms."""

from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from lemtomap import palette, se2
from lemtomap.robot.output.files import grey_levels, write_whole
from lemtomap.types import MapView

SCALE = 2  # pixels a cell


def draw_preview(path: Path, view: MapView) -> None:
    """Draw the window with nodes, edges and robot, whole or not at all."""
    grey = Image.fromarray(grey_levels(view.grid.occupancy))
    picture = grey.convert("RGB").resize((grey.width * SCALE, grey.height * SCALE), Image.Resampling.NEAREST)
    draw = ImageDraw.Draw(picture)
    for _, a, b, kind in view.edges:
        if a in view.T_grid_node and b in view.T_grid_node:
            ends = _pixels(view, np.array([view.T_grid_node[a][:2], view.T_grid_node[b][:2]]))
            draw.line([tuple(end) for end in ends.tolist()], fill=palette.EDGES[kind], width=2)
    for node_id, pose in view.T_grid_node.items():
        ((x, y),) = _pixels(view, pose[None, :2]).tolist()
        colour = palette.HERE if node_id == view.associated_id else palette.NODE
        draw.ellipse((x - 4, y - 4, x + 4, y + 4), fill=colour)
    nose = se2.transform(view.T_grid_base, np.array([[0.4, 0.0], [-0.2, 0.22], [-0.2, -0.22]]))
    draw.polygon([tuple(corner) for corner in _pixels(view, nose).tolist()], fill=palette.ROBOT)
    data = BytesIO()
    picture.save(data, format="PNG", compress_level=1)
    write_whole(path, data.getvalue())


def _pixels(view: MapView, points_grid: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return where points, float64 (N, 2), metres, grid frame, lie in the picture."""
    grid = view.grid
    cells = (points_grid - np.array(grid.origin_m)) / grid.resolution_m
    return SCALE * np.column_stack([cells[:, 0], grid.occupancy.shape[0] - cells[:, 1]])
