"""Looks over the shoulder of a lock-step run: figures for each simulated minute, closures against truth."""

import json
import sys
import time
from collections import deque
from dataclasses import asdict, dataclass
from pathlib import Path
from types import TracebackType
from typing import Self, TextIO

import numpy as np

from lemtomap.robot.core import RobotCore
from lemtomap.se2 import Pose, between
from lemtomap.sim.simulator import Simulator
from lemtomap.topo.file.rows import type_code
from lemtomap.types import EdgeType
from tools.bench.parts.measuring import resident_mb
from tools.bench.soak_parts.mission import ExploreThenGoals

SAMPLE_S = 60.0
LONGEST_S = 900.0  # a goal that takes longer than this, in a building of 130 m, is not being reached
LOOP = type_code(EdgeType.LOOP_CLOSING)
TRUTHS = 100  # steps of 20 ms: scans are older than the newest truth


@dataclass(frozen=True, slots=True)
class Sample:
    """One simulated minute."""

    stamp_s: float
    wall_s: float
    resident_mb: float
    mapping_cpu_s: float
    navigation_cpu_s: float
    base_cpu_s: float
    """CPU since the beginning, by thread clock."""
    nodes: int
    edges: int
    closures: int
    path_m: float
    contacts: int
    explored: bool
    reached: int
    failed: int
    lost_s: float


@dataclass(frozen=True, slots=True)
class Closure:
    """A loop-closing edge of the finished map beside the truth."""

    edge_id: int
    source_id: int
    target_id: int
    off_m: float
    off_rad: float
    sigmas: float
    """How far off by the covariance of the edge: a closure along a corridor says how little it knows."""


class Watcher:
    """Called after each step; writes samples.jsonl, errands.jsonl and at the end closures.json."""

    def __init__(self, simulator: Simulator, core: RobotCore, mission: ExploreThenGoals, out: Path) -> None:
        self._simulator, self._core, self._mission, self._out = simulator, core, mission, out
        self._samples: TextIO = (out / "samples.jsonl").open("w")
        self._errands: TextIO = (out / "errands.jsonl").open("w")
        self._truths: deque[tuple[float, Pose]] = deque(maxlen=TRUTHS)
        self._born: dict[int, Pose] = {}
        self._begun_s, self._next_s, self._lost_s, self._told = time.perf_counter(), SAMPLE_S, 0.0, 0

    def watch(self, now_s: float) -> None:
        """Take one step of the run."""
        self._truths.append((now_s, self._simulator.truth().T_world_base))
        view = self._core.exchange.map_view.get()
        if view is not None:
            self._lost_s += 0.02 * view.lost
            if view.associated_id not in self._born and view.associated_id > max(self._born, default=0):
                stamp = view.stamp_s
                self._born[view.associated_id] = min(self._truths, key=lambda one: abs(one[0] - stamp))[1]
        if now_s >= self._next_s:
            self._next_s += SAMPLE_S
            self._sample(now_s)

    def _sample(self, now_s: float) -> None:
        core, mission, truth = self._core, self._mission, self._simulator.truth()
        store, reached = core.mapping.mapper.topo.store, sum(one.reached for one in mission.errands)
        closures = next(store.query("SELECT count(*) FROM edge WHERE type = ?", (LOOP,)))[0]
        sample = Sample(
            stamp_s=round(now_s, 3),
            wall_s=round(time.perf_counter() - self._begun_s, 1),
            resident_mb=round(resident_mb(), 3),
            mapping_cpu_s=round(core.efforts.mapping.cpu_s, 4),
            navigation_cpu_s=round(core.efforts.navigation.cpu_s, 4),
            base_cpu_s=round(core.efforts.base.cpu_s, 4),
            nodes=store.count("node"),
            edges=store.count("edge"),
            closures=closures,
            path_m=round(truth.path_m, 2),
            contacts=truth.contact_count,
            explored=mission.explored_s is not None,
            reached=reached,
            failed=len(mission.errands) - reached,
            lost_s=round(self._lost_s, 2),
        )
        self._samples.write(json.dumps(asdict(sample)) + "\n")
        self._samples.flush()
        for errand in mission.errands[self._told :]:
            self._errands.write(json.dumps(asdict(errand)) + "\n")
        self._errands.flush()
        self._told = len(mission.errands)
        if round(now_s / SAMPLE_S) % 5 == 0:
            doing = f"{sample.reached} goals reached, {sample.failed} not" if sample.explored else "exploring"
            print(
                f"{now_s / 60:5.0f} min simulated, {now_s / sample.wall_s:4.1f}x real time: "
                f"{sample.resident_mb:.1f} MB, {sample.nodes} nodes, {sample.closures} closures, {doing}",
                file=sys.stderr,
                flush=True,
            )

    def closures(self) -> list[Closure]:
        """Return every loop-closing edge that the map holds now, beside the truth."""
        found = []
        for edge in self._core.mapping.mapper.topo.store.edges():
            if edge.type is EdgeType.LOOP_CLOSING and {edge.source_id, edge.target_id} <= self._born.keys():
                truth = between(self._born[edge.source_id], self._born[edge.target_id])
                off = between(truth, edge.T_source_target)
                way = float(np.hypot(off[0], off[1]))
                sigmas = float(np.sqrt(off @ np.linalg.solve(edge.covariance, off)))
                ends = edge.edge_id, edge.source_id, edge.target_id
                found.append(Closure(*ends, way, float(off[2]), sigmas))
        return found

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        under_way = self._mission.under_way
        if under_way is not None and self._truths[-1][0] - under_way.begun_s > LONGEST_S:
            under_way.ended_s, under_way.text = self._truths[-1][0], "neither reached nor given up"
            self._errands.write(json.dumps(asdict(under_way)) + "\n")
        told = [asdict(closure) for closure in self.closures()]
        (self._out / "closures.json").write_text(json.dumps(told))
        self._samples.close()
        self._errands.close()
