"""The whole robot in real time on true pseudo-terminals, the fake hardware at their other ends."""

import asyncio
import re
import signal
import subprocess
import sys
import threading
import time

import psutil
import pytest

from lemtomap.drivers.errors import PortMissing
from lemtomap.drivers.kobuki.session import KobukiSession
from lemtomap.drivers.port import open_serial
from lemtomap.robot.build import build_core
from lemtomap.robot.config import RobotConfig
from lemtomap.robot.devices.recorded import Recording
from lemtomap.robot.devices.recording import Recorder
from lemtomap.robot.devices.replay import replay_events
from lemtomap.robot.doctor.diagnosis import Verdict
from lemtomap.robot.doctor.examine import examine
from lemtomap.robot.missions.missions import Idle, parse_mission
from lemtomap.robot.motion.safety import Reason
from lemtomap.robot.output.onlooker import Onlooker
from lemtomap.robot.runs.runtime import Ports, Runtime
from lemtomap.robot.runs.sim_server import FakeHardware
from lemtomap.robot.runs.warmup import warm_up
from lemtomap.sim import worlds
from lemtomap.sim.serve import PtyServer
from lemtomap.sim.simulator import Simulator

DRIVE = re.compile(rb"\xaa\x55\x06\x01\x04(..)(..).", re.DOTALL)


def runtime_on(hardware, folder, recorder=None):
    core = build_core(RobotConfig(), folder / "map.lemto")
    ports = Ports(lambda: open_serial(hardware.kobuki), lambda: open_serial(hardware.hokuyo))
    return Runtime(core, ports, Onlooker(core.exchange, core.efforts, recorder=recorder))


@pytest.mark.realtime
def test_the_robot_maps_and_drives_in_real_time_and_leaves_nothing_behind(tmp_path, monkeypatch):
    warm_up(RobotConfig())
    naps, sleep = [], asyncio.sleep

    async def counted(delay_s):
        naps.append(delay_s)
        await sleep(delay_s)

    monkeypatch.setattr(asyncio, "sleep", counted)
    process = psutil.Process()
    before = process.num_fds(), threading.active_count()
    with FakeHardware("office", 2) as hardware:
        runtime = runtime_on(hardware, tmp_path, Recorder(tmp_path / "run.mcap"))
        runtime.run(parse_mission("explore"), 10.0)
        runtime.core.close()
        runtime.core.mapping.mapper.topo.trail.close()  # readable until then, for the files a run leaves
        runtime.onlooker.close()
    assert hardware.truth["path_m"] > 0.5
    assert hardware.truth["contacts"] == 0
    assert runtime.core.mapping.scans > 50
    assert process.num_fds() <= before[0] + 1
    assert threading.active_count() == before[1]
    samples = [event for _, told in replay_events(Recording.open(tmp_path)) for event in told.base]
    assert len(samples) > 400
    assert len(naps) < 2.5 * len(samples)  # packets wake the loop; it does not look for them in between
    spent_s = runtime.core.efforts.threads.spent_s()
    assert {"base", "mapping", "navigation", "onlooker"} < set(spent_s)
    assert min(spent_s.values()) >= 0.0


@pytest.mark.realtime
def test_a_crash_in_the_mapping_thread_stops_the_robot_and_is_told(tmp_path):
    with FakeHardware("office", 2) as hardware:
        runtime = runtime_on(hardware, tmp_path)

        def broken(_):
            raise ArithmeticError("broken on purpose")

        runtime.core.mapping.step = broken
        with pytest.raises(ArithmeticError, match="on purpose"):
            runtime.run(Idle(), 20.0)
        runtime.core.close()


@pytest.mark.realtime
@pytest.mark.parametrize(
    ("part", "reason"),
    [("mapping", Reason.MAPPING_HANGS), ("navigation", Reason.NAVIGATION_HANGS)],
    ids=str,
)
def test_a_thread_that_hangs_while_the_robot_drives_stops_it_with_the_reason(tmp_path, part, reason):
    warm_up(RobotConfig())
    hangs, released, sent = threading.Event(), threading.Event(), []
    with FakeHardware("office", 2) as hardware:
        runtime = runtime_on(hardware, tmp_path)
        core = runtime.core
        step, command = getattr(core, part).step, core.command

        def hang(argument):
            if sent and sent[-1].v_mps > 0.1:
                hangs.set()
                released.wait(20.0)
            step(argument)

        def watched(now_s):
            commands = command(now_s)
            sent.append(commands.drive)
            if [each.reason for each in sent[-25:]] == [reason] * 25:  # half a second, and no end to it
                runtime.stop.set()
                released.set()
            return commands

        getattr(core, part).step = hang
        core.command = watched
        runtime.run(parse_mission("explore"), 30.0)
        core.close()
    assert hangs.is_set()
    stopped = [(each.v_mps, each.w_radps) for each in sent if each.reason is reason]
    assert len(stopped) >= 25
    assert set(stopped) == {(0.0, 0.0)}


@pytest.mark.realtime
def test_a_port_that_is_not_there_ends_the_run_at_once(tmp_path):
    hardware = FakeHardware("office", kobuki="/dev/nothing", hokuyo="/dev/nothing")
    runtime = runtime_on(hardware, tmp_path)
    with pytest.raises(PortMissing, match="/dev/nothing"):
        runtime.run(Idle(), 20.0)
    runtime.core.close()


@pytest.mark.realtime
def test_the_doctor_finds_nothing_wrong_with_healthy_hardware():
    with FakeHardware("office", 1) as hardware:
        findings = list(examine(hardware.kobuki, hardware.hokuyo, 2.5))
    assert [str(finding) for finding in findings if finding.verdict is Verdict.FAULT] == []
    assert any("firmware 1.2.0" in str(finding) for finding in findings)
    assert any("682 beams" in str(finding) for finding in findings)


@pytest.mark.realtime
def test_sigterm_while_driving_ends_with_a_stop(tmp_path):
    simulator = Simulator(worlds.load("office"), seed=1)
    server = PtyServer(simulator)
    heard = bytearray()
    port = server._pairs[0][0]
    write = port.write

    def listen(data):
        heard.extend(data)
        write(data)

    port.write = listen
    stop = threading.Event()
    serving = threading.Thread(target=server.serve, args=(stop,))
    serving.start()
    command = [sys.executable, "-m", "lemtomap", "run", "--kobuki", server.kobuki_path]
    command += ["--hokuyo", server.hokuyo_path, "--out", str(tmp_path / "run"), "--mission", "explore"]
    robot = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)  # noqa: S603
    try:
        deadline = time.monotonic() + 60.0
        while time.monotonic() < deadline and not any(
            speed != b"\0\0" for speed, _ in DRIVE.findall(heard[-400:])
        ):
            time.sleep(0.05)
        robot.send_signal(signal.SIGTERM)
        said, _ = robot.communicate(timeout=30)
        assert robot.returncode == 130, said
        time.sleep(0.1)
        assert any(speed != b"\0\0" for speed, _ in DRIVE.findall(heard))
        assert bytes(heard).endswith(KobukiSession().stop_bytes())
        assert (tmp_path / "run" / "map.lemto").exists()
    finally:
        robot.kill()
        stop.set()
        serving.join()
        server.close()
        simulator.close()
