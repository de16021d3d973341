"""One drive through a plan: what the robot came to believe, and where it truly was meanwhile."""

import math
import shutil
import sqlite3
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from lemtomap import se2
from lemtomap.areas.book import AreaBook
from lemtomap.robot.build import build_core
from lemtomap.robot.config import RobotConfig
from lemtomap.robot.missions.missions import parse_mission
from lemtomap.se2 import Pose
from lemtomap.sim.simulator import Simulator
from lemtomap.sim.world import World
from tools.bench.nav_parts.lead import Rig
from tools.truth.floor_seen import Mask, see_scan

LOOK_EVERY_S = 0.4
AWAY_M = 5.0
WARM_UP = 50  # scans whose cost is that of compiling
WITHOUT_AREAS = (
    "DELETE FROM door_edge",
    "DELETE FROM door",
    "DELETE FROM area",
    "UPDATE node SET area = 0",
)


@dataclass(slots=True)
class Step:
    """One look at the robot."""

    T_world_base: Pose
    path_m: float
    area: int
    """Area of the node where it believes to be; 0: none."""


@dataclass(slots=True)
class Drive:
    """What came of a drive."""

    T_world_node: dict[int, Pose]
    """True pose of each node at its birth."""
    area_of: dict[int, int]
    doors: list[tuple[float, float, float, int]]
    """(x m, y m, width m, ID) of each door in the true frame of its node."""
    steps: list[Step]
    seen: Mask
    state: str
    relabelled: int
    """Labels of nodes that changed while the robot was 5 m away, merges apart."""
    second_changed: int | None
    """Nodes with another label after the same way once more; None: not driven."""
    cost_ms: float
    """CPU of the area step a scan."""
    growth: float
    """What doors and areas add to the map file, as a share."""


@dataclass(slots=True)
class Witness:
    """Looks on, by the truth."""

    rig: Rig
    seen: Mask
    steps: list[Step] = field(default_factory=list)
    relabelled: int = 0
    _areas: dict[int, int] = field(default_factory=dict)
    _next_s: float = 0.0

    @property
    def book(self) -> AreaBook:
        """The map's doors and areas."""
        return AreaBook(self.rig.core.mapping.mapper.topo.store)

    def __call__(self, now_s: float) -> None:
        """Look now and then."""
        view, scan = self.rig.core.exchange.map_view.get(), self.rig.simulator.last_scan
        if now_s < self._next_s or view is None or scan is None:
            return
        self._next_s = now_s + LOOK_EVERY_S
        truth = self.rig.simulator.truth()
        see_scan(self.seen, self.rig.simulator.world.raster, truth.T_world_base, scan.ranges_mm)
        area = self.book.area_of(view.associated_id)
        self.steps.append(Step(truth.T_world_base.copy(), truth.path_m, area))
        self._note_labels(truth.T_world_base)

    def labels(self) -> dict[int, int]:
        """Return the area of each node."""
        return dict(self.rig.core.mapping.mapper.topo.store.query("SELECT id, area FROM node"))

    def _note_labels(self, T_world_base: Pose) -> None:
        now = self.labels()
        for node_id, area in now.items():
            before, at = self._areas.get(node_id, 0), self.rig.T_world_node.get(node_id)
            if before in (0, area) or at is None or math.dist(at[:2], T_world_base[:2]) < AWAY_M:
                continue
            taken_in = self.book.area(before)
            self.relabelled += taken_in is None or taken_in.area_id != area
        self._areas = now


def drive(world: World, seed: int, duration_s: float, *, twice: bool = False) -> Drive:
    """Explore a world with all noise, in lock-step; then drive the same way once more if asked to."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map.lemto"
        rig = Rig(Simulator(world, seed=seed), build_core(RobotConfig(), path, durable=False, seed=seed))
        try:
            spent = _timed_areas(rig)
            witness = Witness(rig, np.zeros(world.raster.free.shape, dtype=np.bool_))
            ended = rig.run(parse_mission("explore"), duration_s, witness)
            changed = _second_tour(rig, witness) if twice else None
            labels, doors = witness.labels(), _doors(witness)
        finally:
            rig.close()
        growth = _growth(path)
    state = f"{ended.state}: {ended.text}"
    cost_ms = 1e3 * float(np.mean(spent[WARM_UP:])) if len(spent) > WARM_UP else 0.0
    return Drive(
        rig.T_world_node, labels, doors, witness.steps, witness.seen, state, witness.relabelled, changed,
        cost_ms, growth,
    )  # fmt: skip


def _second_tour(rig: Rig, witness: Witness) -> int:
    before = witness.labels()
    rig.lead(np.array([step.T_world_base[:2] for step in witness.steps]))
    after = witness.labels()
    return sum(after.get(node_id) != area for node_id, area in before.items())


def _doors(witness: Witness) -> list[tuple[float, float, float, int]]:
    found = []
    for door in witness.book.doors():
        T_world_node = witness.rig.T_world_node.get(door.node)
        if T_world_node is not None:
            x, y = se2.transform(T_world_node, np.array([[door.x_m, door.y_m]]))[0]
            found.append((float(x), float(y), door.width_m, door.id))
    return found


def _timed_areas(rig: Rig) -> list[float]:
    """Note the CPU seconds of each call of the area step."""
    areas: Any = rig.core.mapping.mapper.topo._areas  # noqa: SLF001 - only a bench asks what a part costs
    spent: list[float] = []
    if areas is None:
        return spent
    update: Callable[..., Any] = areas.update

    def timed(*arguments: Any) -> Any:
        begin = time.thread_time()
        result = update(*arguments)
        spent.append(time.thread_time() - begin)
        return result

    areas.update = timed
    return spent


def _growth(path: Path) -> float:
    """Return what doors and areas add to a map file, both vacuumed."""
    bare = path.with_suffix(".bare")
    shutil.copy(path, bare)
    for file, statements in ((path, ()), (bare, WITHOUT_AREAS)):
        with sqlite3.connect(file, isolation_level=None) as connection:
            for statement in statements:
                connection.execute(statement)
            connection.execute("VACUUM")
        connection.close()
    return path.stat().st_size / bare.stat().st_size - 1.0
