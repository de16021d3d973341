"""Everything a run with a robot, real or simulated, leaves in its folder."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from lemtomap.se2 import Pose
from lemtomap.types import EdgeType, MapView
from robot import outputs
from robot.core import Effort, RobotCore
from robot.exchange import Note
from robot.final_map import FinalMap, final_map
from robot.onlooker import Onlooker
from robot.overview import Overview, WallSketch, draw
from robot.parts import DEFAULT_LIMIT, PartFiles
from robot.preview import draw_preview
from robot.recording import Recorder
from robot.viewer import Viewer

PREVIEW_PERIOD_S = 15.0
WALLS_PERIOD_S = 0.5  # of the scans that draw the walls in the picture
RECORDINGS = ("run.rrd", "run.mcap")
RESULTS = ("trajectory.tum", "grid.pgm", "grid.yaml", "overview.png", "summary.json", *RECORDINGS)


class Listener(Protocol):
    """Who tells the user."""

    def say(self, note: Note) -> None:
        """Say a line."""
        ...

    def look(self, now_s: float) -> None:
        """Show how far the run is."""
        ...


@dataclass(frozen=True, slots=True)
class RecordPlan:
    """What the recordings tell of the run, and how large each of them may become."""

    about: Mapping[str, Any] = field(default_factory=dict)
    limit_bytes: int = DEFAULT_LIMIT


@dataclass(slots=True)
class _Clock:
    """When the run began, by the wall and by the processor."""

    wall_s: float = field(default_factory=time.perf_counter)
    cpu_s: float = field(default_factory=time.process_time)


class RunFiles(Onlooker):
    """Recorder, viewer and, at the end, map, trajectory, picture and summary."""

    def __init__(
        self, out: Path, title: str, core: RobotCore, listener: Listener, record: RecordPlan, *, live: bool
    ) -> None:
        self._out, self._title, self._core, self._listener = out, title, core, listener
        self._begun = _Clock()
        self._walls = WallSketch()
        self._walls_due_s, self._preview_due_s = 0.0, PREVIEW_PERIOD_S
        self._truth: Callable[[], Pose | None] | None = None
        self._view = Viewer(out / "run.rrd", live=live, limit_bytes=record.limit_bytes)
        self._recorded = Recorder(out / "run.mcap", record.about, record.limit_bytes)
        super().__init__(core.exchange, core.efforts, self._view, self._recorded, listener.say)

    def show_world(self, outlines: Sequence[NDArray[np.float64]], truth: Callable[[], Pose | None]) -> None:
        """Show a simulated building, and from now on where the robot truly is in it, T_world_base."""
        self._truth = truth
        self._view.show_world(outlines)

    def look(self, now_s: float) -> None:
        """Show and record what is new; now and then keep a scan for the picture."""
        super().look(now_s)
        self._listener.look(now_s)
        view, scan = self._core.exchange.map_view.get(), self._core.exchange.last_scan.get()
        true = self._truth() if self._truth is not None else None
        if view is not None and true is not None:
            self._view.show_truth(now_s, true, view.T_grid_base)
        if view is not None and now_s >= self._preview_due_s:
            self._preview_due_s = now_s + PREVIEW_PERIOD_S
            draw_preview(self._out / "overview.png", view)
        if scan is not None and now_s >= self._walls_due_s:
            self._walls_due_s = now_s + WALLS_PERIOD_S
            self._walls.add(scan.scan.stamp_s, scan.sighting.hits_base)

    def finish(
        self,
        now_s: float,
        map_path: Path,
        told: Mapping[str, Any],
        settings: Mapping[str, Any],
        *,
        whole_drive: bool,
    ) -> dict[str, Any]:
        """Close everything, write the results, return the summary, which begins with `told`.

        `whole_drive`: the map began empty with this run.
        """
        self.look(now_s)
        self.close()
        view = self._core.exchange.map_view.get()
        final = final_map(self._core.mapping.mapper, whole_drive=whole_drive) if view is not None else None
        self._core.close()
        summary: dict[str, Any] = {**told, "run_s": now_s}
        if final is not None and view is not None:
            summary |= self._figures(final, now_s, map_path)
            self._write(summary, final, view)
        summary |= {**settings, "versions": outputs.versions()}
        outputs.write_summary(self._out / "summary.json", summary)
        return summary

    def _write(self, summary: Mapping[str, Any], final: FinalMap, view: MapView) -> None:
        """Write trajectory, grid and picture."""
        outputs.write_trajectory(self._out / "trajectory.tum", final.stamps_s, final.T_map_base)
        outputs.write_grid(self._out, view.grid)
        overview = Overview(
            T_map_node=final.T_map_node,
            edges=final.edges,
            trajectory=final.T_map_base,
            walls=self._walls.points(dict(zip(final.stamps_s.tolist(), final.T_map_base, strict=True))),
            grid=view.grid,
            T_map_grid=final.T_map_grid,
            names=view.names,
            title=self._title,
            facts=_facts(summary),
        )
        draw(self._out / "overview.png", overview)

    def _figures(self, final: FinalMap, now_s: float, map_path: Path) -> dict[str, Any]:
        """Return what the run did and cost."""
        core, edges = self._core, final.edges_by_type()
        wall_s = time.perf_counter() - self._begun.wall_s
        return {
            "scans": len(final.stamps_s),
            "updates": core.mapping.scans,
            "path_m": final.path_m(),
            "nodes": len(final.T_map_node),
            "edges": edges,
            "loop_closures": edges[EdgeType.LOOP_CLOSING.value],
            "map_bytes": outputs.file_bytes(map_path),
            "cpu_s": time.process_time() - self._begun.cpu_s,
            "wall_s": wall_s,
            "realtime_factor": now_s / wall_s,
            "peak_rss_mb": outputs.peak_rss_mb(),
            "parts": {
                "base": _effort(core.efforts.base),
                "mapping": _effort(core.efforts.mapping),
                "navigation": _effort(core.efforts.navigation),
            },
            "dropped": core.exchange.dropped(),
            "recorded": {
                "run.mcap": _written(self._recorded.parts, now_s),
                "run.rrd": _written(self._view.parts, now_s),
            },
        }


def _written(parts: PartFiles, now_s: float) -> dict[str, float]:
    """Return what a recording grew by, and how many of its oldest parts went because of the limit."""
    hours = max(now_s, 1.0) / 3600.0
    return {
        "bytes": parts.written_bytes,
        "mb_per_hour": parts.written_bytes / 1e6 / hours,
        "parts_dropped": parts.dropped,
    }


def _effort(effort: Effort) -> dict[str, float]:
    """Return one part's cost as plain figures."""
    return {"calls": effort.calls, "cpu_s": effort.cpu_s, "worst_ms": 1000 * effort.worst_s}


def _facts(summary: Mapping[str, Any]) -> list[str]:
    """Return the lines beside the picture."""
    return [
        *(f"{key:<11} {summary[key]}" for key in ("mission", "result", "contacts") if key in summary),
        f"path        {summary['path_m']:,.0f} m in {summary['run_s'] / 60:.1f} min",
        f"nodes       {summary['nodes']:,}",
        *(f"edges       {count:,} {kind.replace('_', ' ')}" for kind, count in summary["edges"].items()),
        f"map file    {summary['map_bytes'] / 1000:,.0f} kB",
        *(f"CPU         {part['cpu_s']:.1f} s {name}" for name, part in summary["parts"].items()),
    ]
