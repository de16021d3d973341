"""`lemtomap map`: a recorded log in, a folder with map, trajectory, picture and figures out."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lemtomap.areas.painting import Painting
from lemtomap.errors import BadSetting
from lemtomap.grid import (
    DEFAULT_SLAM,
    GridSlam,
    GrowingGmapping,
)
from lemtomap.pipeline import Mapper
from lemtomap.robot.build_map import build_slam, build_topo
from lemtomap.robot.config import RobotConfig
from lemtomap.robot.logs import Log, open_log
from lemtomap.robot.output import files as outputs
from lemtomap.robot.output.final_map import FinalMap, final_map, map_on_path
from lemtomap.robot.output.overview import Overview, WallSketch, draw
from lemtomap.robot.output.progress import Bar, first_use
from lemtomap.robot.settings.read import read_settings
from lemtomap.robot.settings.tree import to_mapping
from lemtomap.topo.file.store import TopoStore
from lemtomap.types import (
    EdgeType,
    GridView,
    MapView,
    Odometry,
    Scan,
    SlamUpdate,
)

PARTICLES = {"window": 1, "gmapping": 30}  # growing grid: what Grisetti et al. 2007 used on these logs
BAR_PERIOD_S = 0.2
PROFILE_ROWS = 200


@dataclass(frozen=True, slots=True)
class MapLogOptions:
    """What the user asked for."""

    log: Path
    out: Path
    slam: str = DEFAULT_SLAM
    config: RobotConfig = field(default_factory=RobotConfig)
    seed: int = 0
    field_of_view_deg: float | None = None
    """What the laser of a CARMEN log covers, whatever the log says."""

    def open_log(self) -> Log:
        """Return the log; raises BadLog, BadSetting."""
        told = self.field_of_view_deg
        return open_log(self.log, None if told is None else math.radians(told))


def chosen(
    slam: str,
    config: Path | None,
    orders: Sequence[str],
    particles: int | None = None,
    window_m: float | None = None,
    max_range_m: float | None = None,
) -> RobotConfig:
    """Return the settings of a file, the command line and this metric layer. Raises BadSetting."""
    options = {
        "--particles": ("slam.particles", particles),
        "--window": ("slam.window_m", window_m),
        "--max-range": ("slam.max_range_m", max_range_m),
    }
    read = read_settings(config, orders, options=options)
    if slam == "window" and particles not in (None, 1):
        raise BadSetting(f"--particles {particles}: --slam window follows one pose only")
    usual = PARTICLES.get(slam)
    if usual is None or (("slam", "particles") in read.sources and slam != "window"):
        return read.config
    return replace(read.config, slam=replace(read.config.slam, particles=usual))


@dataclass(slots=True)
class _Drive:
    """What is kept of the drive, beside the map."""

    stamps_s: list[float] = field(default_factory=list)
    walls: WallSketch = field(default_factory=WallSketch)
    updates: int = 0
    profile: list[tuple[float, float, float, float]] = field(default_factory=list)
    """Now and then: share of the log done, CPU of grid and topology so far (s), memory (MB)."""
    grid_cpu_s: float = 0.0
    topo_cpu_s: float = 0.0


class _Timed:
    """A SLAM whose CPU time is counted."""

    def __init__(self, slam: GridSlam) -> None:
        self._slam = slam
        self.cpu_s = 0.0

    def update(self, scan: Scan, odometry: Odometry) -> SlamUpdate:
        begun_s = time.process_time()
        update = self._slam.update(scan, odometry)
        self.cpu_s += time.process_time() - begun_s
        return update

    def view(self) -> GridView:
        return self._slam.view()

    def particles(self) -> NDArray[np.float64]:
        return self._slam.particles()

    def points_base(self) -> NDArray[np.float32]:
        return self._slam.points_base()


def map_log(options: MapLogOptions, bar: Bar) -> str:
    """Map the log and leave its files in the folder; return the lines that tell the user what came out.

    Raises BadLog, BadSetting; then nothing is left behind.
    """
    begun_s, begun_cpu_s = time.perf_counter(), time.process_time()
    config = options.config
    log = options.open_log()
    for remark in log.remarks:
        bar.say(f"{log.path}: {remark}")
    read_cpu_s = time.process_time() - begun_cpu_s
    with outputs.staged(options.out) as stage:
        grid = build_slam(options.slam, config, options.seed)
        slam = _Timed(grid)
        store = TopoStore.create(stage / "map.lemto", durable=False)
        topo = build_topo(options.slam, config, store)
        try:
            with first_use(bar):
                drive = _drive(log, Mapper(lambda: slam, topo, watched=False), slam, bar)
            final = map_on_path(topo, grid.path()) if isinstance(grid, GrowingGmapping) else final_map(topo)
            view, painting = topo.view(), Painting.of(store)
        finally:
            topo.close()
        summary = _summary(options, drive, final)
        if log.has_clock:
            summary["log_s"] = _span_s(drive.stamps_s)
        summary["map_bytes"] = outputs.file_bytes(stage / "map.lemto")
        outputs.write_trajectory(stage / "trajectory.tum", final.stamps_s, final.T_map_base)
        outputs.write_grid(stage, view.grid, final.T_map_grid)
        draw(stage / "overview.png", _overview(options, summary, drive, final, view, painting))
        summary |= {
            "wall_s": time.perf_counter() - begun_s,
            "cpu_s": time.process_time() - begun_cpu_s,
            "cpu_by_part_s": {"read": read_cpu_s, "grid": drive.grid_cpu_s, "topo": drive.topo_cpu_s},
            "peak_rss_mb": outputs.peak_rss_mb(),
            "profile": drive.profile,
        }
        if log.has_clock:
            summary["realtime_factor"] = summary["log_s"] / summary["wall_s"]
        outputs.write_summary(stage / "summary.json", summary)
    return f"{_told(summary, options.out)}\n{outputs.told_of_grid(options.out, view.grid, final.T_map_grid)}"


def _told(summary: dict[str, Any], out: Path) -> str:
    """Return the line that tells the user what came out."""
    rate = f" ({summary['realtime_factor']:,.0f}x real time)" if "realtime_factor" in summary else ""
    return (
        f"{summary['scans']:,} scans, {summary['path_m']:,.0f} m, in {summary['wall_s']:.1f} s{rate}: "
        f"{summary['nodes']} nodes, {summary['loop_closures']} loop closures. Look at {out / 'overview.png'}"
    )


def _drive(log: Log, mapper: Mapper, slam: _Timed, bar: Bar) -> _Drive:
    """Feed every scan to the mapper, in file order."""
    drive = _Drive()
    stride = max(1, len(log) // PROFILE_ROWS)
    shown_s, begun_s, begun_cpu_s = -math.inf, time.perf_counter(), time.process_time()
    for index, (odometry, scan) in enumerate(log):
        update = mapper.update(scan, odometry).slam
        drive.stamps_s.append(scan.stamp_s)
        if update is not None and update.integrated:
            drive.updates += 1
            drive.walls.add(index, slam.points_base())
        now_s = time.perf_counter()
        if now_s - shown_s > BAR_PERIOD_S:
            shown_s = now_s
            done_s = scan.stamp_s - drive.stamps_s[0]
            bar.show(index / len(log), index, done_s / (now_s - begun_s) if log.has_clock else None)
        if index % stride == 0:
            topo_cpu_s = time.process_time() - begun_cpu_s - slam.cpu_s
            drive.profile.append((index / len(log), slam.cpu_s, topo_cpu_s, outputs.rss_mb()))
    bar.show(1.0, len(log))
    drive.grid_cpu_s = slam.cpu_s
    drive.topo_cpu_s = time.process_time() - begun_cpu_s - slam.cpu_s
    return drive


def _summary(options: MapLogOptions, drive: _Drive, final: FinalMap) -> dict[str, Any]:
    """Return the figures of the map, in the order a person asks for them."""
    edges = final.edges_by_type()
    return {
        "log": str(options.log),
        "scans": len(final.stamps_s),
        "updates": drive.updates,
        "path_m": final.path_m(),
        "nodes": len(final.T_map_node),
        "edges": edges,
        "loop_closures": edges[EdgeType.LOOP_CLOSING.value],
        "seed": options.seed,
        "slam": options.slam,
        "config": to_mapping(options.config),
        "versions": outputs.versions(),
    }


def _overview(
    options: MapLogOptions,
    summary: dict[str, Any],
    drive: _Drive,
    final: FinalMap,
    view: MapView,
    painting: Painting,
) -> Overview:
    """Gather what the picture shows."""
    took = f" in {summary['log_s'] / 60:.0f} min" if "log_s" in summary else ""
    facts = [
        f"scans       {summary['scans']:,} ({summary['updates']:,} into the grid)",
        f"path        {summary['path_m']:,.0f} m{took}",
        f"nodes       {summary['nodes']:,}",
        *(f"edges       {count:,} {kind.replace('_', ' ')}" for kind, count in summary["edges"].items()),
        f"map file    {summary['map_bytes'] / 1000:,.0f} kB",
        f"CPU         {drive.grid_cpu_s:.1f} s grid, {drive.topo_cpu_s:.1f} s topological",
        f"settings    --slam {options.slam} --particles {options.config.slam.particles}",
        f"            --window {options.config.slam.window_m:g} --seed {options.seed}",
    ]
    return Overview(
        T_map_node=final.T_map_node,
        edges=final.edges,
        trajectory=final.T_map_base,
        walls=drive.walls.points(dict(enumerate(final.T_map_base))),
        grid=view.grid,
        T_map_grid=final.T_map_grid,
        names=view.names,
        painting=painting,
        title=options.log.name,
        facts=facts,
    )


def _span_s(stamps_s: Sequence[float]) -> float:
    """Return the time a log spans, whatever the order of its stamps."""
    return max(stamps_s) - min(stamps_s) if stamps_s else 0.0
