"""The run as a person sees it: a Rerun recording, and the live viewer when there is a display.

Everything spatial is drawn in the grid frame (z only separates layers): the window as GridMap under
the costmap, the topological map with the associated node and the route in colour, the robot with its
scan and particles. Each kind of thing has its own rate limit, so a long run stays a small file and the
viewer thread never falls behind. Logging never waits for the disk or the window. With `viewer_layout` and
`viewer_truth` the only importer of `rerun`.
"""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from lemtomap import palette
from lemtomap.areas.colours import colour_of
from lemtomap.nav.types import CostmapView
from lemtomap.robot.devices.parts import DEFAULT_LIMIT, PartFiles
from lemtomap.robot.output.viewer_config import ViewerConfig
from lemtomap.robot.output.viewer_layout import ABOUT, blueprint
from lemtomap.robot.output.viewer_pipe import ViewerPipe
from lemtomap.robot.output.viewer_truth import TruthView
from lemtomap.robot.output.viewer_window import ViewerWindow
from lemtomap.se2 import Pose
from lemtomap.types import (
    EdgeType,
    GridView,
    MapView,
    Twist,
)

rr.unregister_shutdown()  # it would wait at the program's end for what `close` did not wait for

PATHS = NDArray[np.floating]

TRAIL_LENGTH = 4000  # poses behind the robot; at 10 Hz more than six minutes
Z_COSTMAP, Z_EDGES, Z_NODES, Z_ROUTE, Z_SCAN = (
    0.01,
    0.03,
    0.06,
    0.09,
    0.12,
)  # m above the floor, bottom to top


def _cost_colours() -> NDArray[np.uint8]:
    """Return RGBA for each cost of CostmapView: yellow to red, then too close, obstacle, unknown."""
    cost = np.arange(256)
    colours = np.zeros((256, 4), np.uint8)
    near = (cost >= 1) & (cost <= 252)
    share = cost[near] / 252.0
    colours[near] = np.stack(
        [np.full(share.size, 250), 200 - 150 * share, 60 - 40 * share, 20 + 150 * share], axis=-1
    ).astype(np.uint8)
    colours[253], colours[254] = (214, 40, 90, 190), (90, 0, 60, 255)
    return colours


COST_COLOURS = _cost_colours()


class Viewer:
    """Writes one .rrd; also shows it in a Rerun window if `live`. Calls come from one thread.

    What goes wrong with file or window is said by `say`, in a line; the viewer goes on without it.
    Raises OSError when the file cannot be made.
    """

    def __init__(
        self,
        recording: Path,
        say: Callable[[str], None],
        *,
        live: bool,
        config: ViewerConfig | None = None,
        limit_bytes: int = DEFAULT_LIMIT,
    ) -> None:
        self._config = config or ViewerConfig()
        self.parts = PartFiles(recording, limit_bytes)
        self._due: dict[str, float] = {}
        self._trail: deque[tuple[float, float, float]] = deque(maxlen=TRAIL_LENGTH)
        self._state = ""
        self._truth: TruthView | None = None
        batches = None if live else rr.ChunkBatcherConfig(flush_tick=self._config.flush_s)
        self._stream = rr.RecordingStream("lemtomap", make_default=False, batcher_config=batches)
        self._say = say
        self._window = ViewerWindow(say) if live else None
        self._pipe = self._begin_part()

    def show_map(self, now_s: float, view: MapView) -> None:
        """Show the window, the graph near the robot, the particles and the map's own figures."""
        self._at(now_s)
        self.keep_within_limit(now_s)
        if self._is_due("window", now_s, self._config.window_hz):
            self._log_window(view.grid)
            self._log_graph(view)
        if self._is_due("quality", now_s, self._config.plot_hz):
            self._stream.log("quality", rr.Scalars([view.quality, view.diversity]))
            self._log_particles(view)

    def show_robot(self, now_s: float, T_grid_base: Pose, points_base: PATHS | None = None) -> None:
        """Show where the robot is, its trail, and the latest scan's beam ends, (N, 2) metres, base frame."""
        self._at(now_s)
        x, y, yaw = (float(value) for value in T_grid_base)
        if self._is_due("pose", now_s, self._config.pose_hz):
            turn = rr.RotationAxisAngle(axis=[0, 0, 1], radians=yaw)
            self._stream.log("grid/robot", rr.Transform3D(translation=[x, y, 0.0], rotation=turn))
            self._stream.log("grid/eye", rr.Transform3D(translation=[x, y, 0.0]))
            self._trail.append((x, y, Z_EDGES))
        if self._is_due("trail", now_s, self._config.window_hz) and len(self._trail) > 1:
            trail = rr.LineStrips3D([list(self._trail)], radii=0.015, colors=[120, 140, 170, 160])
            self._stream.log("grid/trail", trail)
        if points_base is not None and self._is_due("scan", now_s, self._config.scan_hz):
            self._stream.log("grid/robot/scan", rr.Points3D(_lift(points_base, Z_SCAN)))

    def show_plan(
        self,
        now_s: float,
        *,
        state: str,
        route_grid: PATHS,
        path_grid: PATHS,
        costmap: CostmapView | None = None,
    ) -> None:
        """Show navigation: its state, the route over nodes and the way to the sliding goal, (N, 2) metres."""
        self._at(now_s)
        if state != self._state:
            self._state = state
            self._stream.log("state/navigation", rr.StateChange(state=state))
        if self._is_due("plan", now_s, self._config.plan_hz):
            self._stream.log("grid/plan/route", _strip(route_grid, Z_ROUTE))
            self._stream.log("grid/plan/path", _strip(path_grid, Z_ROUTE))
            ends = path_grid[-1:] if len(path_grid) else path_grid
            self._stream.log("grid/plan/goal", rr.Points3D(_lift(ends, Z_SCAN)))
        if costmap is not None and self._is_due("costmap", now_s, self._config.costmap_hz):
            self._log_costmap(costmap)

    def show_velocity(self, now_s: float, wanted: Twist, sent: Twist, measured: Twist) -> None:
        """Plot what navigation wanted, what the safety gate let through and what the wheels did."""
        self._at(now_s)
        if self._is_due("velocity", now_s, self._config.plot_hz):
            self._stream.log("velocity/forward", rr.Scalars([wanted.v_mps, sent.v_mps, measured.v_mps]))
            self._stream.log("velocity/turn", rr.Scalars([wanted.w_radps, sent.w_radps, measured.w_radps]))

    def show_timing(self, now_s: float, times_ms: Mapping[str, float]) -> None:
        """Plot what each part of the program took in its last cycle, in milliseconds."""
        self._at(now_s)
        for name, value in times_ms.items():
            if self._is_due(f"timing/{name}", now_s, self._config.timing_hz):
                self._stream.log(f"timing/{name}", rr.Scalars(value))

    def show_figure(self, now_s: float, name: str, value: float) -> None:
        """Plot a figure of the robot's health, such as `battery_v`."""
        self._at(now_s)
        if self._is_due(f"health/{name}", now_s, 1.0):
            self._stream.log(f"health/{name}", rr.Scalars(value))

    def say(self, now_s: float, source: str, text: str, level: str = "INFO") -> None:
        """Show one log line; `level` is DEBUG, INFO, WARN or ERROR. Never limited."""
        self._at(now_s)
        self._stream.log(f"log/{source}", rr.TextLog(text, level=level))

    def show_world(self, outlines: Sequence[NDArray[np.float64]]) -> None:
        """Show a simulated building, outlines of float64 (N, 2) metres, in a tab of its own."""
        self._truth = TruthView(self._stream, outlines)
        self._stream.send_blueprint(self._blueprint())

    def show_truth(self, now_s: float, T_world_base: Pose, T_grid_base: Pose) -> None:
        """Show where a simulated robot truly is beside where it believes to be. Needs show_world before."""
        self._at(now_s)
        if self._truth is not None and self._is_due("truth", now_s, self._config.window_hz):
            self._truth.show(now_s, T_world_base, T_grid_base)

    def end_file(self, why: str) -> None:
        """Write the recording no further, for the reason given; the window goes on."""
        self._pipe.end_file(why)

    def keep_within_limit(self, now_s: float) -> None:
        """Now and then, go on with the next part when this one is full."""
        if self._is_due("part", now_s, self._config.part_hz) and self._pipe.writes and self.parts.full:
            self.parts.advance()
            self._pipe = self._begin_part()

    def close(self) -> None:
        """Finish the recording; later calls do nothing useful."""
        with suppress(RuntimeError, TimeoutError, ValueError):  # late: what is written stays
            self._stream.flush(timeout_sec=self._config.close_s)
        self._stream.disconnect()
        self._pipe.close(self._config.close_s)
        if self._window is not None:
            self._window.close()

    def _begin_part(self) -> ViewerPipe:
        """Write to this part from now on; each can be looked at by itself."""
        pipe = ViewerPipe(self.parts.path, self._say, self._window)
        self._stream.set_sinks(rr.FileSink(pipe.sink))
        pipe.taken()
        self._stream.send_blueprint(self._blueprint())
        self._log_static()
        if self._truth is not None:
            self._truth.begin()
        return pipe

    def _blueprint(self) -> rr.blueprint.Blueprint:
        """Return how the screen is laid out, with the building when there is one."""
        truth = self._truth
        return blueprint() if truth is None else blueprint((*truth.middle_m.tolist(), truth.extent_m))

    def _at(self, now_s: float) -> None:
        """Stamp what follows with run time."""
        self._stream.set_time("run", duration=max(0.0, now_s))

    def _is_due(self, what: str, now_s: float, rate_hz: float) -> bool:
        """Return True if `what` may be logged again; a small slack keeps equal rates equal."""
        if now_s < self._due.get(what, -np.inf) - 0.005:
            return False
        self._due[what] = now_s + 1.0 / rate_hz
        return True

    def _log_static(self) -> None:
        """Log what does not change: colours, names, the robot's body, how to read the picture."""
        log = self._stream.log
        log("about", rr.TextDocument(ABOUT, media_type=rr.MediaType.MARKDOWN), static=True)
        body = rr.Cylinders3D(
            lengths=[0.1],
            radii=[self._config.body_m],
            centers=[[0, 0, 0.05]],
            colors=[230, 57, 70],
            fill_mode="solid",
        )
        log("grid/robot/body", body, static=True)
        nose = rr.Arrows3D(vectors=[[0.45, 0, 0]], origins=[[0, 0, 0.13]], radii=0.04, colors=[255, 255, 255])
        log("grid/robot/nose", nose, static=True)
        for path, names in {
            "velocity/forward": ["wanted", "sent", "measured"],
            "velocity/turn": ["wanted", "sent", "measured"],
            "quality": ["pose quality", "diversity mu"],
        }.items():
            colours = [[255, 183, 3], [42, 157, 143], [69, 123, 157]][: len(names)]
            log(path, rr.SeriesLines(names=names, colors=colours, widths=[1.5] * len(names)), static=True)

    def _log_window(self, grid: GridView) -> None:
        """Log the occupancy window where it lies in the grid frame."""
        rows, cols = grid.occupancy.shape
        window = rr.GridMap(
            data=np.flipud(grid.occupancy).tobytes(),
            format=rr.components.ImageFormat(width=cols, height=rows, color_model="L", channel_datatype="U8"),
            cell_size=grid.resolution_m,
            translation=[*grid.origin_m, 0.0],
            colormap=rr.components.Colormap.RvizMap,
        )
        self._stream.log("grid/window", window)

    def _log_costmap(self, costmap: CostmapView) -> None:
        """Log the costmap as a veil over the window: clear where driving is free or nothing is known."""
        cost = costmap.paint()
        rows, cols = cost.shape
        veil = rr.GridMap(
            data=np.flipud(COST_COLOURS[cost]).tobytes(),
            format=rr.components.ImageFormat(
                width=cols, height=rows, color_model="RGBA", channel_datatype="U8"
            ),
            cell_size=costmap.resolution_m,
            translation=[*costmap.origin_m, Z_COSTMAP],
            opacity=0.99,  # at 1.0 the viewer takes it for opaque and paints clear cells black
        )
        self._stream.log("grid/costmap", veil)

    def _log_graph(self, view: MapView) -> None:
        """Log nodes with their names, the associated one in its own colour, and edges by type."""
        ids = list(view.T_grid_node)
        places = np.array([view.T_grid_node[i] for i in ids]).reshape(-1, 3)[:, :2]
        here = np.array([i == view.associated_id for i in ids], dtype=bool)
        plain = np.array([_colour_at(view, i) for i in ids]).reshape(-1, 3)
        colours = np.where(here[:, None], np.array([palette.rgb(palette.HERE)]), plain).astype(np.uint8)
        labels = [view.names.get(i) or _label_at(view, i) for i in ids]
        nodes = rr.Points3D(
            _lift(places, Z_NODES),
            radii=np.where(here, 0.16, 0.08),
            colors=colours,
            labels=labels,
            show_labels=False,
        )
        self._stream.log("grid/graph/nodes", nodes)
        named = [k for k, i in enumerate(ids) if i in view.names]
        names = rr.Points3D(
            _lift(places[named], Z_NODES), radii=0.01, labels=[labels[k] for k in named], show_labels=True
        )
        self._stream.log("grid/graph/names", names)
        doors = [_lift(ends, Z_NODES) for ends in view.doors.values()]
        marks = rr.LineStrips3D(
            doors, radii=0.05, colors=[208, 0, 0], labels=[f"door {k}" for k in view.doors], show_labels=False
        )
        self._stream.log("grid/graph/doors", marks)
        for kind in EdgeType:
            strips = [
                _lift(np.array([view.T_grid_node[a][:2], view.T_grid_node[b][:2]]), Z_EDGES)
                for _, a, b, edge_kind in view.edges
                if edge_kind == kind and a in view.T_grid_node and b in view.T_grid_node
            ]
            width = 0.06 if kind is EdgeType.LOOP_CLOSING else 0.02
            self._stream.log(
                f"grid/graph/{kind.value}",
                rr.LineStrips3D(strips, radii=width, colors=palette.rgb(palette.EDGES[kind])),
            )

    def _log_particles(self, view: MapView) -> None:
        """Log each particle as an arrow: where else the robot may be."""
        if view.particles is None:
            return
        poses = np.asarray(view.particles)
        heading = 0.3 * np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2]), np.zeros(len(poses))], axis=-1)
        arrows = rr.Arrows3D(
            vectors=heading, origins=_lift(poses[:, :2], Z_SCAN), radii=0.012, colors=[255, 140, 0]
        )
        self._stream.log("grid/particles", arrows)


def _colour_at(view: MapView, node_id: int) -> list[int]:
    """Return the colour of a node: that of its area in every picture."""
    area_id = view.area_of.get(node_id, 0)
    return list(bytes.fromhex(colour_of(area_id)[1:])) if area_id else [30, 90, 200]


def _label_at(view: MapView, node_id: int) -> str:
    """Return what a node is called in the viewer: its number and its area's."""
    area_id = view.area_of.get(node_id, 0)
    return f"{node_id} in area {area_id}" if area_id else str(node_id)


def _lift(points: PATHS | Sequence[Sequence[float]], z_m: float) -> NDArray[np.float32]:
    """Return points (N, 2) as float32 (N, 3) at height z."""
    flat = np.asarray(points, dtype=np.float32).reshape(-1, 2)
    return np.column_stack([flat, np.full(len(flat), z_m, np.float32)])


def _strip(points: PATHS, z_m: float) -> rr.LineStrips3D:
    """Return one line through the points, or none."""
    return rr.LineStrips3D([_lift(points, z_m)] if len(points) > 1 else [])
