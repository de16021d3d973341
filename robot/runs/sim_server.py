"""The simulator as a process of its own, behind two pseudo-terminals: hardware for all the robot can tell."""

import json
import os
import subprocess
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from lemtomap.errors import BadInput
from lemtomap.robot.child import python
from lemtomap.robot.config import RobotConfig
from lemtomap.se2 import Pose, pose
from lemtomap.sim.mounting import Mounting

END_S = 5.0  # for the server to tell the truth and go


def mounting_of(config: RobotConfig) -> Mounting:
    """Return where the simulated laser sits, so that the robot's settings are true of it."""
    laser = config.laser
    return Mounting((laser.x_m, laser.y_m, laser.yaw_rad), upside_down=laser.is_upside_down)


@dataclass(slots=True)
class FakeHardware:
    """Runs `python -m lemtomap.sim.serve` while it is entered."""

    world: str
    seed: int = 0
    gui: bool = False
    """Open pybullet's own window."""
    mounting: Mounting = field(default_factory=Mounting)
    kobuki: str = ""
    hokuyo: str = ""
    truth: dict[str, Any] = field(default_factory=dict)
    """What the simulator knows of the run: path_m, contacts, contact_s, pose; filled when it has ended."""
    _folder: tempfile.TemporaryDirectory[str] | None = None
    _process: subprocess.Popen[str] | None = None

    def __enter__(self) -> Self:
        """Start the server; raises BadInput with the server's own line when it cannot."""
        command = python("-m", "lemtomap.sim.serve", "--world", self.world, "--seed", str(self.seed))
        command += ["--parent", str(os.getpid())] + ["--gui"] * self.gui
        command += ["--laser=" + ",".join(str(value) for value in self.mounting.T_base_laser)]
        command += ["--upside-down"] * self.mounting.upside_down
        self._folder = tempfile.TemporaryDirectory(prefix="lemtomap-")
        command += ["--truth", str(self._truth_path)]
        with tempfile.TemporaryFile("w+") as errors:
            self._process = subprocess.Popen(  # noqa: S603 - our own interpreter and module
                command, stdout=subprocess.PIPE, stderr=errors, text=True, start_new_session=True
            )
            first = self._read_line()
            if not first:
                self._process.wait()
                errors.seek(0)
                said = errors.read().strip().splitlines()
                raise BadInput(said[-1] if said else "the simulator ended before it began")
        ports = json.loads(first)
        self.kobuki, self.hokuyo = ports["kobuki"], ports["hokuyo"]
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        """Stop the server and keep what it says last."""
        if self._folder is not None:
            self._folder.cleanup()
        if self._process is None:
            return
        self._process.terminate()
        try:
            rest, _ = self._process.communicate(timeout=END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            return
        lines = rest.strip().splitlines()
        self.truth = json.loads(lines[-1]) if lines else {}

    @property
    def _truth_path(self) -> Path:
        assert self._folder is not None  # noqa: S101 - only used while entered
        return Path(self._folder.name) / "truth.txt"

    def true_pose(self) -> Pose | None:
        """Return the latest true T_world_base, None before the simulator has told any."""
        try:
            with self._truth_path.open("rb") as file:
                file.seek(max(0, file.seek(0, os.SEEK_END) - 256))
                lines = file.read().split(b"\n")
        except OSError:
            return None
        fields = lines[-2].split() if len(lines) > 2 else []  # the last piece may be half a line
        return pose(*(float(field) for field in fields[1:4])) if len(fields) == 4 else None

    def _read_line(self) -> str:
        """Return the server's next line, empty when it has gone."""
        assert self._process is not None and self._process.stdout is not None  # noqa: S101, PT018
        return self._process.stdout.readline()
