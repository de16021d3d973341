"""Both drivers on real pseudo-terminals, the device's side played by a few lines of its protocol."""

import asyncio
import os
import signal
import subprocess
import sys
import threading
import time
import tty
from pathlib import Path

import psutil
import pytest
from device_side import KOBUKI_VERSIONS, Urg, kobuki_feedback

from lemtomap.drivers.driver import DriverConfig, PortLost, PortOpened
from lemtomap.drivers.errors import (
    PortBroken,
    PortBusy,
    PortClosed,
    PortDenied,
    PortMissing,
    WrongDevice,
)
from lemtomap.drivers.hokuyo.driver import HokuyoDriver
from lemtomap.drivers.hokuyo.events import LaserScan, SensorInfo
from lemtomap.drivers.kobuki.driver import KobukiDriver
from lemtomap.drivers.kobuki.events import BaseInfo, KobukiSample
from lemtomap.drivers.port import open_serial

STOP = bytes.fromhex("aa550601040000000003")
DRIVE = bytes.fromhex("aa550601046400000067")


class Cable:
    """The device's end of a pseudo-terminal; unplugging closes it, a replug makes a new one."""

    def __init__(self):
        self.plug()

    def plug(self):
        self.master, slave = os.openpty()
        tty.setraw(slave)
        os.set_blocking(self.master, False)
        self.path = os.ttyname(slave)
        self._slave = slave

    def unplug(self):
        os.close(self._slave)
        os.close(self.master)
        self.path = "/dev/not-there"

    def read(self):
        try:
            return os.read(self.master, 65536)
        except (BlockingIOError, OSError):
            return b""

    def write(self, data):
        os.write(self.master, data)

    def opener(self):
        return open_serial(self.path)


@pytest.fixture
def cable():
    cable = Cable()
    yield cable
    if cable.path != "/dev/not-there":
        cable.unplug()


async def play_kobuki(cable, heard, extras=b"", start=0):
    index = start
    while True:
        cable.write(kobuki_feedback(index, extras=extras if index == start + 5 else b""))
        heard += cable.read()
        index += 1
        await asyncio.sleep(0.02)


async def play_urg(cable, urg):
    next_scan = 0.0
    while True:
        now = time.monotonic()
        cable.write(urg.feed(cable.read(), now))
        if now >= next_scan:
            next_scan = now + 0.1
            cable.write(urg.scan(now))
        await asyncio.sleep(0.005)


async def until(condition, timeout_s=15.0):  # generous: other tests may run beside this one
    async with asyncio.timeout(timeout_s):
        while not condition():  # noqa: ASYNC110  # a test looks from outside
            await asyncio.sleep(0.005)


def of(events, kind):
    return [event for event in events if isinstance(event, kind)]


@pytest.mark.realtime
def test_kobuki_streams_drives_survives_replugs_and_ends_with_a_stop(cable):
    async def main():
        heard, events = bytearray(), []
        driver = KobukiDriver(cable.opener, time.monotonic, events.append)
        device = asyncio.create_task(play_kobuki(cable, heard, KOBUKI_VERSIONS))
        running = asyncio.create_task(driver.run())
        await until(lambda: of(events, BaseInfo))
        assert driver.drive(0.1, 0.0)
        await until(lambda: DRIVE in heard)
        process = psutil.Process()
        for _ in range(3):
            device.cancel()
            cable.unplug()
            await until(lambda: not driver.is_open)
            assert not driver.drive(0.1, 0.0)
            files, threads = process.num_fds(), threading.active_count()
            await asyncio.sleep(0.15)
            cable.plug()
            samples = len(of(events, KobukiSample))
            heard.clear()
            device = asyncio.create_task(play_kobuki(cable, heard))
            await until(lambda samples=samples: len(of(events, KobukiSample)) > samples + 5)
        assert threading.active_count() <= threads
        assert process.num_fds() <= files + 2 + 5  # the pair of the terminal, the port and its four pipe ends
        driver.drive(0.1, 0.0)
        running.cancel()
        with pytest.raises(asyncio.CancelledError):
            await running
        device.cancel()
        heard += cable.read()
        assert heard.endswith(STOP)
        assert len(of(events, PortOpened)) == 4

    asyncio.run(main())


@pytest.mark.realtime
def test_laser_left_streaming_by_a_killed_program_delivers_within_three_seconds_and_is_told_to_quit(cable):
    async def main():
        urg, events = Urg(boot_s=time.monotonic() - 1000.0), []
        urg.streaming = b"MD0044072501000"
        device = asyncio.create_task(play_urg(cable, urg))
        await asyncio.sleep(0.3)
        driver = HokuyoDriver(cable.opener, time.monotonic, events.append)
        begin_s = time.monotonic()
        running = asyncio.create_task(driver.run())
        await until(lambda: of(events, LaserScan))
        assert time.monotonic() - begin_s < 3.0
        await until(lambda: len(of(events, LaserScan)) > 4)
        running.cancel()
        with pytest.raises(asyncio.CancelledError):
            await running
        await asyncio.sleep(0.02)
        device.cancel()
        assert urg.streaming is None
        assert urg.heard[-1] == b"QT"
        assert urg.heard.count(b"VV") == 1
        assert of(events, SensorInfo)[0].serial == "H1510998"
        ages_s = [scan.arrival_s - scan.stamp_s for scan in of(events, LaserScan)]
        assert min(ages_s) == pytest.approx(0.1 - 44 * 97.65625e-6, abs=0.03)

    asyncio.run(main())


@pytest.mark.realtime
def test_swapped_ports_are_named_by_what_answered(cable):
    async def laser_on_base_port():
        device = asyncio.create_task(play_kobuki(cable, bytearray()))
        try:
            with pytest.raises(WrongDevice, match="not a laser but a Kobuki base answers, it sent aa 55"):
                await HokuyoDriver(cable.opener, time.monotonic, lambda _: None).run()
        finally:
            device.cancel()

    async def base_on_laser_port():
        device = asyncio.create_task(play_urg(cable, Urg()))
        try:
            with pytest.raises(
                WrongDevice, match="not a Kobuki base but a SCIP laser scanner answers, it sent 'QT"
            ):
                await KobukiDriver(cable.opener, time.monotonic, lambda _: None).run()
        finally:
            device.cancel()

    asyncio.run(laser_on_base_port())
    asyncio.run(base_on_laser_port())


def test_ports_that_cannot_be_opened_say_why_and_how_to_cure_it(cable, tmp_path):
    async def refuse(path, error, words):
        with pytest.raises(error, match=words):
            await open_serial(str(path))

    async def main():
        await refuse("/dev/not-there", PortMissing, "/dev/not-there: no such port; is the cable in")
        plain = tmp_path / "plain"
        plain.write_bytes(b"")
        await refuse(plain, PortMissing, "not a serial port")
        port = await open_serial(cable.path)
        await refuse(cable.path, PortBusy, "another program has this port")
        await port.aclose()
        await port.aclose()
        port = await open_serial(cable.path)
        await port.aclose()

    asyncio.run(main())


def test_a_device_that_takes_no_bytes_breaks_the_port_instead_of_getting_stale_commands_later(cable):
    async def main():
        port = await open_serial(cable.path)
        with pytest.raises(PortBroken, match="takes no more bytes"):  # noqa: PT012  # it takes a while to fill
            for _ in range(10_000):
                port.write(bytes(400))
                await asyncio.sleep(0)
        with pytest.raises(PortBroken):
            await port.read()
        with pytest.raises(PortBroken):
            port.write(DRIVE)
        await port.aclose()

    asyncio.run(main())


def test_a_closed_port_says_that_we_closed_it(cable):
    async def main():
        port = await open_serial(cable.path)
        reading = asyncio.create_task(port.read())
        await asyncio.sleep(0)
        await port.aclose()
        with pytest.raises(PortClosed):
            await reading
        with pytest.raises(PortClosed):
            port.write(DRIVE)

    asyncio.run(main())


def test_driver_that_need_not_insist_waits_for_its_port():
    async def main():
        events = []

        async def refuse():
            raise PortDenied("no permission")

        driver = KobukiDriver(refuse, time.monotonic, events.append, config=DriverConfig(insist=False))
        running = asyncio.create_task(driver.run())
        await asyncio.sleep(0.35)
        running.cancel()
        assert [str(event.error) for event in of(events, PortLost)] == ["no permission"]
        with pytest.raises(PortDenied):
            await KobukiDriver(refuse, time.monotonic, events.append).run()

    asyncio.run(main())


PROGRAM = """
import asyncio, time
from lemtomap.drivers.driver import cancelled_by_signals
from lemtomap.drivers.kobuki.driver import KobukiDriver
from lemtomap.drivers.port import open_serial

async def main(ending):
    def take(event):
        driver.drive(0.1, 0.0)
        if ending == "raise" and type(event).__name__ == "KobukiSample":
            raise RuntimeError("a bug elsewhere")
    driver = KobukiDriver(lambda: open_serial({path!r}), time.monotonic, take)
    with cancelled_by_signals(asyncio.current_task()):
        await driver.run()

asyncio.run(main({ending!r}))
"""


@pytest.mark.realtime
@pytest.mark.parametrize("ending", ["raise", "signal"])
def test_a_program_that_crashes_or_is_terminated_leaves_a_stop_behind(cable, ending):
    code = PROGRAM.format(path=cable.path, ending=ending)
    root = Path(__file__).parents[2]
    command = [sys.executable, "-c", code]
    with subprocess.Popen(command, cwd=root, stderr=subprocess.PIPE) as program:  # noqa: S603  # our own text
        heard = b""
        deadline = time.monotonic() + 30.0
        index = 0
        while program.poll() is None and time.monotonic() < deadline:
            cable.write(kobuki_feedback(index))
            heard += cable.read()
            index += 1
            if ending == "signal" and DRIVE in heard:
                program.send_signal(signal.SIGTERM)
            time.sleep(0.02)
        program.kill()
    heard += cable.read()
    assert DRIVE in heard
    assert heard.endswith(STOP)
