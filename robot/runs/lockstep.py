"""The robot and its simulated world, step by step on one virtual clock: fast, and the same every time."""

from collections.abc import Callable

from lemtomap.robot.core import RobotCore, Samples
from lemtomap.robot.devices.indicators import signal_bytes
from lemtomap.robot.devices.recording import HOKUYO, KOBUKI
from lemtomap.robot.devices.wire import (
    RecordedHokuyoSession,
    RecordedKobukiSession,
    Sink,
    Wire,
)
from lemtomap.robot.exchange import Ended, MissionState
from lemtomap.robot.missions.missions import Mission
from lemtomap.sim.errors import Unplugged
from lemtomap.sim.simulator import Simulator

PERIOD_NS = 20_000_000  # one feedback packet of the base
SETTLE_STEPS = 50  # steps after the end of a mission, for the last scans and a standing robot


def run_lockstep(
    simulator: Simulator,
    core: RobotCore,
    mission: Mission,
    duration_s: float,
    record: Sink | None = None,
    watch: Callable[[float], None] | None = None,
) -> Ended:
    """Run until the mission is over or the time is up; the last bytes to the base are a stop.

    `watch` is called after each step with the virtual time. Same simulator seed, core, mission: same bytes.
    """
    keep = record if record is not None else _forget
    base_session = RecordedKobukiSession(keep, core.devices.kobuki)
    base = Wire(KOBUKI, simulator.kobuki, base_session, keep, Unplugged)
    laser = Wire(HOKUYO, simulator.hokuyo, RecordedHokuyoSession(keep, core.devices.hokuyo), keep, Unplugged)
    core.navigation.set_mission(mission)
    core.permit()
    now_ns = round(simulator.now_s * 1e9)
    end_ns, left = now_ns + round(duration_s * 1e9), SETTLE_STEPS
    try:
        while now_ns < end_ns and left > 0:
            now_ns += PERIOD_NS
            now_s = now_ns * 1e-9
            simulator.advance(now_s)
            told = base.poll(now_s), laser.poll(now_s)
            commands = core.step(Samples(*told, base.lost + laser.lost), now_s)
            base.write(base_session.drive(commands.drive.v_mps, commands.drive.w_radps), now_s)
            for signal in commands.signals:
                base.write(signal_bytes(base_session, signal), now_s)
            if watch is not None:
                watch(now_s)
            status = core.exchange.mission.get()
            left -= status is not None and status.state.over
    finally:
        core.halt()
        base.write(base_session.stop_bytes(), now_ns * 1e-9)
    status = core.exchange.mission.get()
    state, text = (status.state, status.text) if status else (MissionState.WAITING, "no map yet")
    return Ended(now_ns * 1e-9, state, text)


def _forget(_: object) -> None:
    """Keep no record."""
