"""The subsystems of chapter 5, each as it runs on the robot: take a frame, add to it, hand it on.

LEMTOMap is made of four (metric mapping, topological mapping, metric navigation, topological navigation), the
baseline of two. While a drive is mapped nobody navigates: navigation keeps its costmaps, as move_base did.
"""

import shutil
import time
from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lemtomap import se2
from lemtomap.grid import SLAMS, SlamConfig
from lemtomap.robot.output import files as outputs
from lemtomap.types import GridView, MapView
from tools.bench.thesis_parts.frames import Frame

PUBLISH_S = 5.0  # map_update_interval of the TurtleBot's gmapping


@dataclass(frozen=True, slots=True)
class PartOptions:
    """What a part is told when its process starts."""

    slam: str
    particles: int
    seed: int
    out: Path
    """Folder of this run: the finished map goes here."""


class Part(ABC):
    """One subsystem; a first one is made and dropped before the drive, to compile and to load."""

    def __init__(self, options: PartOptions) -> None:
        self.options = options

    @abstractmethod
    def begin(self, *, known: bool = False) -> None:
        """Start; memory from here on is the subsystem's own. `known`: go on with the map made before."""

    @abstractmethod
    def take(self, frame: Frame) -> None:
        """Work on one scan; only this is measured."""

    def drop(self) -> None:  # noqa: B027 - most have nothing to close
        """Let go of files: what was made so far was only to compile and to load."""

    def finish(self) -> dict[str, Any]:
        """Write what a user would keep; return figures worth telling."""
        return {}


class MetricMapping(Part):
    """The rolling window, or the baseline's growing grid."""

    def begin(self, *, known: bool = False) -> None:  # noqa: ARG002 - only the map file lasts
        """Start with an empty map."""
        self._slam = SLAMS[self.options.slam](SlamConfig(particles=self.options.particles), self.options.seed)
        self._track = (self.options.out / "track.bin").open("wb")  # on disk: memory is what is measured
        self._published_s = -np.inf

    def drop(self) -> None:
        """Close the track."""
        self._track.close()

    def take(self, frame: Frame) -> None:
        """Match the scan; publish the window whenever it changed, the whole grid every few seconds."""
        frame.update = self._slam.update(frame.scan, frame.odometry)
        frame.points_base = self._slam.points_base()
        due = frame.drive_s - self._published_s >= PUBLISH_S - 1e-6
        if due if self.options.slam == "gmapping" else frame.update.integrated or self._published_s < 0.0:
            self._published_s = frame.drive_s
            frame.grid = self._slam.view()
        self._track.write(np.asarray(frame.update.T_grid_base, dtype=np.float64).tobytes())

    def finish(self) -> dict[str, Any]:
        """Write the grid map; tell its size."""
        self._track.close()
        if self.options.slam == "gmapping":
            outputs.write_grid(self.options.out, self._slam.view(), se2.IDENTITY)
            track = np.fromfile(self.options.out / "track.bin").reshape(-1, 3)
            np.save(self.options.out / "track.npy", track)
            return {"map_bytes": (self.options.out / "grid.pgm").stat().st_size}
        return {}


class TopologicalMapping(Part):
    """Nodes, edges, localisation data and loop closures in one file."""

    def drop(self) -> None:
        """Close the file."""
        self._mapper.close()

    def begin(self, *, known: bool = False) -> None:
        """Start with an empty file."""
        from lemtomap.topo.config import TopoConfig  # noqa: PLC0415 - only this process holds it
        from lemtomap.topo.file.store import TopoStore  # noqa: PLC0415
        from lemtomap.topo.loops import LoopRecogniser  # noqa: PLC0415
        from lemtomap.topo.mapper import TopoMapper  # noqa: PLC0415

        path = self.options.out / "map.lemto"
        if known:  # topological navigation still reads the first one
            path = Path(shutil.copy(path, path.with_stem("known")))
        else:
            for old in self.options.out.glob("*.lemto*"):
                old.unlink()
        store = (TopoStore.open if known else TopoStore.create)(path, durable=False)
        self._mapper = TopoMapper(TopoConfig(), store, recogniser=LoopRecogniser())
        self._grid: GridView | None = None
        self._node_id = 0

    def take(self, frame: Frame) -> None:
        """Take in what the metric layer said."""
        self._grid = frame.grid or self._grid
        if self._grid is None or frame.update is None:
            return
        self._mapper.update(frame.update, self._grid, frame.points_base)
        frame.view = self._mapper.view()
        if frame.view.associated_id != self._node_id:
            self._node_id = frame.node_id = frame.view.associated_id

    def finish(self) -> dict[str, Any]:
        """Lay the map out for the picture, close the file and tell its size."""
        from lemtomap.robot.output.final_map import final_map  # noqa: PLC0415
        from lemtomap.topo.place import decode_place  # noqa: PLC0415
        from lemtomap.types import EdgeType  # noqa: PLC0415

        _wait_for(self.options.out / "topological navigation.json")
        store = self._mapper.store
        final = final_map(self._mapper)
        walls = [
            se2.transform(final.T_map_node[node_id], decode_place(place.boundary).points)
            for node_id, place in store.places()
            if node_id in final.T_map_node
        ]
        kinds = {kind: number for number, kind in enumerate(EdgeType)}
        ends = [(a, b, kinds[kind]) for a, b, kind in final.edges]
        closures = [
            (edge.source_id, edge.target_id, *edge.T_source_target)
            for edge in store.edges()
            if edge.type is EdgeType.LOOP_CLOSING
        ]
        np.savez_compressed(
            self.options.out / "picture.npz",
            node=np.array([[node_id, *T] for node_id, T in final.T_map_node.items()]),
            born=np.array([[node.node_id, node.created_s] for node in store.nodes()]),
            closure=np.array(closures).reshape(-1, 5),
            edge=np.array(ends),
            walls=np.concatenate([np.zeros((0, 2)), *walls]),
        )
        np.save(self.options.out / "track.npy", final.T_map_base)
        told = {"nodes": len(final.T_map_node), "edges": final.edges_by_type()}
        self._mapper.close()
        return told | {"map_bytes": outputs.file_bytes(self.options.out / "map.lemto")}


def _wait_for(path: Path) -> None:
    """Let the reader of the map close it first: only then does its file take its final size."""
    for _ in range(300):
        if path.exists():
            return
        time.sleep(0.1)
    raise SystemExit(f"{path}: topological navigation did not end")


class MetricNavigation(Part):
    """The costmap around the robot at 5 Hz; the baseline's whole grid besides, whenever it is published."""

    def begin(self, *, known: bool = False) -> None:  # noqa: ARG002 - only the map file lasts
        """Start without obstacles."""
        from lemtomap.nav.config import NavConfig  # noqa: PLC0415 - only this process holds it
        from lemtomap.nav.motion.costmap import Costmap  # noqa: PLC0415
        from lemtomap.nav.surroundings import Surroundings  # noqa: PLC0415

        self._config = NavConfig()
        self._surroundings = Surroundings(self._config)
        self._new_costmap = Costmap
        self._window: Window | None = None
        self._whole: Any = None
        self._planned_s = -np.inf

    def take(self, frame: Frame) -> None:
        """Look at the obstacles; renew the costmap when it is time."""
        view = frame.view if self.options.slam != "gmapping" else self._baseline_view(frame)
        if view is None:
            return
        self._surroundings.take(view, [frame.sighting])
        if frame.drive_s - self._planned_s >= self._config.plan_period_s - 1e-6:
            self._planned_s = frame.drive_s
            self._surroundings.costs(view, view.T_grid_base, frame.drive_s)

    def _baseline_view(self, frame: Frame) -> MapView | None:
        """Renew the global costmap of a published map; return the window around the robot, cut out of it."""
        update = frame.update
        if update is None:
            return None
        if frame.grid is not None:
            costmap = self._new_costmap(self._config.costmap, self._config.body)
            costmap.follow_window(frame.grid)
            self._whole = costmap.build(frame.drive_s, update.T_grid_base[:2])
            self._window = Window(frame.grid)
        if self._window is None:
            return None
        return MapView(
            stamp_s=frame.drive_s,
            grid=self._window.around(update.T_grid_base),
            T_grid_odom=update.T_grid_odom,
            T_grid_base=update.T_grid_base,
            associated_id=1,
            T_grid_node={1: np.zeros(3)},
            edges=(),
            quality=update.quality,
            diversity=update.diversity,
            lost=False,
        )


class Window:
    """The part of a whole grid around the robot, as wide as the rolling window, moved by whole metres."""

    def __init__(self, grid: GridView) -> None:
        self._grid = grid
        self._cut: GridView | None = None
        self._at = np.full(2, np.inf)

    def around(self, T_grid_base: se2.Pose) -> GridView:
        """Return the window; what lies beyond the grid is unknown."""
        if self._cut is not None and np.abs(T_grid_base[:2] - self._at).max() < 1.0:
            return self._cut
        grid, half = self._grid, round(0.5 * SlamConfig().window_m / self._grid.resolution_m)
        corner = np.array(grid.origin_m)
        low = np.floor((T_grid_base[:2] - corner) / grid.resolution_m).astype(int)[::-1] - half
        cells = np.full((2 * half, 2 * half), -1, np.int8)
        begin = np.clip(low, 0, grid.occupancy.shape)
        end = np.clip(low + 2 * half, 0, grid.occupancy.shape)
        into = tuple(slice(b - l, e - l) for b, e, l in zip(begin, end, low, strict=True))
        cells[into] = grid.occupancy[begin[0] : end[0], begin[1] : end[1]]
        cells.setflags(write=False)
        x_m, y_m = corner + low[::-1] * grid.resolution_m
        self._cut = GridView(grid.stamp_s, cells, grid.resolution_m, (float(x_m), float(y_m)))
        self._at = np.array(T_grid_base[:2])
        return self._cut


class TopologicalNavigation(Part):
    """Waits for a goal: follows the map file, and once a node keeps the links around it at hand."""

    def begin(self, *, known: bool = False) -> None:  # noqa: ARG002 - only the map file lasts
        """Open the map when the first node is in it."""
        self._graph: Any = None

    def drop(self) -> None:
        """Close the file."""
        if self._graph is not None:
            self._graph.close()

    def take(self, frame: Frame) -> None:
        """Ask whether the map has changed, as each control cycle does."""
        from lemtomap.topo.file.reader import TopoReader  # noqa: PLC0415 - only this process holds it

        if self._graph is None:
            if not frame.node_id:
                return
            self._graph = TopoReader(self.options.out / "map.lemto")
        _ = self._graph.version
        if frame.node_id:
            self._graph.edges_of(frame.node_id)

    def finish(self) -> dict[str, Any]:
        """Close the file."""
        self.drop()
        return {}


PARTS: dict[str, type[Part]] = {
    "metric mapping": MetricMapping,
    "topological mapping": TopologicalMapping,
    "metric navigation": MetricNavigation,
    "topological navigation": TopologicalNavigation,
}
