"""Areas in colour, with ID and name, and doors, in any picture that shows nodes in one frame."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from lemtomap.areas.colours import colour_of
from lemtomap.areas.painting import Painting
from lemtomap.se2 import Pose, transform

DOOR_COLOUR, SHUT_COLOUR = "#d00000", "#14213d"
NUMBERED_BELOW = 400  # nodes: with more, their numbers cannot be read


def paint(axes: Axes, painting: Painting, places: Mapping[int, Pose], size: float, **how: Any) -> None:
    """Draw areas and doors over nodes that stand at T_map_node, float64 (3,), each.

    size: of a node, points squared, as scatter has it.
    """
    known = [node_id for node_id in painting.area_of if node_id in places]
    if not known:
        return
    at = np.array([places[node_id][:2] for node_id in known])
    colours = [colour_of(painting.area_of[node_id]) for node_id in known]
    axes.scatter(at[:, 0], at[:, 1], s=size, c=colours, linewidths=0, zorder=7.5)
    area_ids = np.array([painting.area_of[node_id] for node_id in known])
    for area_id, label in painting.labels.items():
        own = at[area_ids == area_id]
        if len(own):
            middle = own[np.argmin(np.hypot(*(own - own.mean(axis=0)).T))]
            _write(axes, label, middle, area_id, **how)
    for door_id, (node_id, ends, is_shut) in painting.doors.items():
        if node_id in places:
            line = transform(places[node_id], ends)
            colour = SHUT_COLOUR if is_shut else DOOR_COLOUR
            axes.plot(line[:, 0], line[:, 1], color=colour, linewidth=2.5, zorder=8)
            _note(axes, f"d{door_id}", line.mean(axis=0), colour)
    if len(known) < NUMBERED_BELOW:
        for node_id in known:
            _note(axes, str(node_id), places[node_id][:2], "#444444")


def _write(axes: Axes, text: str, at: NDArray[np.float64], area_id: int, **how: Any) -> None:
    box = {"boxstyle": "round,pad=0.2", "fc": "white", "ec": colour_of(area_id), "alpha": 0.85}
    label = axes.annotate(
        text, (float(at[0]), float(at[1])), xytext=(0, 7), textcoords="offset points", ha="center",
        fontsize=8, fontweight="bold", color=colour_of(area_id), bbox=box, zorder=9, **how,
    )  # fmt: skip
    label.set_in_layout(False)


def _note(axes: Axes, text: str, at: Pose, colour: str) -> None:
    note = axes.annotate(
        text, (float(at[0]), float(at[1])), xytext=(3, -3), textcoords="offset points", va="top",
        fontsize=4, color=colour, zorder=8,
    )  # fmt: skip
    note.set_in_layout(False)
