"""One robot in one world on a virtual clock: host ends of two cables, and the truth beside them."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from lemtomap.sim.base import BIT_RATE, Base, BaseConfig
from lemtomap.sim.body import BodyState
from lemtomap.sim.depth import DepthCamera, DepthConfig
from lemtomap.sim.faults import Faults
from lemtomap.sim.hokuyo import FakeHokuyoConfig, HokuyoFirmware
from lemtomap.sim.link import HostPort, Link
from lemtomap.sim.mounting import Mounting
from lemtomap.sim.scene import Scene
from lemtomap.sim.urg import Urg, UrgConfig
from lemtomap.sim.world import World

STEP_S = 0.010  # physics; at 0.7 m/s the body moves 7 mm
USB_S = 0.001  # one USB frame
SCAN_USB_S = 0.003  # 2137 bytes in 64-byte packets at full speed


@dataclass(frozen=True, slots=True)
class SimConfig:
    """How the robot is built."""

    base: BaseConfig = field(default_factory=BaseConfig)
    urg: UrgConfig = field(default_factory=UrgConfig)
    depth: DepthConfig = field(default_factory=DepthConfig)
    scanner: FakeHokuyoConfig = field(default_factory=FakeHokuyoConfig)


@dataclass(frozen=True, slots=True)
class Turn:
    """One turn of the laser as it was measured, for recorders and checks."""

    started_s: float
    """When step 0 was passed."""
    ranges_mm: NDArray[np.int64]
    """int64 (769,): mm or error codes by step."""


@dataclass(frozen=True, slots=True)
class Truth:
    """What only the simulator knows. For reports and tests, never for the robot."""

    stamp_s: float
    T_world_base: NDArray[np.float64]
    """float64 (3,): x m, y m, yaw rad in [-pi, pi)."""
    height_m: float
    path_m: float
    """Distance driven by the middle of the body."""
    contact_count: int
    """How often the body began to touch something."""
    contact_s: float
    touching: bool
    room: str | None


class Simulator:
    """The devices and the world behind them. Same seed and same bytes in give the same bytes out."""

    def __init__(
        self,
        world: World,
        seed: int = 0,
        faults: Faults | None = None,
        config: SimConfig | None = None,
        *,
        gui: bool = False,
        mounting: Mounting | None = None,
    ) -> None:
        """`mounting`: where the laser sits, if not where `config` has it."""
        faults = faults or world.faults or Faults()
        config = _with_faults(config or SimConfig(), faults)
        if mounting is not None:
            config = replace(config, urg=replace(config.urg, mounting=mounting))
        base_rng, urg_rng, kobuki_rng, hokuyo_rng, mover_rng, depth_rng = np.random.default_rng(seed).spawn(6)
        self.world = world
        self.config = config
        self.now_s = 0.0
        self.last_scan: Turn | None = None
        self._gui = gui
        self._ticks = 0
        self._path_m = 0.0
        self._scene = Scene(world, gui=gui)
        self.base = Base(world, self._scene, config.base, base_rng)
        self._urg = Urg(self._scene, config.urg, urg_rng)
        self.scanner = HokuyoFirmware(config.scanner)
        self._kobuki = Link("kobuki", faults.kobuki, kobuki_rng, lambda: self.now_s)
        self._hokuyo = Link("hokuyo", faults.hokuyo, hokuyo_rng, lambda: self.now_s)
        self.camera = DepthCamera(self._scene, config.depth, depth_rng)
        self._motions = [mover.begin(int(mover_rng.integers(1 << 31))) for mover in world.movers]

    @property
    def kobuki(self) -> HostPort:
        """Host end of the base's cable."""
        return self._kobuki.host

    @property
    def hokuyo(self) -> HostPort:
        """Host end of the laser's cable."""
        return self._hokuyo.host

    def advance(self, until_s: float) -> None:
        """Let time pass. Commands written before take effect at the next physics step."""
        while (self._ticks + 1) * STEP_S <= until_s + 1e-9:
            self._tick()
        self.now_s = max(self.now_s, until_s)

    def close(self) -> None:
        """Free the physics engine. Closing twice is fine."""
        self._scene.close()

    def truth(self) -> Truth:
        """Return where the robot really is and what it has touched."""
        body = self.base.body
        x, y, yaw = body.state.pose
        return Truth(
            stamp_s=self._ticks * STEP_S,
            T_world_base=np.array([x, y, (yaw + math.pi) % (2 * math.pi) - math.pi]),
            height_m=body.state.height_m,
            path_m=self._path_m,
            contact_count=body.contact_count,
            contact_s=body.contact_s,
            touching=bool(body.contacts),
            room=self.world.truth.room_at(x, y, self.world.level_at(body.state.height_m)),
        )

    def depth_image(self) -> NDArray[np.float32]:
        """Return what the depth camera sees now, float32 (rows, columns), metres, NaN nothing."""
        return self.camera.capture(self.base.body.state)

    def perfect_scan_m(self, state: BodyState) -> NDArray[np.float64]:
        """Return what a laser without noise would see from a place, float64 (682,), +inf beyond reach."""
        return self._urg.true_ranges_m(state)

    def _tick(self) -> None:
        begin, end = self._ticks * STEP_S, (self._ticks + 1) * STEP_S
        self._listen(begin)
        before = self.base.body.state
        for index, motion in enumerate(self._motions):
            self._scene.place_mover(index, motion.step(end, STEP_S, before.pose))
        due = self.base.packet_s
        packet = self.base.step(end, STEP_S)
        self._kobuki.deliver(packet, due + len(packet) * 10.0 / BIT_RATE + USB_S)
        after = self.base.body.state
        if self._gui:
            self._scene.show_robot(after.pose, after.height_m)
        self._path_m += math.hypot(after.x - before.x, after.y - before.y)
        scan = self._urg.step(begin, end, before, after, laser_on=self.scanner.laser_on, rpm=self.scanner.rpm)
        if scan is not None:
            self.last_scan = Turn(self._urg.finished_s, scan)
            reply = self.scanner.scan_done(self._urg.finished_s, scan)
            self._hokuyo.deliver(reply, end + SCAN_USB_S, answer=not self.scanner.streaming)
        self._ticks += 1
        self.now_s = end

    def _listen(self, now_s: float) -> None:
        """Hand what the host has written to the devices."""
        data = b"".join(piece for piece in self._kobuki.collect() if piece)
        if data:
            self.base.firmware.receive(data, now_s)
        for commands, closed in _by_client(self._hokuyo.collect()):
            reply = self.scanner.receive(commands, now_s)
            if closed:
                self.scanner.hung_up()
            else:
                self._hokuyo.deliver(reply, now_s + USB_S, answer=True)


def _by_client(pieces: list[bytes | None]) -> Iterator[tuple[bytes, bool]]:
    """Return each client's commands together, and whether it has closed the port after them."""
    commands = b""
    for piece in pieces:
        if piece is None:
            yield commands, True
            commands = b""
        else:
            commands += piece
    if commands:
        yield commands, False


def _with_faults(config: SimConfig, faults: Faults) -> SimConfig:
    body = replace(config.base.body, stuck_left=faults.stuck_left, stuck_right=faults.stuck_right)
    return replace(
        config,
        base=replace(config.base, body=body),
        urg=replace(config.urg, blocked=faults.blocked_laser),
    )
