"""The fake hardware in real time on two pseudo-terminals, for any program that speaks the protocols.

    python -m lemtomap.sim.serve --world office

The first line of output is {"kobuki": "/dev/pts/3", "hokuyo": "/dev/pts/4"}; it serves until interrupted. Its
last line is the truth of the run: {"path_m": ..., "contacts": ..., "contact_s": ..., "pose": [x, y, yaw]}.
"""

import argparse
import json
import os
import select
import signal
import sys
import tempfile
import threading
import time
from pathlib import Path
from types import FrameType
from typing import TextIO

from lemtomap.sim import worlds
from lemtomap.sim.errors import SimError, Unplugged
from lemtomap.sim.link import HostPort
from lemtomap.sim.mounting import Mounting
from lemtomap.sim.pty_port import PtyPort
from lemtomap.sim.simulator import STEP_S, Simulator
from lemtomap.sim.world import Pose2

LATE_S = 0.25  # a machine this far behind gives up the lost time instead of racing after it
TRUTH_PERIOD_S = 0.1


class PtyServer:
    """Joins a simulator's cables to pseudo-terminals and keeps them in step with the wall clock."""

    def __init__(self, simulator: Simulator, truth_log: TextIO | None = None) -> None:
        self._simulator = simulator
        self._links: tempfile.TemporaryDirectory[str] | None = None
        self._pairs = [(port, self._open(port)) for port in (simulator.kobuki, simulator.hokuyo)]
        self._truth_log = truth_log
        self._logged_s = 0.0
        self.lost_s = 0.0
        """Real time given up because the machine was too slow."""

    def _open(self, port: HostPort) -> PtyPort:
        """Open a pseudo-terminal; one that will be unplugged gets a name that stays."""
        if not port.will_unplug:
            return PtyPort()
        if self._links is None:
            self._links = tempfile.TemporaryDirectory(prefix="lemtomap-sim-")
        return PtyPort(Path(self._links.name) / port.name)

    @property
    def kobuki_path(self) -> str:
        """Path of the base's port."""
        return self._pairs[0][1].path

    @property
    def hokuyo_path(self) -> str:
        """Path of the laser's port."""
        return self._pairs[1][1].path

    @property
    def dropped_frames(self) -> int:
        """Frames that nobody read in time."""
        return sum(pty.dropped_frames for _, pty in self._pairs)

    def serve(self, stop: threading.Event, duration_s: float = float("inf")) -> None:
        """Serve until stopped. Holds: simulated time never runs ahead of the wall clock."""
        ahead_s = time.monotonic() - self._simulator.now_s
        end_s = self._simulator.now_s + duration_s
        while not stop.is_set() and self._simulator.now_s < end_s:
            due_s = self._simulator.now_s + STEP_S + ahead_s
            self._listen(due_s)
            behind_s = time.monotonic() - due_s
            if behind_s > LATE_S:
                self.lost_s += behind_s
                ahead_s += behind_s
            self._simulator.advance(self._simulator.now_s + STEP_S)
            self._send()
            self._log_truth()

    def _listen(self, until_s: float) -> None:
        """Wait for the next step, taking commands as they come."""
        while (left_s := until_s - time.monotonic()) > 0:
            select.select([fd for _, pty in self._pairs for fd in pty.awaited], [], [], left_s)
            for port, pty in self._pairs:
                if pty.plugged:
                    _forward(port, pty.heard())

    def _send(self) -> None:
        for port, pty in self._pairs:
            pty.plug(into=port.plugged)
            try:
                frames = port.read_frames()
            except Unplugged:
                continue
            pty.push()
            for frame in frames:
                pty.write(frame.data, answer=frame.answer)

    def _log_truth(self) -> None:
        if self._truth_log is None or self._simulator.now_s < self._logged_s + TRUTH_PERIOD_S:
            return
        self._logged_s = self._simulator.now_s
        x, y, yaw = self._simulator.truth().T_world_base
        self._truth_log.write(f"{self._logged_s:.3f} {x:.4f} {y:.4f} {yaw:.5f}\n")

    def close(self) -> None:
        """Hang up both ports. Closing twice is fine."""
        for _, pty in self._pairs:
            pty.close()
        self._pairs.clear()
        if self._links is not None:
            self._links.cleanup()


def _forward(port: HostPort, heard: list[bytes | None]) -> None:
    for piece in heard:
        try:
            if piece is None:
                port.hang_up()
            else:
                port.write(piece)
        except Unplugged:
            return  # bytes written to a pulled cable are lost


def _stop_without(parent: int, stop: threading.Event) -> None:
    """End the serving when the process that started it is gone."""
    while not stop.wait(0.5):
        if os.getppid() != parent:
            stop.set()


def serve_world(
    world: str,
    seed: int,
    *,
    duration_s: float,
    truth_path: Path | None,
    gui: bool,
    parent: int | None = None,
    mounting: Mounting | None = None,
) -> None:
    """Serve one world until a signal, the end of the time or of the parent process. Raises BadWorld."""
    stop = threading.Event()
    if parent is not None:
        threading.Thread(target=_stop_without, args=(parent, stop), daemon=True).start()

    def on_signal(_number: int, _frame: FrameType | None) -> None:
        stop.set()

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, on_signal)
    built = worlds.load(world)
    for remark in built.remarks:
        sys.stderr.write(f"{remark}\n")
    simulator = Simulator(built, seed, gui=gui, mounting=mounting)
    truth_log = truth_path.open("w", encoding="utf-8", buffering=1) if truth_path is not None else None
    server = PtyServer(simulator, truth_log)
    try:
        _say({"kobuki": server.kobuki_path, "hokuyo": server.hokuyo_path})
        server.serve(stop, duration_s)
    finally:
        truth = simulator.truth()
        server.close()
        simulator.close()
        if truth_log is not None:
            truth_log.close()
    _say(
        {
            "path_m": round(truth.path_m, 3),
            "contacts": truth.contact_count,
            "contact_s": round(truth.contact_s, 2),
            "pose": [round(float(value), 4) for value in truth.T_world_base],
            "lost_s": round(server.lost_s, 2),
        }
    )


def _say(answer: dict[str, object]) -> None:
    try:
        sys.stdout.write(json.dumps(answer) + "\n")
        sys.stdout.flush()
    except BrokenPipeError:
        return  # whoever started us has gone; the ports may still be in use


def _pose(text: str) -> Pose2:
    x, y, yaw = (float(part) for part in text.split(","))
    return (x, y, yaw)


def main() -> int:
    """Read the arguments and serve."""
    parser = argparse.ArgumentParser(
        prog="python -m lemtomap.sim.serve", description="The fake hardware alone."
    )
    parser.add_argument(
        "--world", default=worlds.names()[0], help="a built-in world, a map .yaml or a world .toml"
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--duration", type=float, default=float("inf"), help="seconds; default: until interrupted"
    )
    parser.add_argument("--truth", type=Path, default=None, help="write the true poses to this file, 10 Hz")
    parser.add_argument("--gui", action="store_true", help="open pybullet's window")
    parser.add_argument("--parent", type=int, default=None, help="end when this parent process is gone")
    parser.add_argument(
        "--laser", type=_pose, default=(0.0, 0.0, 0.0), metavar="X,Y,YAW", help="where it sits"
    )
    parser.add_argument("--upside-down", action="store_true", help="the laser hangs upside down")
    arguments = parser.parse_args()
    try:
        serve_world(
            arguments.world,
            arguments.seed,
            duration_s=arguments.duration,
            truth_path=arguments.truth,
            gui=arguments.gui,
            parent=arguments.parent,
            mounting=Mounting(arguments.laser, upside_down=arguments.upside_down),
        )
    except SimError as error:
        sys.stderr.write(f"{error}\n")
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
