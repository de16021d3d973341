"""One run of the robot, real or simulated: its folder, its core, and what becomes of both at the end."""

import math
import re
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from lemtomap.robot.build import build_core
from lemtomap.robot.config import RobotConfig
from lemtomap.robot.core import RobotCore
from lemtomap.robot.devices.parts import DEFAULT_LIMIT, parts_of
from lemtomap.robot.devices.recording import HOKUYO, KOBUKI
from lemtomap.robot.exchange import (
    Ended,
    MissionState,
    Note,
    NoteLevel,
)
from lemtomap.robot.output.progress import Bar
from lemtomap.robot.runs.folder import RunFolder, Space
from lemtomap.robot.runs.interrupts import on_interrupt
from lemtomap.robot.runs.run_files import (
    RECORDINGS,
    RESULTS,
    RecordPlan,
    RunFiles,
)
from lemtomap.robot.settings.tree import to_mapping

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
        if note.level is NoteLevel.INFO and note.stamp_s < self._said.get(kind, -QUIET_S) + QUIET_S:
            return
        self._said[kind] = note.stamp_s
        self._bar.say(f"{note.stamp_s:7.1f} s  {note.source}: {note.text}")

    def look(self, now_s: float) -> None:
        """Move the bar."""
        endless = math.isinf(self._duration_s)
        self._bar.show(None if endless else min(1.0, now_s / self._duration_s))


class Stopped(Exception):
    """The run ends before its mission: somebody interrupted it, or a fault leaves no choice."""

    def __init__(self, *, interrupted: bool = False, fault: str = "") -> None:
        super().__init__(fault or "interrupted")
        self.interrupted, self.fault = interrupted, fault


class Run:
    """Everything one run writes to. What was mapped is kept however it ends; a failed start leaves none."""

    def __init__(self, plan: RunPlan, teller: Teller) -> None:
        self.plan = plan
        self.summary: dict[str, Any] = {}
        self._teller = teller
        self._ended: Ended | None = None
        self._truth: Mapping[str, Any] = {}
        self._asked = threading.Event()

    def __enter__(self) -> Self:
        """Make the folder, the map and the recordings. Raises BadSetting, BadMap; then nothing is left."""
        plan = self.plan
        self._folder = RunFolder(plan.out)
        self._spaces: list[Space] = []
        self._new_map = True
        try:
            self._keep_room()
            if plan.replace:
                _clear(plan)
            self._new_map = not plan.map_path.exists()
            self.core: RobotCore = build_core(plan.config, plan.map_path, slam=plan.slam, seed=plan.seed)
        except BaseException:
            self._folder.take_back()
            raise
        recorded = {**_settings(plan), "title": plan.title, "new_map": self._new_map}
        try:
            self.files = RunFiles(
                self._folder,
                self._spaces,
                self.core,
                self._teller,
                RecordPlan(plan.title, recorded, plan.record_limit, plan.live, plan.config.viewer),
            )
        except BaseException:
            self.core.close()
            self._remove_files()
            raise
        return self

    def _keep_room(self) -> None:
        """Keep room for the results on the disk of the folder, and on that of the map."""
        folders = [self.plan.out]
        beside = self.plan.map_path.absolute().parent
        if beside.is_dir() and beside.stat().st_dev != self.plan.out.stat().st_dev:
            folders.append(beside)
        self._spaces.extend(Space(folder) for folder in folders)

    @contextmanager
    def until_asked(self) -> Iterator[None]:
        """Let Ctrl-C, SIGTERM and SIGHUP end the run where `check` is called, between two steps."""
        with on_interrupt(self._asked.set):
            yield

    def check(self) -> None:
        """Raise Stopped when the run shall end now."""
        if self._asked.is_set():
            raise Stopped(interrupted=True)
        if self.files.over:
            raise Stopped(fault=self.files.over)

    def end(self, ended: Ended, truth: Mapping[str, Any] | None = None) -> None:
        """Tell how the run ended; `truth` is what only a simulator knows."""
        self._ended, self._truth = ended, truth or {}

    def stopped(self, now_s: float, stopped: Stopped, truth: Mapping[str, Any] | None = None) -> None:
        """Tell that the run was ended before its mission was."""
        status = self.core.exchange.mission.get()
        state, text = (status.state, status.text) if status else (MissionState.WAITING, "no map yet")
        if stopped.fault:
            state, text = MissionState.FAILED, stopped.fault
        self.end(Ended(now_s, state, text, stopped.interrupted, stopped.fault), truth)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        """Write the results, or take back the empty files of a run that never began.

        Nothing interrupts it: each of its steps has a time of its own.
        """
        with on_interrupt(_wait):
            if self.core.mapping.scans == 0 and error is not None:
                self._take_back()
            else:
                self._finish(error)

    def _finish(self, error: BaseException | None) -> None:
        plan, now_s = self.plan, self.files.now_s
        ended = self._ended or Ended(now_s, MissionState.FAILED, str(error) or type(error).__name__)
        faults = [fault for fault in (ended.fault, self._missing()) if fault]
        if faults and not ended.interrupted:
            ended = replace(ended, state=MissionState.FAILED, text=faults[0])
        told = {**plan.facts, "result": ended.state.value, "result_text": ended.text, **self._truth}
        told |= {"interrupted": ended.interrupted, "faults": faults}
        self.summary = self.files.finish(ended.now_s, told, _settings(plan), whole_drive=self._new_map)

    def _missing(self) -> str:
        """Return which device never measured anything, empty when both did."""
        silent = {KOBUKI: "the base{} sent no packets", HOKUYO: "the laser{} sent no scans"}
        lines = []
        for device, line in silent.items():
            if device not in self.core.base.heard:
                port = self.plan.facts.get(device)
                lines.append(line.format(f" on {port}" if port else ""))
        return ", ".join(lines)

    def _take_back(self) -> None:
        """Remove what the start made."""
        self.files.close()
        self.core.close()
        self._remove_files()

    def _remove_files(self) -> None:
        for space in self._spaces:
            space.release()
        if self._new_map:
            self.plan.map_path.unlink(missing_ok=True)
        for name in RESULTS:
            (self.plan.out / name).unlink(missing_ok=True)
        self._folder.take_back()


def _wait() -> None:
    """Do nothing about an interrupt: the end is under way and takes a bounded time."""


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
