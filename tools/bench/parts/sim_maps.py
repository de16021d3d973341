"""Mapping a simulated building and judging by truth what the map says: closures, revisits, poses, places."""

import json
import math
import time
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy import ndimage

from lemtomap.displacement import RIGHT_M, RIGHT_RAD
from lemtomap.grid import SlamConfig, WindowMatcher
from lemtomap.pipeline import Mapper
from lemtomap.robot.exchange import Exchange
from lemtomap.robot.mapping import MappingStep
from lemtomap.se2 import (
    Pose,
    between,
    compose,
    transform,
)
from lemtomap.sim.world import World
from lemtomap.topo.config import TopoConfig
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.loops import LoopRecogniser
from lemtomap.topo.mapper import TopoMapper
from lemtomap.topo.place import decode_place
from lemtomap.topo.whole.pruning import prune
from lemtomap.types import MapView
from tools.bench.parts.sim_robot import Seen
from tools.truth.revisits import OLD_M, Revisits
from tools.truth.walls import wall_between

WRONG_M, WRONG_RAD = 0.5, math.radians(10.0)  # a closure beyond either joins the wrong places
BINS = 20
CHECK_EVERY_M = 0.5
NEAR_M, APART_M = 1.0, 8.0  # a node beside the robot; how far along the edges the map may believe it


@dataclass
class Score:
    """What a drive showed."""

    scans: int = 0
    path_m: float = 0.0
    nodes: int = 0
    pruned: int = 0
    """Nodes that went before the drive began."""
    closures: int = 0
    wrong: int = 0
    worst_m: float = 0.0
    closed: int = 0
    """Revisits that the graph knew of soon enough, ..."""
    missed: int = 0
    """... those that it did not, ..."""
    brief: int = 0
    """... and those left again before either (`tools.truth.revisits`)."""
    cpu_s: float = 0.0
    poses: list[int] = field(default_factory=lambda: [0] * BINS)
    """Poses by their quality, ..."""
    right: list[int] = field(default_factory=lambda: [0] * BINS)
    """... and those of them within 10 cm and 2 degrees."""


class JudgedMap:
    """One map file, fed by a simulated robot; knows where each node truly is."""

    def __init__(self, path: Path, world: World) -> None:
        self._born_path = path.with_suffix(".born.json")
        make = TopoStore.open if path.exists() else TopoStore.create
        store = make(path, durable=False)
        self.pruned = prune(store)
        self.recogniser = LoopRecogniser()
        self.topo = TopoMapper(TopoConfig(), store, recogniser=self.recogniser)
        self.born: dict[int, Pose] = load_born(path)
        self.exchange = Exchange()
        mapper = Mapper(lambda: WindowMatcher(SlamConfig()), self.topo)
        self.step = MappingStep(mapper, self.exchange)
        self.score = Score()
        self._world = world
        self._at_birth_m: dict[int, float] = dict.fromkeys(self.born, -math.inf)
        self._before: Pose | None = None
        self._checked_m = 0.0
        self._revisits = Revisits()

    @property
    def view(self) -> MapView:
        """What the map says now."""
        view = self.exchange.map_view.get()
        assert view is not None  # noqa: S101
        return view

    def feed(self, scans: Iterable[Seen]) -> None:
        """Map a stretch."""
        for seen in scans:
            self.take(seen)

    def take(self, seen: Seen) -> None:
        """Map one scan and judge."""
        score, begun_s = self.score, time.thread_time()
        self.step.step(seen.timed)
        score.cpu_s += time.thread_time() - begun_s
        self.exchange.notes.drain()
        score.scans += 1
        if self._before is not None:
            step_m = float(np.hypot(*(seen.T_world_base - self._before)[:2]))
            score.path_m += step_m if step_m < NEAR_M else 0.0
        self._before = seen.T_world_base
        if self.exchange.map_view.get() is None or seen.timed.lifted:
            return
        for node_id in self.view.T_grid_node:
            if node_id not in self.born:
                self.born[node_id] = compose(seen.T_world_base, self._from_base(node_id))
                self._at_birth_m[node_id] = score.path_m
        self._judge_pose(seen.T_world_base)
        if score.path_m - self._checked_m >= CHECK_EVERY_M:
            self._checked_m = score.path_m
            self._judge_revisit(seen.T_world_base)

    def error(self, T_world_base: Pose) -> tuple[float, float]:
        """Return how far the pose relative to the associated node is off, metres and radians."""
        node_id = self.view.associated_id
        off = between(compose(T_world_base, self._from_base(node_id)), self.born[node_id])
        return float(np.hypot(off[0], off[1])), abs(float(off[2]))

    def _from_base(self, node_id: int) -> Pose:
        return between(self.view.T_grid_base, self.view.T_grid_node[node_id])

    def _judge_pose(self, T_world_base: Pose) -> None:
        off_m, off_rad = self.error(T_world_base)
        at = min(BINS - 1, int(self.view.quality * BINS))
        self.score.poses[at] += 1
        self.score.right[at] += off_m <= RIGHT_M and off_rad <= RIGHT_RAD

    def _judge_revisit(self, T_world_base: Pose) -> None:
        """Tell what ground this truly is, and whether the graph knows."""
        ids = list(self._at_birth_m)
        places = np.array([self.born[i][:2] for i in ids])
        near = np.flatnonzero(np.hypot(*(places - T_world_base[:2]).T) <= NEAR_M)
        seen = [ids[k] for k in near if not wall_between(self._world.raster, T_world_base, places[k])]
        way_m = self.score.path_m
        ages_m = {i: way_m - self._at_birth_m[i] for i in seen}
        known = self.topo.graph.reach(self.view.associated_id, APART_M)
        old = [i for i, age_m in ages_m.items() if age_m >= OLD_M]
        self._revisits.look(
            way_m, max(ages_m.values(), default=None), known=any(node_id in known for node_id in old)
        )

    def close(self) -> Score:
        """Write the map and the truth beside it; return the score."""
        for closure in self.recogniser.closures:
            true = between(self.born[closure.source_id], self.born[closure.target_id])
            off = between(true, closure.T_source_target)
            off_m = float(np.hypot(off[0], off[1]))
            self.score.worst_m = max(self.score.worst_m, off_m)
            self.score.wrong += off_m > WRONG_M or abs(float(off[2])) > WRONG_RAD
        self.score.closed, self.score.missed = self._revisits.closed, self._revisits.missed
        self.score.brief = self._revisits.brief
        self.score.closures = len(self.recogniser.closures)
        self.score.pruned = len(self.pruned)
        self.score.nodes = self.topo.store.count("node")
        self.step.close()
        self._born_path.write_text(json.dumps({str(i): T.tolist() for i, T in self.born.items()}))
        return self.score


def load_born(path: Path) -> dict[int, Pose]:
    """Return the true places of a judged map's nodes; empty when there is no such map."""
    born = path.with_suffix(".born.json")
    if not born.exists():
        return {}
    return {int(i): np.array(T) for i, T in json.loads(born.read_text()).items()}


def still_true(path: Path, world: World, within_m: float = 0.25) -> float:
    """Return the share of a map's stored obstacle points that stand in a building as it is now.

    A point counts up to `within_m` from an obstacle: poses of nodes are a few centimetres off.
    """
    away = ndimage.distance_transform_edt(~world.raster.occupied) * world.raster.resolution_m
    born, hits, count = load_born(path), 0, 0
    with TopoStore.open(path, durable=False) as store:
        for node_id, place in store.places():
            points = decode_place(place.boundary).points.astype(np.float64)
            if node_id not in born or len(points) == 0:
                continue
            x0, y0 = world.raster.origin_m
            cells = np.floor((transform(born[node_id], points) - [x0, y0]) / world.raster.resolution_m)
            cols, rows = cells.astype(int).T
            inside = (rows >= 0) & (cols >= 0) & (rows < away.shape[0]) & (cols < away.shape[1])
            hits += int((away[rows[inside], cols[inside]] <= within_m).sum())
            count += len(points)
    return hits / max(1, count)
