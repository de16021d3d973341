"""Everything a run with a robot, real or simulated, leaves in its folder."""

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from lemtomap.areas.painting import Painting
from lemtomap.robot.core import Effort, RobotCore
from lemtomap.robot.devices.parts import DEFAULT_LIMIT, PartFiles
from lemtomap.robot.devices.recording import Recorder
from lemtomap.robot.exchange import Note
from lemtomap.robot.output import files as outputs
from lemtomap.robot.output.final_map import FinalMap, final_map
from lemtomap.robot.output.onlooker import Onlooker
from lemtomap.robot.output.overview import Overview, WallSketch, draw
from lemtomap.robot.output.preview import draw_preview
from lemtomap.robot.output.viewer import Viewer
from lemtomap.robot.output.viewer_config import ViewerConfig
from lemtomap.robot.runs.ending import Ending, reason_of
from lemtomap.robot.runs.folder import RunFolder, Space
from lemtomap.se2 import Pose
from lemtomap.types import EdgeType, MapView

WALLS_PERIOD_S = 0.5  # of the scans that draw the walls in the picture
FOLDER_PERIOD_S = 1.0  # of wall time between two looks at the folder and its disk
RECORDINGS = ("run.rrd", "run.mcap")
RESULTS = ("trajectory.tum", "grid.pgm", "grid.yaml", "overview.png", "summary.json", *RECORDINGS)

# What each step of the end may take, s; a drive of hours is solved in less.
LOOK_LIMIT_S, CLOSE_LIMIT_S, WRITE_LIMIT_S, PICTURE_LIMIT_S, SOLVE_LIMIT_S = 5.0, 10.0, 20.0, 60.0, 180.0


class Observer(Protocol):
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

    title: str
    about: Mapping[str, Any] = field(default_factory=dict)
    limit_bytes: int = DEFAULT_LIMIT
    live: bool = False
    viewer: ViewerConfig = field(default_factory=ViewerConfig)


@dataclass(slots=True)
class _Clock:
    """When the run began, by the wall and by the processor."""

    wall_s: float = field(default_factory=time.perf_counter)
    cpu_s: float = field(default_factory=time.process_time)


class RunFiles(Onlooker):
    """Recorder, viewer and, at the end, map, trajectory, picture and summary.

    Raises OSError when the recordings cannot be begun.
    """

    def __init__(
        self,
        folder: RunFolder,
        spaces: Sequence[Space],
        core: RobotCore,
        listener: Observer,
        record: RecordPlan,
    ) -> None:
        self._folder, self._spaces = folder, spaces
        self._title, self._core, self._listener = record.title, core, listener
        self._begun = _Clock()
        self._walls = WallSketch()
        self._preview_s = record.viewer.preview_s
        self._walls_due_s, self._preview_due_s, self._folder_due_s = 0.0, record.viewer.preview_s, 0.0
        self._truth: Callable[[], Pose | None] | None = None
        self._scarce = ""
        self._painting: Painting | None = None
        """Areas and doors as the map had them when it was closed."""
        self._space_lock = threading.Lock()
        core.mapping.mapper.topo.store.before_commit = self._mind_space
        super().__init__(core.exchange, core.efforts, say=listener.say)
        self._recorder = self._recorded = Recorder(folder.path / "run.mcap", record.about, record.limit_bytes)
        self._view = Viewer(
            folder.path / "run.rrd",
            lambda text: self.warn("viewer", text),
            live=record.live,
            config=record.viewer,
            limit_bytes=record.limit_bytes,
        )
        self._viewer = self._view

    def show_world(self, outlines: Sequence[NDArray[np.float64]], truth: Callable[[], Pose | None]) -> None:
        """Show a simulated building, and from now on where the robot truly is in it, T_world_base."""
        self._truth = truth
        self._view.show_world(outlines)

    def look(self, now_s: float) -> None:
        """Show and record what is new; now and then keep a scan for the picture and look at the folder."""
        self._mind_folder()
        super().look(now_s)
        self._listener.look(now_s)
        view, scan = self._core.exchange.map_view.get(), self._core.exchange.last_scan.get()
        true = self._truth() if self._truth is not None else None
        if view is not None and true is not None and self._viewer is not None:
            self._view.show_truth(now_s, true, view.T_grid_base)
        if view is not None and now_s >= self._preview_due_s:
            self._preview_due_s = now_s + self._preview_s
            self._preview(view)
        if scan is not None and now_s >= self._walls_due_s:
            self._walls_due_s = now_s + WALLS_PERIOD_S
            self._walls.add(scan.scan.stamp_s, scan.sighting.hits_base)

    def _preview(self, view: MapView) -> None:
        """Draw the picture as far as it is; without room for it there is one at the end."""
        try:
            draw_preview(self._folder.path / "overview.png", view)
        except OSError as error:
            self._preview_due_s = float("inf")
            self.warn("picture", f"none before the end: {reason_of(error)}")

    # ---- the folder and its disk ----

    def _mind_folder(self) -> None:
        """Notice at once that the folder has gone, or that its disk gets full."""
        wall_s = time.perf_counter()
        if wall_s >= self._folder_due_s:
            self._folder_due_s = wall_s + FOLDER_PERIOD_S
            if not self._folder.here:
                self._renew_folder()
            self._mind_space()
        if self._scarce:
            self.end_recordings(self._scarce)
            self._scarce = ""

    def _renew_folder(self) -> None:
        old, store = self._folder.path, self._core.mapping.mapper.topo.store
        new = self._folder.renew()
        if store.path.parent == old:
            store.path = new / store.path.name
        self.warn("folder", f"{old} is gone, deleted or moved; map and results will be in {new}")
        self.end_recordings("its folder is gone")

    def _mind_space(self) -> None:
        """Keep what room is left for the map and the results. Called from the mapping thread, too."""
        with self._space_lock:
            for space in self._spaces:
                try:
                    free = space.free_bytes()
                except OSError:  # the folder is gone, which is noticed elsewhere
                    continue
                if free < space.recordings_bytes and not space.scarce:
                    space.scarce = True
                    self._scarce = f"only {free / 1e6:.0f} MB are free on the disk, kept for map and results"
                if free < space.least_bytes:
                    space.release()
                    self.over = self.over or f"{space.folder}: the disk is full"

    # ---- the end ----

    def finish(
        self, now_s: float, told: Mapping[str, Any], settings: Mapping[str, Any], *, whole_drive: bool
    ) -> dict[str, Any]:
        """Close everything, write the results, return the summary, which begins with `told`.

        `whole_drive`: the map began empty with this run. Every step runs whatever becomes of the others; what
        went wrong stands in the summary under "faults".
        """
        core, store = self._core, self._core.mapping.mapper.topo.store
        ending = Ending(lambda line: self._listener.say(Note(now_s, "end", line)))
        for space in self._spaces:
            space.release()
        ending.step("map", WRITE_LIMIT_S, store.commit)
        ending.step("last look", LOOK_LIMIT_S, lambda: self.look(now_s))
        if self._recorder is not None:
            ending.step("recorder", CLOSE_LIMIT_S, self._recorder.close)
        ending.step("viewer", CLOSE_LIMIT_S, self._view.close)
        view = core.exchange.map_view.get()
        final = self._final(ending, whole_drive=whole_drive) if view is not None else None
        self._painting = ending.step("areas", WRITE_LIMIT_S, lambda: Painting.of(store))
        ending.step("folder", WRITE_LIMIT_S, self._need_folder)
        ending.step("map", WRITE_LIMIT_S, core.close)
        summary: dict[str, Any] = {**told, "run_s": now_s, "out": self._folder.path, "map": store.path}
        if final is not None and view is not None:
            summary |= self._figures(final, now_s, store.path)
            self._write(ending, summary, final, view)
        summary |= {"faults": [*told["faults"], *ending.failed], **settings, "versions": outputs.versions()}
        write = lambda: outputs.write_summary(self._folder.path / "summary.json", summary)  # noqa: E731
        ending.step("summary", WRITE_LIMIT_S, write)
        summary["faults"] = [*told["faults"], *ending.failed]
        self._folder.close()
        return summary

    def _need_folder(self) -> None:
        """See that there is a folder to write to."""
        if not self._folder.here:
            self._renew_folder()

    def _final(self, ending: Ending, *, whole_drive: bool) -> FinalMap | None:
        """Place the drive in one frame: fitted scan by scan, or, should that fail, node by node."""
        mapper = self._core.mapping.mapper.topo
        for whole in (True, False) if whole_drive else (False,):
            final = ending.step("final map", SOLVE_LIMIT_S, partial(final_map, mapper, whole_drive=whole))
            if final is not None:
                return final
        return None

    def _write(self, ending: Ending, summary: Mapping[str, Any], final: FinalMap, view: MapView) -> None:
        """Write trajectory, grid and picture."""
        out = self._folder.path

        def trajectory() -> None:
            outputs.write_trajectory(out / "trajectory.tum", final.stamps_s, final.T_map_base)

        def picture() -> None:
            draw(out / "overview.png", self._overview(summary, final, view))

        ending.step("trajectory", WRITE_LIMIT_S, trajectory)
        ending.step("grid", WRITE_LIMIT_S, lambda: outputs.write_grid(out, view.grid, final.T_map_grid))
        ending.step("picture", PICTURE_LIMIT_S, picture)

    def _overview(self, summary: Mapping[str, Any], final: FinalMap, view: MapView) -> Overview:
        """Gather what the picture shows."""
        return Overview(
            T_map_node=final.T_map_node,
            edges=final.edges,
            trajectory=final.T_map_base,
            walls=self._walls.points(dict(zip(final.stamps_s.tolist(), final.T_map_base, strict=True))),
            grid=view.grid,
            T_map_grid=final.T_map_grid,
            names=view.names,
            painting=self._painting,
            title=self._title,
            facts=_facts(summary),
        )

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
            "threads_cpu_s": core.efforts.threads.spent_s(),
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
