"""Doors and areas of a map that has none, from what its nodes remember of their surroundings.

Around each node a window is drawn anew: the boundaries that it and its neighbours remember, and the floor
that lies open between them and the nodes. From there on it is as if the robot drove past.
"""

import math
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from lemtomap.areas.book import AreaBook
from lemtomap.areas.kernels.drawing import draw_free, draw_walls, draw_way
from lemtomap.areas.segmentation import AreaSegmenter
from lemtomap.errors import BadInput
from lemtomap.se2 import IDENTITY, Pose, compose, transform
from lemtomap.topo.config import TopoConfig
from lemtomap.topo.file.journal import recorded
from lemtomap.topo.file.paging import PagedGraph
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.local import NodePoseEstimate
from lemtomap.topo.place.codec import decode_place
from lemtomap.topo.segmentation import Neighbourhood
from lemtomap.types import GridView

STEP_M = 0.05  # a cell of the window, so that the same detector fits
CELLS = 240  # 12 m: what a node sees, and its neighbours beside it
REACH_M = 8.0  # over edges, to neighbours whose memories are drawn, too
MOST_UNDONE = 8000  # nodes of a map whose areas can be taken back as one edit
LOOK_APART_S = 60.0


def find_areas(store: TopoStore, stamp_s: float = 0.0) -> str:
    """Find doors and areas anew where no person has said anything; returns what came out.

    Raises BadInput for a map that remembers nothing of its surroundings.
    """
    nodes = [node.node_id for node in store.nodes()]
    if not any(True for _ in store.places()):
        raise BadInput(f"{store.path}: its nodes remember no surroundings, from which areas could be found")
    if len(nodes) > MOST_UNDONE:
        raise BadInput(
            f"{store.path}: {len(nodes):,} nodes are too many for one edit; the next drive finds its areas"
        )
    book = AreaBook(store)
    with recorded(store, "find areas", stamp_s) as recording:
        for node_id in nodes:
            recording.touch("node", node_id)
        for table in ("area", "door", "door_edge"):
            recording.touch_all(table)
        first_area, first_door = book.next_area_id(), book.next_door_id()
        _drive_past(store, nodes)
        for area_id in range(first_area, book.next_area_id()):
            recording.touch_new("area", area_id)
        for door_id in range(first_door, book.next_door_id()):
            recording.touch_new("door", door_id)
        for edge_id in (edge.edge_id for edge in store.edges()):
            recording.touch_new("door_edge", edge_id)
    found = sum(1 for area in book.areas() if book.is_used(area.area_id))
    return f"{found} areas, {len(book.doors())} doors"


def _drive_past(store: TopoStore, nodes: Iterable[int]) -> None:
    graph, segmenter = PagedGraph(store, 4096), AreaSegmenter()
    segmenter.attach(graph)
    for k, around in enumerate(_windows(graph, nodes)):
        for again in range(2):  # what is seen from one node alone counts as two looks: its memory is of many
            segmenter.update(
                Neighbourhood(
                    around.here_id if again else -around.here_id,
                    around.T_grid_base,
                    2.0 * k + again,
                    LOOK_APART_S * (2 * k + again),
                    around.grid,
                    around.standings,
                    around.occupied_from,
                    around.level,
                )
            )


def _windows(graph: PagedGraph, nodes: Iterable[int]) -> Iterator[Neighbourhood]:
    occupied_from = TopoConfig().occupied_from
    for node_id in nodes:
        places: dict[int, Pose] = {}
        for other_id, reached in graph.reach(node_id, REACH_M).items():
            via = reached.via
            if via is None:
                places[other_id] = IDENTITY
            elif via.is_proven:
                from_id = via.other(other_id)
                if from_id in places:
                    places[other_id] = compose(places[from_id], via.seen_from(from_id))
        standings = {k: NodePoseEstimate(pose, np.eye(3) * 1e-4, anchored=True) for k, pose in places.items()}
        level = graph.node(node_id).level
        yield Neighbourhood(
            node_id, IDENTITY, 0.0, 0.0, _drawn(graph, places), standings, occupied_from, level
        )


def _drawn(graph: PagedGraph, places: dict[int, Pose]) -> GridView:
    """Return a window with what some nodes remember, and the ways between them, around the first of them."""
    cells = np.full((CELLS, CELLS), -1, dtype=np.int8)
    half_m = 0.5 * CELLS * STEP_M
    walls: list[NDArray[np.float64]] = []
    for node_id, pose in places.items():
        place = graph.store.place(node_id)
        if place is None or math.hypot(pose[0], pose[1]) > 2.0 * half_m:
            continue
        points = (transform(pose, decode_place(place.boundary).points) + half_m) / STEP_M
        walls.append(points)
        draw_free(cells, (float(pose[0]) + half_m) / STEP_M, (float(pose[1]) + half_m) / STEP_M, points)
    _draw_ways(cells, graph, places, half_m)
    for points in walls:
        draw_walls(cells, points)
    cells.setflags(write=False)
    return GridView(0.0, cells, STEP_M, (-half_m, -half_m))


def _draw_ways(cells: NDArray[np.int8], graph: PagedGraph, places: dict[int, Pose], half_m: float) -> None:
    """Draw the floor that must be free for the robot to take the ways that it knows."""
    radius = TopoConfig().robot_radius_m / STEP_M
    for node_id, here in places.items():
        for edge in graph.edges_of(node_id):
            there = places.get(edge.other(node_id))
            if edge.source_id == node_id and there is not None and edge.is_proven:
                x0, y0, x1, y1 = ((v + half_m) / STEP_M for v in (*here[:2].tolist(), *there[:2].tolist()))
                draw_way(cells, x0, y0, x1, y1, radius)
