"""`lemtomap doctor`: looks at machine, ports and devices; names every fault with its cure. Moves nothing."""

import asyncio
import contextlib
import grp
import os
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from serial.tools import list_ports

from lemtomap.drivers.driver import DriverConfig
from lemtomap.drivers.errors import DriverError, PortBusy
from lemtomap.drivers.hokuyo.driver import HokuyoDriver
from lemtomap.drivers.kobuki.driver import KobukiDriver
from lemtomap.drivers.port import open_serial
from lemtomap.errors import BadSetting
from lemtomap.robot.clock import MonotonicClock
from lemtomap.robot.devices import ports
from lemtomap.robot.devices.ports import ListPorts, UsbIdentity
from lemtomap.robot.doctor.diagnosis import (
    BASE,
    LASER,
    Finding,
    Verdict,
    judge_base,
    judge_error,
    judge_laser,
)
from lemtomap.robot.doctor.udev_rules import INSTALL
from lemtomap.robot.output.files import versions
from lemtomap.sim.errors import NoPhysics

LISTEN_S = 6.0  # a laser needs 1 s to connect; the rest shows drift, noise and dirt
SLOW_TIMER_MS = 1


def examine(
    kobuki: str | None = None,
    hokuyo: str | None = None,
    listen_s: float = LISTEN_S,
    list_all: ListPorts = list_ports.comports,
) -> Iterator[Finding]:
    """Yield findings as they are made; paths that are not given are found by USB identity."""
    yield from check_machine()
    for identity, subject, given in ((ports.KOBUKI, BASE, kobuki), (ports.HOKUYO, LASER, hokuyo)):
        try:
            path = given or ports.find(identity, list_all)
        except (DriverError, BadSetting) as error:
            yield Finding(Verdict.FAULT, subject, str(error), "plug it in and switch it on")
            continue
        yield Finding(Verdict.GOOD, subject, f"at {path}")
        yield from check_port(identity, subject, path)
        yield from _listen(identity, subject, path, listen_s)


def check_machine() -> Iterator[Finding]:
    """Check versions and group membership."""
    known = versions()
    yield Finding(Verdict.GOOD, "program", ", ".join(f"{name} {version}" for name, version in known.items()))
    if find_spec("pybullet") is None:
        yield Finding(Verdict.WARNING, "program", "no simulator", str(NoPhysics()))
    with contextlib.suppress(KeyError):
        dialout = grp.getgrnam("dialout").gr_gid
        if os.getuid() != 0 and dialout not in os.getgroups():
            cure = "sudo usermod -aG dialout $USER, then log in again"
            yield Finding(Verdict.WARNING, "user", "is not in the group dialout", cure)


def check_port(
    identity: UsbIdentity, subject: str, path: str, sys_root: Path = Path("/sys")
) -> Iterator[Finding]:
    """Check what the system knows of a port without opening it."""
    name = Path(path).resolve().name
    timer = sys_root / "class/tty" / name / "device/latency_timer"
    with contextlib.suppress(OSError, ValueError):
        milliseconds = int(timer.read_text())
        if milliseconds > SLOW_TIMER_MS:
            cure = f"{INSTALL}, or: echo 1 | sudo tee {timer}"
            yield Finding(Verdict.WARNING, subject, f"latency timer is {milliseconds} ms, not 1", cure)
    if name.startswith("tty") and not Path(identity.link).exists():
        cure = f"optional: {INSTALL} makes it"
        yield Finding(Verdict.GOOD, subject, f"no stable name {identity.link}", cure)


def holders_of(path: str) -> list[str]:
    """Return the programs that have a port open, as far as this user may see them."""
    real, found = os.path.realpath(path), []
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if any(os.path.realpath(link) == real for link in (folder / "fd").iterdir()):
                found.append(f"{(folder / 'comm').read_text().strip()} (process {folder.name})")
    return found


def _listen(identity: UsbIdentity, subject: str, path: str, listen_s: float) -> Iterator[Finding]:
    """Converse with the device for a while without moving anything, and judge what it told."""
    told: list[object] = []
    try:
        asyncio.run(_converse(identity, path, listen_s, told))
    except PortBusy as error:
        holders = ", ".join(holders_of(path)) or "a program of another user"
        yield Finding(Verdict.FAULT, subject, str(error), f"it is {holders}")
        return
    except DriverError as error:
        yield judge_error(subject, error)
        return
    yield from (judge_base if identity is ports.KOBUKI else judge_laser)(told)


async def _converse(identity: UsbIdentity, path: str, listen_s: float, told: list[object]) -> None:
    driver: Any = KobukiDriver if identity is ports.KOBUKI else HokuyoDriver
    clock = MonotonicClock()
    running = driver(
        lambda: open_serial(path), clock.now_s, told.append, config=DriverConfig(insist=True)
    ).run()
    with contextlib.suppress(TimeoutError):
        await asyncio.wait_for(running, listen_s)


def report(findings: Iterator[Finding]) -> int:
    """Write findings line by line as they come; return the exit code: 1 when something is at fault."""
    worst = 0
    for finding in findings:
        sys.stdout.write(f"{finding}\n")
        sys.stdout.flush()
        worst = max(worst, int(finding.verdict is Verdict.FAULT))
    return worst
