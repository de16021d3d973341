"""Atria, triangles and halls of 20 to 40 m that a robot drives round: every wall of them is passed twice.

Drawn by rules and a seed: walls with doors in niches, pillars, benches and counters, nothing else. The drive
follows the walls a good third further than once round, so that each start comes back to old ground where
only one wall, a corner or a pillar may be in sight.
"""

import math
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lemtomap.grid import SlamConfig, WindowMatcher
from lemtomap.pipeline import Mapper
from lemtomap.se2 import Pose, between, compose
from lemtomap.topo.config import TopoConfig
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.loops import LoopRecogniser
from lemtomap.topo.mapper import TopoMapper
from lemtomap.types import Odometry
from tools.bench.slam_parts import sparse
from tools.truth.revisits import OLD_M, Revisits

KINDS = ("triangle", "atrium", "hall")
STARTS = 4
AGAIN = 0.35  # share of the round driven a second time
LOOK_EVERY_M, NEAR_M, APART_M = 0.5, 1.5, 8.0
WRONG_M, WRONG_RAD = 0.5, math.radians(10.0)
Wall = tuple[float, float, float, float]
Corners = NDArray[np.float64]
"""float64 (N, 2), metres, counter-clockwise."""


@dataclass
class Driven:
    """What one drive round showed."""

    closures: int = 0
    wrong: int = 0
    worst_m: float = 0.0
    revisits: Revisits = field(default_factory=Revisits)


def outline(kind: str, rng: np.random.Generator) -> Corners:
    """Return the corners of a floor."""
    long_m, wide_m = float(rng.uniform(20.0, 40.0)), float(rng.uniform(20.0, 40.0))
    if kind == "triangle":
        apex = rng.uniform(0.2, 0.8) * long_m
        return np.array([[0.0, 0.0], [long_m, 0.0], [apex, max(14.0, 0.8 * wide_m)]])
    if kind == "hall":
        wide_m = float(rng.uniform(12.0, 18.0))
    return np.array([[0.0, 0.0], [long_m, 0.0], [long_m, wide_m], [0.0, wide_m]])


def inset(corners: Corners, by_m: float) -> Corners:
    """Return the corners of the same outline with every side moved inwards."""
    before, after = np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0)
    a, b = _unit(corners - before), _unit(after - corners)
    cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return np.asarray(corners + by_m * (b - a) / cross[:, None])


def furnished(corners: Corners, kind: str, rng: np.random.Generator) -> sparse.Scene:
    """Return the walls of a floor: doors in niches, pillars, and what stands along the walls."""
    walls: list[Wall] = []
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        walls += _side(start, end, rng)
    if kind == "atrium":  # the court in the middle has a parapet
        well = inset(corners, float(rng.uniform(4.0, 6.0)))
        walls += [(*a, *b) for a, b in zip(well, np.roll(well, -1, axis=0), strict=True)]
    if kind == "hall":
        for x in np.arange(6.0, corners[:, 0].max() - 5.0, float(rng.uniform(5.0, 8.0))):
            for y in (corners[:, 1].max() / 3.0, corners[:, 1].max() / 1.5):
                walls += sparse.box(x, y, x + 0.5, y + 0.5)
    none = np.empty((0, 4))
    return sparse.Scene(np.array(walls), none, none, ())


def _side(start: NDArray[np.float64], end: NDArray[np.float64], rng: np.random.Generator) -> list[Wall]:
    """Return one side: a wall with niches that doors stand back in, and benches before it."""
    along = _unit(end - start)
    out = np.array([along[1], -along[0]])
    length_m = float(np.hypot(*(end - start)))
    line, at_m = [start], float(rng.uniform(1.5, 5.0))
    walls: list[Wall] = []
    while at_m < length_m - 3.0:
        wide_m, deep_m = float(rng.uniform(0.9, 1.8)), float(rng.uniform(0.1, 0.4))
        if rng.random() < 0.3:  # a bench or a counter
            deep_m = -float(rng.uniform(0.3, 0.6))
        a, b = start + at_m * along, start + (at_m + wide_m) * along
        line += [a, a + deep_m * out, b + deep_m * out, b]
        at_m += wide_m + float(rng.uniform(1.5, 8.0))
    line.append(end)
    walls += [(*p, *q) for p, q in pairwise(line)]
    return walls


def round_trip(corners: Corners, start: int, by_m: float) -> tuple[tuple[float, float], ...]:
    """Return the corners of a drive along the walls from one of STARTS on, once round and AGAIN."""
    ring = inset(corners, by_m)
    ends = np.roll(ring, -1, axis=0)
    lengths = np.hypot(*(ends - ring).T)
    begin_m = (start + 0.3) / STARTS * lengths.sum()
    marks = np.concatenate([[0.0], np.cumsum(np.tile(lengths, 3))])
    end_m = begin_m + (1.0 + AGAIN) * lengths.sum()
    stops = [begin_m, *[m for m in marks if begin_m < m < end_m], end_m]
    points = []
    for stop in stops:
        side = int(np.searchsorted(marks, stop, side="right")) - 1
        share = (stop - marks[side]) / lengths[side % len(ring)]
        points.append(tuple((1 - share) * ring[side % len(ring)] + share * ends[side % len(ring)]))
    return tuple((float(x), float(y)) for x, y in points)


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


class Tracked:
    """The map of a drive through one scene, and where each of its nodes truly is."""

    def __init__(self, path: Path) -> None:
        self.recogniser = LoopRecogniser()
        self.topo = TopoMapper(
            TopoConfig(), TopoStore.create(path, durable=False), recogniser=self.recogniser
        )
        self.mapper = Mapper(lambda: WindowMatcher(SlamConfig()), self.topo)
        self.born: dict[int, Pose] = {}
        self.result = Driven()
        self._born_at_m: dict[int, float] = {}
        self._way_m = self._looked_m = 0.0

    def drive(self, scene: sparse.Scene, wheels: sparse.Wheels, rng: np.random.Generator) -> Driven:
        """Drive along the scene's corners; return what it showed."""
        truths = sparse.path(scene.corners)
        scales, T_odom_base = wheels.scales(rng), truths[0]
        for index, here in enumerate(truths):
            if index:
                step = between(truths[index - 1], here)
                T_odom_base = compose(T_odom_base, wheels.told(step, scales, rng))
                self._way_m += float(np.hypot(step[0], step[1]))
            stamp_s = sparse.PERIOD_S * index
            self.mapper.update(sparse.scan(here, scene, rng, stamp_s), Odometry(stamp_s, T_odom_base))
            self._look(here)
        self._judge_closures()
        self.mapper.close()
        return self.result

    def _look(self, here: Pose) -> None:
        view = self.mapper.view()
        for node_id, T_grid_node in view.T_grid_node.items():
            if node_id not in self.born:
                self.born[node_id] = compose(here, between(view.T_grid_base, T_grid_node))
                self._born_at_m[node_id] = self._way_m
        if self._way_m - self._looked_m < LOOK_EVERY_M:
            return
        self._looked_m = self._way_m
        gaps_m = {i: float(np.hypot(*(T[:2] - here[:2]))) for i, T in self.born.items()}
        ages_m = {i: self._way_m - self._born_at_m[i] for i, gap_m in gaps_m.items() if gap_m <= NEAR_M}
        reached = self.topo.graph.reach(view.associated_id, APART_M)
        known = any(age_m >= OLD_M and i in reached for i, age_m in ages_m.items())
        self.result.revisits.look(self._way_m, max(ages_m.values(), default=None), known=known)

    def _judge_closures(self) -> None:
        for closure in self.recogniser.closures:
            true = between(self.born[closure.source_id], self.born[closure.target_id])
            off = between(true, closure.T_source_target)
            off_m = float(np.hypot(off[0], off[1]))
            self.result.closures += 1
            self.result.wrong += off_m > WRONG_M or abs(float(off[2])) > WRONG_RAD
            self.result.worst_m = max(self.result.worst_m, off_m)


def drive(seed: int, start: int, folder: Path, wheels: str = "Kobuki") -> Driven:
    """Drive round one floor from one start."""
    kind = KINDS[seed % len(KINDS)]
    rng = np.random.default_rng([seed, 7])
    corners = outline(kind, rng)
    scene = furnished(corners, kind, rng)
    by_m = 2.0 if kind == "atrium" else float(rng.uniform(1.5, 2.5))
    scene = replace(scene, corners=round_trip(corners, start, by_m))
    tracked = Tracked(folder / f"{kind}-{seed}-{start}.lemto")
    return tracked.drive(scene, sparse.WHEELS[wheels], np.random.default_rng([seed, start]))
