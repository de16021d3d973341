"""All of chapter 5: what has to be run, piece by piece, and the report of it."""

import json
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lemtomap.robot.output.files import versions
from lemtomap.sim import worlds
from tools.bench.thesis_parts import published, tables
from tools.bench.thesis_parts.bare import bare_bytes
from tools.bench.thesis_parts.chain import (
    BASELINE,
    OURS,
    OURS_5,
    SYSTEMS,
    System,
    map_drive,
)
from tools.bench.thesis_parts.curves import draw_parts, draw_totals
from tools.bench.thesis_parts.drives import Drive, local_and_whole_error_m, wrong_closures
from tools.bench.thesis_parts.maps import draw_maps
from tools.bench.thesis_parts.navigation import Task, draw_legs, means
from tools.bench.thesis_parts.page import Picture, Section, write_report
from tools.bench.thesis_parts.pieces import Piece, Pieces
from tools.bench.thesis_parts.readings import SystemReadings

SMALL_S = 180.0  # section 5-2-1: about 3 minutes
FIGURES = {"small": ("5-3", "5-4", "5-5", "5-9"), "large": ("5-6", "5-7", "5-8", "5-10 and 5-11")}
METHOD = """The same recorded scans and odometry go to each system. Each subsystem is a process of its own;
its CPU time is that of its thread at work on a scan, without carrying data between processes. Memory is
resident memory after free heap was given back (malloc_trim), less what the same process held before its
first scan (interpreter, libraries, compiled kernels): that share is told apart in the tables. A first
stretch of the drive is mapped and thrown away before, to compile and to load. Metric navigation keeps its
costmap at 5 Hz around the robot in both systems; the baseline's, like move_base's, also covers the whole
grid whenever GMapping publishes it (every 5 s). Topological mapping and navigation have no counterpart in
the baseline."""
MAPS_CAPTION = """the maps over the true walls (pale red). LEMTOMap: nodes, odometry edges (blue),
near-neighbour edges (pale), loop closures (red), and the walls that its localisation data hold"""


@dataclass(frozen=True, slots=True)
class Plan:
    """How much is run, and where it goes."""

    small: str
    large: str
    out: Path
    repetitions: int = 3
    large_s: float = 660.0  # section 5-2-1: about 11 minutes
    tasks: Sequence[str] = ("small", "large")
    jobs: int = 2


def revision() -> str | None:
    """Return which version of the program this is, as git names it; None without git."""
    git = shutil.which("git")
    if git is None:
        return None
    here = str(Path(__file__).parent)
    told = subprocess.run(  # noqa: S603 - git itself
        [git, "-C", here, "rev-parse", "HEAD"], check=False, capture_output=True, text=True
    )
    return told.stdout.strip() or None


class Experiment:
    """Runs what is not done yet, then reports."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.drives = [Drive("small", plan.small, SMALL_S), Drive("large", plan.large, plan.large_s)]
        self.tasks = [Task(name, plan.small if name == "small" else plan.large) for name in plan.tasks]
        self._systems: Sequence[System] = SYSTEMS

    def run(self, *, fresh: bool = False) -> None:
        """Do every piece of work. Raises BadWorld before any of it when a world is unknown."""
        for name in {self.plan.small, self.plan.large}:
            worlds.load(name)
        if fresh and self.plan.out.exists():
            shutil.rmtree(self.plan.out)
        self.pieces = Pieces(self.plan.out / "pieces")
        self.pieces.run([self._recording(drive) for drive in self.drives], self.plan.jobs)
        self.pieces.run([self._compiling(system) for system in self._systems], 1)
        self.pieces.run(self._runs(), self.plan.jobs)

    def _recording(self, drive: Drive) -> Piece:
        def work() -> dict[str, Any]:
            return {"log": drive.log(self.plan.out).name}

        return Piece(f"recording-{drive.key}", work)

    def _compiling(self, system: System) -> Piece:
        """Return a short run that fills the kernels' cache: a process that compiles keeps more memory."""

        def work() -> dict[str, Any]:
            return map_drive(self.drives[0].log(self.plan.out), system, 0, self.plan.out / "compiling", 1.0)

        return Piece(f"compiling-{system.key}", work)

    def _runs(self) -> list[Piece]:
        """Return the longest first; the repetitions of the systems take turns, so that they meet the same
        disturbances.
        """
        pieces = [self._navigation(task) for task in reversed(self.tasks)]
        for seed in range(self.plan.repetitions):
            for drive in reversed(self.drives):
                pieces += [self._mapping(drive, system, seed) for system in reversed(self._systems)]
        return pieces

    def _folder(self, drive: Drive, system: System, seed: int) -> Path:
        return self.plan.out / f"{drive.key}-{system.key}-{seed}"

    def _mapping(self, drive: Drive, system: System, seed: int) -> Piece:
        folder = self._folder(drive, system, seed)

        def work() -> dict[str, Any]:
            log = drive.log(self.plan.out)
            parts = map_drive(log, system, seed, folder)
            local_m, whole_m = local_and_whole_error_m(log, np.load(folder / "track.npy"))
            map_bytes = next(told["map_bytes"] for told in parts.values() if "map_bytes" in told)
            wrong = wrong_closures(log, folder / "picture.npz") if system is not BASELINE else 0
            told = {"parts": parts, "map_bytes": map_bytes, "local_m": local_m, "whole_m": whole_m}
            return told | {"wrong_closures": wrong}

        return Piece(folder.name, work)

    def _navigation(self, task: Task) -> Piece:
        key = Drive(task.name, task.world, task.metres).key
        return Piece(f"navigation-{key}", lambda: task.run(self.plan.out / f"navigation-{key}"))

    # -- the report -----------------------------------------------------------------------------------------

    def readings(self, drive: Drive) -> dict[str, SystemReadings]:
        """Return what each system took on a drive."""
        return {
            system.key: SystemReadings.of(
                [
                    self.pieces.told(self._folder(drive, system, seed).name)
                    for seed in range(self.plan.repetitions)
                ]
            )
            for system in self._systems
        }

    def _bare_kb(self, drive: Drive) -> float:
        """Return the mean size of our maps of a drive without localisation data, kB."""
        folders = [self._folder(drive, OURS, seed) for seed in range(self.plan.repetitions)]
        return float(np.mean([bare_bytes(folder / "map.lemto") for folder in folders])) / 1000.0

    def report(self) -> str:
        """Write report.html, report.md and thesis.json; return the headline as Markdown."""
        drives = {drive.name: self.readings(drive) for drive in self.drives}
        legs = {task.name: self.pieces.told(self._navigation(task).name)["legs"] for task in self.tasks}
        tasks = {name: means(each) for name, each in legs.items()}
        headline = [
            *(
                f"{drive.name} drive:\n\n" + tables.resources(self._systems, drives[drive.name])
                for drive in self.drives
            ),
            "Size on disk (table 5-1; V0.5 kept no localisation data, in ours the robot finds itself again):",
            tables.sizes(drives, {drive.name: self._bare_kb(drive) for drive in self.drives}),
        ]
        if tasks:
            headline += ["Navigation, means of four legs (table 5-2):", tables.navigation(tasks)]
        headline.append(tables.where_the_baseline_wins(drives, tasks))
        sections = [Section("In numbers", "\n\n".join(headline)), Section("How it is measured", METHOD)]
        sections += [self._mapping_section(drive, drives[drive.name]) for drive in self.drives]
        if legs:
            sections.append(self._navigation_section(legs))
        write_report(self.plan.out, "LEMTOMap: chapter 5 of the thesis again", sections)
        (self.plan.out / "thesis.json").write_text(json.dumps(self._numbers(drives, tasks), indent=1))
        return "\n\n".join(headline)

    def _mapping_section(self, drive: Drive, readings: Mapping[str, SystemReadings]) -> Section:
        out, figures = self.plan.out, FIGURES[drive.name]
        titled = {system.key: (system.title, readings[system.key]) for system in self._systems}
        totals, same, own, maps = (
            out / f"{drive.name}-{what}.png"
            for what in ("totals", "parts-same-scale", "parts-own-scale", "maps")
        )
        draw_totals(titled, totals)
        draw_parts(titled[OURS.key], titled[BASELINE.key], same, same_scale=True)
        draw_parts(titled[OURS.key], titled[BASELINE.key], own, same_scale=False)
        folders = [self._folder(drive, system, 0) for system in (OURS, BASELINE)]
        draw_maps(drive.world, drive.log(out), folders[0], folders[1], maps)
        minutes, where = drive.duration_s / 60.0, Path(drive.world).name
        text = "\n\n".join(
            [
                f"{minutes:.0f} minutes through {where}; repetitions: {self.plan.repetitions}.",
                published.CURVES[drive.name],
                published.MAPS[drive.name],
                "How memory and load go on at the end of the drive:",
                tables.course(self._systems, readings),
            ]
        )
        pictures = [
            Picture(totals, f"Figure {figures[0]}: all subsystems together, {drive.name} drive"),
            Picture(same, f"Figure {figures[1]}: each subsystem, both columns on the same scale"),
            Picture(own, f"Figure {figures[2]}: each subsystem, scales of their own"),
            Picture(maps, f"Figures {figures[3]}: {MAPS_CAPTION}"),
        ]
        return Section(f"Mapping, {drive.name} drive", text, pictures)

    def _navigation_section(self, legs: Mapping[str, Sequence[Mapping[str, Any]]]) -> Section:
        pictures = []
        for name, each in legs.items():
            path = self.plan.out / f"{name}-velocity.png"
            draw_legs(each, path)
            pictures.append(Picture(path, f"Figure 5-13: the longest leg of the {name} task"))
        return Section("Navigation", published.STAMMER, pictures)

    def _numbers(self, drives: Mapping[str, Mapping[str, SystemReadings]], tasks: Any) -> dict[str, Any]:
        """Return what a later run compares itself with."""
        found: dict[str, Any] = {
            "versions": versions(),
            "revision": revision(),
            "log": self.drives[-1].log(self.plan.out).name,
            "navigation": tasks,
        }
        for drive in self.drives:
            found[drive.name] = {
                system.key: {
                    "cpu_s": drives[drive.name][system.key].cpu_s,
                    "parts_cpu_s": {
                        part: float(curve.cpu_s[-1])
                        for part, curve in drives[drive.name][system.key].parts.items()
                    },
                    "memory_mb": float(drives[drive.name][system.key].total.memory_mb[-1]),
                    "memory_slope_mb_per_h": drives[drive.name][system.key].total.memory_slope_mb_per_h(),
                    "disk_kb": drives[drive.name][system.key].disk_kb,
                    "local_m": drives[drive.name][system.key].local_m,
                    "whole_m": drives[drive.name][system.key].whole_m,
                }
                for system in (OURS, OURS_5, BASELINE)
            }
        return found
