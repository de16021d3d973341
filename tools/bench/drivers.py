"""What the drivers cost and what they endure, measured against the fake hardware.

python -m tools.bench.drivers                     everything, about three minutes
python -m tools.bench.drivers cpu kill            only these

cpu      share of a core both drivers take in real time on pseudo-terminals (50 Hz + 10 Hz, commands at 50 Hz)
kill     kill -9 a program while it streams; seconds until the next one has a scan
replug   20 unplugs of each cable at random times; seconds from replug to data, descriptors and threads left
noise    lost bytes 1e-3, flipped bits 1e-4, bursts of 16 ms on a virtual clock; recovered, damaged, false
"""

import argparse
import asyncio
import contextlib
import json
import os
import random
import signal
import subprocess
import tempfile
import threading
import time
import tty
from collections.abc import AsyncIterator, Iterator
from pathlib import Path

import numpy as np
import psutil

from lemtomap.drivers.hokuyo.driver import HokuyoDriver
from lemtomap.drivers.hokuyo.events import LaserScan
from lemtomap.drivers.hokuyo.session import HokuyoSession
from lemtomap.drivers.kobuki.driver import KobukiDriver
from lemtomap.drivers.kobuki.events import KobukiSample
from lemtomap.drivers.kobuki.session import KobukiSession
from lemtomap.drivers.port import open_serial
from lemtomap.robot.child import python
from lemtomap.sim import worlds
from lemtomap.sim.faults import Faults, LinkFaults
from lemtomap.sim.simulator import Simulator


@contextlib.contextmanager
def served_hardware() -> Iterator[tuple[str, str]]:
    """Serve the fake hardware from a process of its own; give the two paths."""
    command = python("-m", "lemtomap.sim.serve", "--world", "office")
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:  # noqa: S603  # our own program
        try:
            if server.stdout is None:
                raise RuntimeError("no output of the fake hardware")
            paths = json.loads(server.stdout.readline())
            yield paths["kobuki"], paths["hokuyo"]
        finally:
            server.send_signal(signal.SIGINT)
            server.wait(10)


class Robot:
    """Both drivers on two paths, driving in circles, and what they gave."""

    def __init__(self, kobuki_path: str, hokuyo_path: str) -> None:
        self.samples = self.scans = 0
        self.kobuki = KobukiDriver(lambda: open_serial(kobuki_path), time.monotonic, self._take_base)
        self.hokuyo = HokuyoDriver(lambda: open_serial(hokuyo_path), time.monotonic, self._take_laser)

    def _take_base(self, event: object) -> None:
        if isinstance(event, KobukiSample):
            self.samples += 1
            self.kobuki.drive(0.1, 0.4)

    def _take_laser(self, event: object) -> None:
        self.scans += isinstance(event, LaserScan)

    async def run(self) -> None:
        """Run until cancelled."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self.kobuki.run())
            group.create_task(self.hokuyo.run())

    async def until_data(self, limit_s: float = 10.0) -> float:
        """Return the seconds until both have given something new."""
        begin, samples, scans = time.monotonic(), self.samples, self.scans
        while self.samples == samples or self.scans == scans:  # looking from outside
            if time.monotonic() > begin + limit_s:
                raise TimeoutError(f"no data for {limit_s} s")
            await asyncio.sleep(0.005)
        return time.monotonic() - begin


@contextlib.asynccontextmanager
async def running(robot: Robot) -> AsyncIterator["asyncio.Task[None]"]:
    """Run a robot around a block."""
    task = asyncio.create_task(robot.run())
    try:
        yield task
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task


async def measure_cpu(seconds: float) -> None:
    """Print the share of a core."""
    with served_hardware() as paths:
        robot = Robot(*paths)
        async with running(robot):
            await robot.until_data()
            cpu_s, wall_s, samples, scans = time.process_time(), time.monotonic(), robot.samples, robot.scans
            await asyncio.sleep(seconds)
            wall_s = time.monotonic() - wall_s
            share = (time.process_time() - cpu_s) / wall_s
            rates = ((robot.samples - samples) / wall_s, (robot.scans - scans) / wall_s)
    print(f"cpu: {share:.2%} of a core at {rates[0]:.1f} packets/s and {rates[1]:.1f} scans/s")


async def _stream_for_ever(paths: tuple[str, str]) -> None:
    robot = Robot(*paths)
    async with running(robot) as task:
        await robot.until_data()
        print("streaming", flush=True)
        await task


async def measure_kill() -> None:
    """Print how long the next program takes."""
    with served_hardware() as paths:
        command = python("-m", "tools.bench.drivers", "--stream", *paths)
        times = []
        for _ in range(5):
            pipe = subprocess.PIPE
            with subprocess.Popen(command, stdout=pipe, text=True) as victim:  # noqa: ASYNC220, S603
                if victim.stdout is not None:
                    await asyncio.to_thread(victim.stdout.readline)
                victim.kill()
            robot = Robot(*paths)
            async with running(robot):
                times.append(await robot.until_data())
    print(
        f"kill -9, then a new start: packets and scans after {max(times):.2f} s at most ({len(times)} trials)"
    )


class Extension:
    """A cable that can be pulled: relays a served port to a pseudo-terminal behind a stable link."""

    def __init__(self, link: Path, inner: str) -> None:
        self._link = link
        self._inner = os.open(inner, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        tty.setraw(self._inner)
        self._outer: tuple[int, int] | None = None

    def plug(self) -> None:
        """Put the plug in."""
        master, slave = os.openpty()
        tty.setraw(slave)
        os.set_blocking(master, False)
        self._outer = (master, slave)
        self._link.symlink_to(os.ttyname(slave))

    def pull(self) -> None:
        """Pull the plug."""
        if self._outer is not None:
            self._link.unlink()
            for end in reversed(self._outer):
                os.close(end)
            self._outer = None

    def relay(self) -> None:
        """Carry bytes both ways; what nobody takes is lost."""
        with contextlib.suppress(OSError):
            data = os.read(self._inner, 65536)
            if self._outer is not None:
                os.write(self._outer[0], data)
        if self._outer is not None:
            with contextlib.suppress(OSError):
                os.write(self._inner, os.read(self._outer[0], 65536))


async def measure_replug(times: int, rng: random.Random) -> None:
    """Print the times from replug to data, and what was left behind."""
    with served_hardware() as paths, tempfile.TemporaryDirectory() as folder:
        links = [Path(folder) / name for name in ("kobuki", "hokuyo")]
        cables = [Extension(link, path) for link, path in zip(links, paths, strict=True)]
        stop = threading.Event()

        def carry() -> None:
            while not stop.wait(0.002):
                for cable in cables:
                    cable.relay()

        for cable in cables:
            cable.plug()
        relay = threading.Thread(target=carry)
        relay.start()
        robot = Robot(*map(str, links))
        worst = [0.0, 0.0]
        async with running(robot):
            await robot.until_data()
            process = psutil.Process()
            before = (process.num_fds(), process.num_threads())
            for trial in range(2 * times):
                await asyncio.sleep(rng.uniform(0.1, 0.8))
                cables[trial % 2].pull()
                await asyncio.sleep(rng.uniform(0.05, 1.5))
                cables[trial % 2].plug()
                worst[trial % 2] = max(worst[trial % 2], await robot.until_data())
            after = (process.num_fds(), process.num_threads())
        stop.set()
        relay.join()
        for cable in cables:
            cable.pull()
    print(
        f"replug, {times} times each: data after at most {worst[0]:.2f} s (base), {worst[1]:.2f} s (laser); "
        f"descriptors and threads {before} before, {after} after"
    )


def measure_noise(seconds: float) -> None:
    """Print what becomes of frames on a bad line."""
    noise = LinkFaults(lose_byte=1e-3, flip_bit=1e-4, burst_s=0.016)
    noisy = Simulator(worlds.load("office"), seed=5, faults=Faults(kobuki=noise, hokuyo=noise))
    clean = Simulator(worlds.load("office"), seed=5)
    kobuki, hokuyo, whole = KobukiSession(), HokuyoSession(), KobukiSession()
    got: dict[int, tuple[int, int, float]] = {}
    true: dict[int, tuple[int, int, float]] = {}
    scans = []
    for step in range(round(seconds / 0.02)):
        now_s = 0.02 * (step + 1)
        for simulator in (noisy, clean):
            simulator.advance(now_s)
        for session, simulator, taken in ((kobuki, noisy, got), (whole, clean, true)):
            for event in session.receive(simulator.kobuki.read(), now_s):
                if isinstance(event, KobukiSample):
                    taken[step] = (event.left_ticks, event.right_ticks, event.gyro_yaw_rad)
            session.tick(now_s)
        events = hokuyo.receive(noisy.hokuyo.read(), now_s)
        scans += [event for event in events if isinstance(event, LaserScan)]
        noisy.hokuyo.write(hokuyo.tick(now_s))
    values = set(true.values())
    false = sum(value not in values for value in got.values())
    share = hokuyo.counters.partial / max(1, hokuyo.counters.scans)
    clean_share = np.mean([np.isnan(scan.ranges_m).mean() for scan in scans if not scan.complete])
    print(
        f"noise, base: {kobuki.counters.frames} of {whole.counters.frames} packets "
        f"(a packet is whole with {0.999**81 * 0.9999**81:.1%}), {false} false; laser: "
        f"{hokuyo.counters.scans} scans used, {hokuyo.counters.missed} missed, {share:.0%} of them partial "
        f"({clean_share:.0%} of their beams NaN), {hokuyo.counters.restarts} restarts"
    )
    noisy.close()
    clean.close()


def main() -> None:
    """Run what was asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("figures", nargs="*", default=["cpu", "kill", "replug", "noise"])
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--times", type=int, default=20, help="unplugs of each cable")
    parser.add_argument("--stream", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.stream:
        asyncio.run(_stream_for_ever(tuple(options.stream)))
    if "cpu" in options.figures:
        asyncio.run(measure_cpu(options.seconds))
    if "kill" in options.figures:
        asyncio.run(measure_kill())
    if "replug" in options.figures:
        asyncio.run(measure_replug(options.times, random.Random(1)))
    if "noise" in options.figures:
        measure_noise(10.0 * options.seconds)


if __name__ == "__main__":
    main()
