"""Two rooms with a wall between them in a window, and nodes on a line through the gap in it."""

import numpy as np

from lemtomap.areas.segmentation import AreaSegmenter
from lemtomap.topo.file.paging import PagedGraph
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.graph import Edge
from lemtomap.topo.local import NodePoseEstimate
from lemtomap.topo.segmentation import Neighbourhood
from lemtomap.types import EdgeType, GridView

STEP_M = 0.05


def window(*, gap_m=0.9, half_width_m=3.0, shut=False, person=False):
    """Free floor 12 m x 6 m within walls, parted by a wall at x = 0 with a gap in its middle."""
    cells = np.full((240, 240), -1, dtype=np.int8)
    half = round(half_width_m / STEP_M)
    cells[120 - half : 120 + half, 10:230] = 0
    for line in (np.s_[120 - half - 2 : 120 - half, 8:232], np.s_[120 + half : 120 + half + 2, 8:232]):
        cells[line] = 100
    cells[120 - half : 120 + half, 8:10] = cells[120 - half : 120 + half, 230:232] = 100
    opening = round(0.5 * gap_m / STEP_M)
    cells[120 - half : 120 - opening, 119:121] = 100
    cells[120 + opening : 120 + half, 119:121] = 100
    if shut:
        cells[120 - opening : 120 + opening, 119:121] = 100
    if person:
        cells[118:122, 118:122] = 100
    return view(cells)


def view(cells):
    cells.setflags(write=False)
    corner = -0.5 * STEP_M * len(cells)
    return GridView(0.0, cells, STEP_M, (corner, corner))


class Walk:
    """A robot that goes along nodes a metre apart, and finds areas on its way."""

    def __init__(self, path, xs=(-2.5, -1.5, -0.5, 0.5, 1.5, 2.5)):
        self.store = TopoStore.create(path, durable=False)
        self.graph = PagedGraph(self.store)
        self.segmenter = AreaSegmenter()
        self.segmenter.attach(self.graph)
        self.stamp_s = self.way_m = 0.0
        self.at = {}
        for x in xs:
            self.add(x)

    def add(self, x, y=0.0, to=None):
        """Make a node, joined to the one before or another."""
        node_id = self.graph.add_node(area_id=0).node_id
        before = to or (node_id - 1 if node_id - 1 in self.at else None)
        self.at[node_id] = np.array([x, y, 0.0])
        if before:
            self.join(before, node_id)
        return node_id

    def join(self, a, b, kind=EdgeType.NEAR_NEIGHBOUR, *, proven=True):
        time_s = 1.0 if proven else None
        return self.graph.add_edge(
            Edge(0, a, b, self.at[b] - self.at[a], np.eye(3) * 1e-3, kind, time_s=time_s)
        )

    def look(self, grid, x=-1.0, y=0.0, here=1):
        """One scan from a place, half a metre after the one before."""
        self.way_m += 0.5
        self.stamp_s += 1.0
        standings = {k: NodePoseEstimate(p, np.eye(3) * 1e-4, anchored=True) for k, p in self.at.items()}
        self.segmenter.update(
            Neighbourhood(here, np.array([x, y, 0.0]), self.way_m, self.stamp_s, grid, standings, 50, 0)
        )

    def looks(self, grid, times, x=-1.0):
        for _ in range(times):
            self.look(grid, x)

    def areas(self):
        return [self.graph.node(k).area_id for k in sorted(self.at)]
