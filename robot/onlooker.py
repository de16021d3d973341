"""The part that only looks: the live viewer, the recorder and the lines the user reads.

It reads mailboxes and may come too late for some of what lay in them; it counts that and slows nobody down.
Only the raw bytes of the ports are queued for it, deep enough for minutes of a stalled disk.
"""

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np

from lemtomap import se2
from lemtomap.nav.types import NavOutput
from lemtomap.types import MapView, Twist
from robot.core import Efforts
from robot.exchange import BaseStatus, Exchange, Note, TimedScan
from robot.mailbox import BoundedQueue, Latest
from robot.mapped import to_values
from robot.recording import SCAN_TOPIC, Entry, Recorder
from robot.viewer import Viewer

RAW_WAITING = 200_000  # calls of both sessions in some ten minutes
T = TypeVar("T")


class Onlooker:
    """Shows and records what happened since the last look. Called from one thread."""

    def __init__(
        self,
        exchange: Exchange,
        efforts: Efforts,
        viewer: Viewer | None = None,
        recorder: Recorder | None = None,
        say: Callable[[Note], None] | None = None,
    ) -> None:
        self.raw: BoundedQueue[Entry] = BoundedQueue("bytes for the recorder", RAW_WAITING)
        self.skipped: dict[str, int] = {}
        """How many snapshots of each kind came and went between two looks."""
        self._exchange, self._efforts = exchange, efforts
        self._viewer, self._recorder, self._say = viewer, recorder, say
        self._versions: dict[str, int] = {}
        self._node_poses: dict[int, se2.Pose] = {}

    def look(self, now_s: float) -> None:
        """Take everything that is new; call it about ten times a second."""
        exchange = self._exchange
        self._tell(exchange.notes.drain())
        if self._recorder is not None:
            for entry in self.raw.drain():
                self._recorder.raw(entry)
            for mapped in exchange.mapped.drain():
                self._recorder.derived(SCAN_TOPIC, now_s, to_values(mapped))
        view = self._fresh("map", exchange.map_view)
        scan = self._fresh("scan", exchange.last_scan)
        output = self._fresh("navigation", exchange.nav_output)
        status = self._fresh("base", exchange.base_status)
        if self._recorder is not None:
            self._record(self._recorder, now_s, view, output, status)
        if self._viewer is not None:
            self._show(self._viewer, now_s, view, scan, output, status)

    def close(self) -> None:
        """Finish the recordings."""
        for part in (self._viewer, self._recorder):
            if part is not None:
                part.close()

    def _fresh(self, name: str, box: Latest[T]) -> T | None:
        """Return the newest value if it is new; count those never seen."""
        version, seen = box.version, self._versions.get(name, 0)
        self._versions[name] = version
        if version == seen:
            return None
        self.skipped[name] = self.skipped.get(name, 0) + version - seen - 1
        return box.get()

    def _tell(self, notes: Sequence[Note]) -> None:
        for note in notes:
            if self._say is not None:
                self._say(note)
            if self._viewer is not None:
                self._viewer.say(note.stamp_s, note.source, note.text, note.level)
            if self._recorder is not None:
                values = {"source": note.source, "level": note.level, "text": note.text}
                self._recorder.derived("/log", note.stamp_s, values)

    def _show(
        self,
        viewer: Viewer,
        now_s: float,
        view: MapView | None,
        scan: TimedScan | None,
        output: NavOutput | None,
        status: BaseStatus | None,
    ) -> None:
        if view is not None:
            self._node_poses = dict(view.T_grid_node)
            viewer.show_map(now_s, view)
            points = scan.sighting.hits_base if scan is not None else None
            viewer.show_robot(now_s, view.T_grid_base, points)
            last_ms = {
                "mapping": 1e3 * self._efforts.mapping.last_s,
                "navigation": 1e3 * self._efforts.navigation.last_s,
                "base": 1e3 * self._efforts.base.last_s,
            }
            viewer.show_timing(now_s, last_ms)
        if output is not None:
            route = [self._node_poses[node][:2] for node in output.route if node in self._node_poses]
            viewer.show_plan(
                now_s,
                state=str(output.state),
                route_grid=np.array(route).reshape(-1, 2),
                path_grid=output.local_path_grid,
                costmap=output.costmap,
            )
        if status is not None:
            wanted = status.wish.twist if status.wish is not None else Twist()
            measured = status.odometry
            wheels = Twist(measured.v_mps, measured.w_radps) if measured is not None else Twist()
            viewer.show_velocity(now_s, wanted, Twist(status.sent.v_mps, status.sent.w_radps), wheels)
            viewer.show_figure(now_s, "battery_v", status.battery_v)

    def _record(
        self,
        recorder: Recorder,
        now_s: float,
        view: MapView | None,
        output: NavOutput | None,
        status: BaseStatus | None,
    ) -> None:
        if view is not None:
            recorder.derived("/pose", view.stamp_s, _pose_values(view))
        if output is not None:
            values = {"state": output.state, "reason": output.reason, "text": output.text}
            recorder.derived("/navigation", output.stamp_s, {**values, "route": list(output.route)})
        if status is not None:
            recorder.derived("/base", now_s, _base_values(status))


def _pose_values(view: MapView) -> dict[str, Any]:
    x, y, yaw = (float(value) for value in view.T_grid_base)
    return {
        "x_m": x,
        "y_m": y,
        "yaw_rad": yaw,
        "frame": "grid",
        "node": view.associated_id,
        "quality": view.quality,
        "diversity": view.diversity,
        "lost": view.lost,
    }


def _base_values(status: BaseStatus) -> dict[str, Any]:
    values: dict[str, Any] = {
        "sent_v_mps": status.sent.v_mps,
        "sent_w_radps": status.sent.w_radps,
        "reason": status.sent.reason,
        "battery_v": status.battery_v,
    }
    if status.odometry is not None:
        x, y, yaw = (float(value) for value in status.odometry.T_odom_base)
        values |= {"odom_x_m": x, "odom_y_m": y, "odom_yaw_rad": yaw}
        values |= {"v_mps": status.odometry.v_mps, "w_radps": status.odometry.w_radps}
    return values
