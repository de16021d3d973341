"""The robot in real time against the clock: reactions, unplugged cables, processor shares, sudden death.

    lemtomap bench runtime bumps [1000]     bumper bit in a packet -> stop command's bytes on the wire
    lemtomap bench runtime plugs [40]       plugs pulled so often while driving: stop, data back, leaks
    lemtomap bench runtime cpu [60]         shares of one core over so many seconds of a mission
    lemtomap bench runtime kill             kill -9 while driving; then the next start
    lemtomap bench runtime noise [180]      a mission with lost bytes, flipped bits, bursts (lock-step)

Everything but `noise` runs on pseudo-terminals with the fake hardware in a process of its own, and maps.
"""

import argparse
import json
import os
import resource
import signal
import subprocess
import tempfile
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from lemtomap.drivers.port import open_serial
from lemtomap.robot.build import build_core
from lemtomap.robot.child import python
from lemtomap.robot.config import RobotConfig
from lemtomap.robot.devices.recording import Recorder
from lemtomap.robot.missions.missions import Idle, Mission, parse_mission
from lemtomap.robot.output.onlooker import Onlooker
from lemtomap.robot.runs.lockstep import run_lockstep
from lemtomap.robot.runs.runtime import Ports, Runtime
from lemtomap.robot.runs.warmup import warm_up
from lemtomap.sim import worlds
from lemtomap.sim.faults import Faults, LinkFaults
from lemtomap.sim.simulator import Simulator
from lemtomap.types import Twist

ROOT = Path(__file__).resolve().parents[2]
CIRCLE = Twist(0.2, 0.7)


@dataclass(slots=True)
class Hardware:
    """The fake robot in its own process."""

    process: subprocess.Popen[str]
    kobuki: str
    hokuyo: str

    @classmethod
    def start(cls, what: str, count: int) -> "Hardware":
        """Start it and learn its paths."""
        command = python(str(ROOT / "tools" / "measured_hardware.py"), what, str(count))
        environment = dict(os.environ, PYTHONPATH=str(ROOT))
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)  # noqa: S603
        assert process.stdout is not None  # noqa: S101
        paths = json.loads(process.stdout.readline())
        return cls(process, paths["kobuki"], paths["hokuyo"])

    def end(self) -> dict[str, Any]:
        """End it and return what it measured."""
        self.process.terminate()
        text, _ = self.process.communicate(timeout=20)
        told: dict[str, Any] = json.loads(text.strip().splitlines()[-1])
        return told


def real_run(hardware: Hardware, mission: Mission, duration_s: float, *, circle: bool) -> Runtime:
    """Drive the real-time robot until the time is up or the hardware has seen enough."""
    folder = Path(tempfile.mkdtemp(prefix="lemtomap-bench-"))
    core = build_core(RobotConfig(), folder / "map.lemto")
    onlooker = Onlooker(core.exchange, core.efforts, None, Recorder(folder / "run.mcap"))
    ports = Ports(partial(open_serial, hardware.kobuki), partial(open_serial, hardware.hokuyo))
    runtime = Runtime(core, ports, onlooker)

    def steer() -> None:
        while not runtime.stop.wait(0.1):
            if circle:
                core.base.teleop(CIRCLE, runtime.clock.now_s())
            if hardware.process.poll() is not None:
                runtime.stop.set()

    threading.Thread(target=steer, daemon=True).start()
    runtime.run(mission, duration_s)
    core.close()
    onlooker.close()
    return runtime


def row(name: str, values: Sequence[float], unit: str = "ms", scale: float = 1e3) -> None:
    """Print one measured distribution."""
    v = scale * np.array(values)
    median, worst = np.median(v), np.percentile(v, 99)
    print(f"{name:34} n {len(v):5}  median {median:8.1f}  p99 {worst:8.1f}  max {v.max():8.1f} {unit}")


def measure_events(what: str, count: int) -> None:
    """Bumps or plugs: the hardware decides when, the robot drives in circles and maps."""
    warm_up(RobotConfig())
    hardware = Hardware.start(what, count)
    process = psutil.Process()
    before = (process.num_fds(), threading.active_count())
    runtime = real_run(hardware, Idle(), 7200.0, circle=True)
    time.sleep(0.5)
    after = (process.num_fds(), threading.active_count())
    told = hardware.end()
    for name, values in told["measured"].items():
        row(name, values)
    print(f"scans mapped {runtime.core.mapping.scans}; dropped {runtime.core.exchange.dropped()}")
    print(f"file descriptors {before[0]} -> {after[0]}, threads {before[1]} -> {after[1]}")


def measure_cpu(seconds: float) -> None:
    """Explore and share out the processor time."""
    warm_up(RobotConfig())
    hardware = Hardware.start("still", 0)
    begun, wall = resource.getrusage(resource.RUSAGE_SELF), time.monotonic()
    runtime = real_run(hardware, parse_mission("explore"), seconds, circle=False)
    ended, wall = resource.getrusage(resource.RUSAGE_SELF), time.monotonic() - wall
    told = hardware.end()
    efforts = runtime.core.efforts
    spent_s = efforts.threads.spent_s()
    whole = ended.ru_utime + ended.ru_stime - begun.ru_utime - begun.ru_stime
    parts = {
        "both drivers": spent_s["base"] - efforts.base.cpu_s,
        "odometry, velocity, safety": efforts.base.cpu_s,
        "mapping": efforts.mapping.cpu_s,
        "navigation": efforts.navigation.cpu_s,
        "viewer and recorder": spent_s["onlooker"],
        "whole program": whole,
    }
    for name, cpu_s in parts.items():
        print(f"{name:34} {100.0 * cpu_s / wall:6.1f} % of one core")
    for name in ("mapping", "navigation"):
        effort = getattr(efforts, name)
        print(f"{name:34} worst {1e3 * effort.worst_s:.1f} ms CPU of {effort.calls} calls")
    print(f"driven {told['path_m']:.1f} m, contacts {told['contacts']}, lost_s {told['lost_s']:.2f}")


def measure_kill() -> None:
    """Kill the program while it drives; the base must stop by itself; start again on the streaming sensor."""
    warm_up(RobotConfig())
    hardware = Hardware.start("still", 0)
    command = python("-m", "lemtomap", "run", "--kobuki", hardware.kobuki, "--hokuyo", hardware.hokuyo)
    environment = dict(os.environ, PYTHONPATH=str(ROOT))
    out = tempfile.mkdtemp(prefix="lemtomap-kill-")
    victim = subprocess.Popen([*command, "--mission", "explore", "--out", out], env=environment)  # noqa: S603
    time.sleep(20.0)
    os.kill(victim.pid, signal.SIGKILL)
    victim.wait()
    time.sleep(1.5)
    notes: list[tuple[float, str]] = []
    folder = Path(tempfile.mkdtemp(prefix="lemtomap-bench-"))
    core = build_core(RobotConfig(), folder / "map.lemto")
    onlooker = Onlooker(core.exchange, core.efforts, say=lambda note: notes.append((note.stamp_s, note.text)))
    ports = Ports(partial(open_serial, hardware.kobuki), partial(open_serial, hardware.hokuyo))
    Runtime(core, ports, onlooker).run(Idle(), 5.0)
    core.close()
    told = hardware.end()
    print(
        f"after kill -9 the base ran {told['path_m']:.2f} m in all; speed at end {told['speed_at_end_mps']}"
    )
    for stamp_s, text in notes:
        print(f"  {stamp_s:6.3f} s  {text}")


def measure_noise(seconds: float) -> None:
    """A mission over bad cables, in lock-step."""
    noise = LinkFaults(lose_byte=1e-3, flip_bit=1e-4, burst_s=0.016)
    simulator = Simulator(worlds.load("office"), seed=3, faults=Faults(kobuki=noise, hokuyo=noise))
    folder = Path(tempfile.mkdtemp(prefix="lemtomap-bench-"))
    core = build_core(RobotConfig(), folder / "map.lemto", durable=False)
    ended = run_lockstep(simulator, core, parse_mission("explore,goto:start"), seconds)
    truth = simulator.truth()
    print(f"{ended.text} at {ended.now_s:.0f} s; driven {truth.path_m:.1f} m, contacts {truth.contact_count}")
    print(f"scans mapped {core.mapping.scans} of {10 * ended.now_s:.0f}")
    core.close()


def main() -> None:
    """Measure what was asked for."""
    parser = argparse.ArgumentParser(
        prog="lemtomap bench runtime",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "what", nargs="?", default="bumps", choices=("bumps", "plugs", "cpu", "kill", "noise")
    )
    parser.add_argument("number", nargs="?", type=float, help="how many, or for how many seconds")
    args = parser.parse_args()
    number: float | None = args.number
    if args.what in {"bumps", "plugs"}:
        measure_events(args.what, int(number or {"bumps": 1000, "plugs": 40}[args.what]))
    elif args.what == "cpu":
        measure_cpu(number or 60.0)
    elif args.what == "kill":
        measure_kill()
    else:
        measure_noise(number or 180.0)


if __name__ == "__main__":
    main()
