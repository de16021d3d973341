"""The part that only looks: the live viewer, the recorder and the lines the user reads.

It reads mailboxes and may come too late for some of what lay in them; it counts that and slows nobody down.
Only the raw bytes of the ports are queued for it, deep enough for minutes of a stalled disk. A recorder or a
viewer that fails is left out from then on, which is said; the run goes on without.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, TypeVar

import numpy as np

from lemtomap import se2
from lemtomap.nav.types import NavOutput
from lemtomap.robot.core import Efforts
from lemtomap.robot.devices.mapped_scan import to_values
from lemtomap.robot.devices.recording import SCAN_TOPIC, RecordedCall, Recorder
from lemtomap.robot.exchange import (
    BaseStatus,
    Exchange,
    Note,
    NoteLevel,
    TimedScan,
)
from lemtomap.robot.mailbox import BoundedQueue, Latest
from lemtomap.robot.output.viewer import Viewer
from lemtomap.robot.runs.ending import reason_of
from lemtomap.types import MapView, Twist

LOOK_PERIOD_S = 0.1  # between two looks at a run: as often as the viewer takes a pose
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
        self.raw: BoundedQueue[RecordedCall] = BoundedQueue("bytes for the recorder", RAW_WAITING)
        self.skipped: dict[str, int] = {}
        """How many snapshots of each kind came and went between two looks."""
        self.over = ""
        """Why the run must end now; empty while it may go on."""
        self._exchange, self._efforts = exchange, efforts
        self._viewer, self._recorder, self._say = viewer, recorder, say
        self.now_s = 0.0
        """Time of the last look."""
        self._versions: dict[str, int] = {}
        self._node_poses: dict[int, se2.Pose] = {}

    def look(self, now_s: float) -> None:
        """Take everything that is new; call it about ten times a second."""
        exchange, self.now_s = self._exchange, now_s
        notes, entries, mapped = exchange.notes.drain(), self.raw.drain(), exchange.mapped_scans.drain()
        view = self._fresh("map", exchange.map_view)
        scan = self._fresh("scan", exchange.last_scan)
        output = self._fresh("navigation", exchange.nav_output)
        status = self._fresh("base", exchange.base_status)
        for note in notes:
            if self._say is not None:
                self._say(note)
        if self._recorder is not None:
            try:
                for each in mapped:
                    self._recorder.derived(SCAN_TOPIC, now_s, to_values(each))
                self._record(self._recorder, now_s, notes, entries, view, output, status)
            except Exception as error:  # noqa: BLE001 - whatever it is, the robot drives on
                self._end_recorder(f"{self._recorder.parts.path} ends here: {reason_of(error)}")
        if self._viewer is not None:
            try:
                self._show(self._viewer, now_s, notes, view, scan, output, status)
            except Exception as error:  # noqa: BLE001 - as above
                self._viewer = None
                self.warn("viewer", f"shows nothing any more: {reason_of(error)}")

    def end_recordings(self, why: str) -> None:
        """Write both recordings no further, for the reason given; the window goes on."""
        if self._recorder is not None:
            self._end_recorder(f"{self._recorder.parts.path} ends here: {why}")
        if self._viewer is not None:
            self._viewer.end_file(why)

    def _end_recorder(self, line: str) -> None:
        recorder, self._recorder = self._recorder, None
        self.warn("recorder", line)
        with suppress(Exception):  # it may fail once more; what stands in the file stays readable
            if recorder is not None:
                recorder.close()

    def warn(self, source: str, text: str) -> None:
        """Leave a line for the user, from any thread."""
        self._exchange.note(self.now_s, source, text, NoteLevel.WARN)

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

    def _show(
        self,
        viewer: Viewer,
        now_s: float,
        notes: Sequence[Note],
        view: MapView | None,
        scan: TimedScan | None,
        output: NavOutput | None,
        status: BaseStatus | None,
    ) -> None:
        for note in notes:
            viewer.say(note.stamp_s, note.source, note.text, note.level)
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
        notes: Sequence[Note],
        entries: Sequence[RecordedCall],
        view: MapView | None,
        output: NavOutput | None,
        status: BaseStatus | None,
    ) -> None:
        for entry in entries:
            recorder.raw(entry)
        for note in notes:
            values = {"source": note.source, "level": note.level, "text": note.text}
            recorder.derived("/log", note.stamp_s, values)
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
