"""One run of the robot, real or simulated: its folder, its core, and what becomes of both at the end."""

import contextlib
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from lemtomap.errors import BadSetting
from robot.build import build_core
from robot.config import RobotConfig, to_mapping
from robot.core import RobotCore
from robot.exchange import Ended, Level, MissionState, Note
from robot.parts import DEFAULT_LIMIT, parts_of
from robot.progress import Bar
from robot.run_files import RECORDINGS, RESULTS, RecordPlan, RunFiles

QUIET_S = 15.0  # of run time before nearly the same line is said again


@dataclass(frozen=True, slots=True)
class RunPlan:
    """What a run is told."""

    out: Path
    map_path: Path
    title: str
    seed: int
    slam: str
    config: RobotConfig
    live: bool = False
    replace: bool = False
    """True: an earlier run's results in the folder go."""
    keep_map: bool = False
    """True: except the map, which this run goes on with."""
    facts: Mapping[str, Any] = field(default_factory=dict)
    """For the summary."""
    record_limit: int = DEFAULT_LIMIT
    """Bytes of each of the two recordings; beyond, their oldest parts go."""


class Teller:
    """Lines for the user, and the bar under them."""

    def __init__(self, bar: Bar, duration_s: float) -> None:
        self._bar, self._duration_s = bar, duration_s
        self._said: dict[str, float] = {}

    def say(self, note: Note) -> None:
        """Say a line, unless nearly the same one was said a moment ago."""
        kind = f"{note.source} {re.sub(r'[0-9]+', '#', note.text)}"
        if note.level is Level.INFO and note.stamp_s < self._said.get(kind, -QUIET_S) + QUIET_S:
            return
        self._said[kind] = note.stamp_s
        self._bar.say(f"{note.stamp_s:7.1f} s  {note.source}: {note.text}")

    def look(self, now_s: float) -> None:
        """Move the bar."""
        self._bar.show(min(1.0, now_s / self._duration_s))


class Run:
    """Everything one run writes to. What was mapped is kept however it ends; a failed start leaves none."""

    def __init__(self, plan: RunPlan, teller: Teller) -> None:
        self.plan = plan
        self.summary: dict[str, Any] = {}
        self._teller = teller
        self._ended: Ended | None = None
        self._truth: Mapping[str, Any] = {}
        self._made: list[Path] = []

    def __enter__(self) -> Self:
        """Make the folder, the map and the recordings. Raises BadSetting, BadMap."""
        plan = self.plan
        if plan.out.exists() and not plan.out.is_dir():
            raise BadSetting(f"{plan.out}: is a file; --out needs a folder")
        self._made = [folder for folder in (plan.out, *plan.out.parents) if not folder.exists()]
        plan.out.mkdir(parents=True, exist_ok=True)
        if plan.replace:
            _clear(plan)
        self._new_map = not plan.map_path.exists()
        self.core: RobotCore = build_core(plan.config, plan.map_path, slam=plan.slam, seed=plan.seed)
        recorded = {**_settings(plan), "title": plan.title, "new_map": self._new_map}
        self.files = RunFiles(
            plan.out,
            plan.title,
            self.core,
            self._teller,
            RecordPlan(recorded, plan.record_limit),
            live=plan.live,
        )
        return self

    def end(self, ended: Ended, truth: Mapping[str, Any] | None = None) -> None:
        """Tell how the run ended; `truth` is what only a simulator knows."""
        self._ended, self._truth = ended, truth or {}

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        """Write the results, or take back the empty files of a run that never began."""
        if self.core.mapping.scans == 0 and error is not None:
            self._take_back()
            return
        ended = self._ended or Ended(0.0, MissionState.FAILED, str(error))
        plan = self.plan
        told = {**plan.facts, "result": ended.state.value, "result_text": ended.text, **self._truth}
        settings = _settings(plan)
        self.summary = self.files.finish(
            ended.now_s,
            plan.map_path,
            told,
            {"seed": plan.seed, "config": {"slam": plan.slam, **settings["config"]}},
            whole_drive=self._new_map,
        )

    def _take_back(self) -> None:
        """Remove what the start made."""
        self.files.close()
        self.core.close()
        if self._new_map:
            self.plan.map_path.unlink(missing_ok=True)
        for name in RESULTS:
            (self.plan.out / name).unlink(missing_ok=True)
        for folder in self._made:
            with contextlib.suppress(OSError):  # not empty: something of value stands there
                folder.rmdir()


def _settings(plan: RunPlan) -> dict[str, Any]:
    """Return what a replay needs to map the same scans in the same way."""
    return {"slam": plan.slam, "seed": plan.seed, "config": to_mapping(plan.config)}


def _clear(plan: RunPlan) -> None:
    """Remove an earlier run's results."""
    old_map = [] if plan.keep_map else [plan.map_path]
    parts = [part for name in RECORDINGS for part in parts_of(plan.out / name)]
    for path in (*old_map, *parts, *(plan.out / name for name in RESULTS)):
        for suffix in ("", "-wal", "-shm"):
            path.with_name(path.name + suffix).unlink(missing_ok=True)
