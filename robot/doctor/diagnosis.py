"""What the doctor makes of what a device told: a finding for each fault, with its cure."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from lemtomap.drivers.driver import PortLost
from lemtomap.drivers.errors import DriverError, PortDenied, WrongDevice
from lemtomap.drivers.hokuyo import events as hokuyo
from lemtomap.drivers.hokuyo.packets import BadReply
from lemtomap.drivers.identify import HOKUYO, KOBUKI
from lemtomap.drivers.kobuki import events as kobuki
from lemtomap.drivers.kobuki.battery import ChargeLevel as BatteryLevel
from lemtomap.drivers.kobuki.battery import PowerSource
from lemtomap.drivers.kobuki.packets import BadFrame
from lemtomap.robot.doctor.udev_rules import INSTALL

BASE, LASER = "Kobuki base", "Hokuyo laser"

DAMAGED_SHARE = 0.01  # of packets; a good cable damages none
LATE_S = 0.012  # delivery that varies by more comes from the FTDI's 16 ms latency timer, or a busy machine
DRIFT_RADPS = math.radians(3.0) / 60.0  # the maker expects a couple of degrees a minute at worst (kobuki#371)
NEAR_M = 0.06  # returns from nearer than this come from dirt or a cover on the window
NEAR_SHARE = 0.8  # in so many of the scans
DIRTY_BEAMS = 3
BLIND_SHARE = 0.97  # without any answer: even a large dark room gives more


class Verdict(StrEnum):
    """How grave a finding is."""

    GOOD = "ok"
    WARNING = "warn"
    FAULT = "FAULT"


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing the doctor has to say."""

    verdict: Verdict
    subject: str
    text: str
    cure: str = ""

    def __str__(self) -> str:
        cure = f" -> {self.cure}" if self.cure else ""
        return f"{self.verdict:5} {self.subject}: {self.text}{cure}"


def judge_error(subject: str, error: DriverError) -> Finding:
    """Return the finding for a port that could not be used; the error's text holds the cure."""
    cure = ""
    if isinstance(error, WrongDevice):
        swapped = any(f"but {name}" in str(error) for name in (KOBUKI, HOKUYO))
        doubt = "are the two ports swapped?" if swapped else "is it the right port?"
        cure = f"{doubt} Leave --kobuki and --hokuyo away to let them be found"
    elif isinstance(error, PortDenied):
        cure = f"or install the udev rules: {INSTALL}"
    return Finding(Verdict.FAULT, subject, str(error), cure)


def judge_base(told: Sequence[object]) -> Iterator[Finding]:
    """Yield what some seconds of a base standing still show."""
    yield from _lost_ports(BASE, told)
    samples = [event for event in told if isinstance(event, kobuki.KobukiSample)]
    if not samples:
        yield Finding(Verdict.FAULT, BASE, "sends no packets", "switch it on; is it the right cable?")
        return
    yield from _firmware(told)
    damaged = sum(isinstance(event, BadFrame) for event in told)
    if damaged > DAMAGED_SHARE * len(samples):
        cure = "use a shorter cable (below 2 m), no hub, and the 1 ms latency timer"
        yield Finding(Verdict.FAULT, BASE, f"{damaged} damaged packets among {len(samples)}", cure)
    delays = np.array([sample.arrival_s - sample.stamp_s for sample in samples[len(samples) // 4 :]])
    spread_s = float(np.percentile(delays, 99) - delays.min()) if len(delays) else 0.0
    if spread_s > LATE_S:
        cure = f"set the latency timer to 1 ms ({INSTALL}), close busy programs"
        yield Finding(Verdict.WARNING, BASE, f"packets come up to {1e3 * spread_s:.0f} ms late", cure)
    yield from _gyro(samples)
    yield from _power(samples[-1])
    yield from _contacts(samples)
    yield Finding(Verdict.GOOD, BASE, f"{len(samples)} packets in {_span_s(samples):.1f} s")


def judge_laser(told: Sequence[object]) -> Iterator[Finding]:
    """Yield what some seconds of a laser show."""
    yield from _lost_ports(LASER, told)
    infos = [event for event in told if isinstance(event, hokuyo.SensorInfo)]
    for info in infos[:1]:
        name = f"{info.product}, firmware {info.firmware}, serial {info.serial}"
        yield Finding(Verdict.GOOD, LASER, name)
        if not info.healthy:
            cure = "switch it off and on; if it stays, the sensor is broken"
            yield Finding(Verdict.FAULT, LASER, f"says '{info.state.get('STAT', '')}'", cure)
    for fault in (event for event in told if isinstance(event, hokuyo.LaserFault)):
        yield Finding(Verdict.FAULT, LASER, fault.reason)
    scans = [event for event in told if isinstance(event, hokuyo.LaserScan)]
    if not scans:
        yield Finding(
            Verdict.FAULT, LASER, "sends no scans", "unplug it and plug it in again; does its LED glow?"
        )
        return
    damaged = sum(isinstance(event, BadReply) for event in told) + sum(not scan.complete for scan in scans)
    if damaged > DAMAGED_SHARE * len(scans):
        yield Finding(
            Verdict.FAULT, LASER, f"{damaged} damaged replies among {len(scans)} scans", "change the cable"
        )
    if any(isinstance(event, hokuyo.LaserUp) and not event.clock_synchronised for event in told):
        yield Finding(
            Verdict.WARNING, LASER, "refuses to synchronise its clock", "stamps are some ms less exact"
        )
    yield from _window(scans)
    yield Finding(Verdict.GOOD, LASER, f"{len(scans)} scans of {len(scans[-1].ranges_m)} beams")


def _lost_ports(subject: str, told: Iterable[object]) -> Iterator[Finding]:
    lost = [event for event in told if isinstance(event, PortLost)]
    if lost:
        cure = "check the plug and the hub's power"
        yield Finding(Verdict.FAULT, subject, f"connection lost {len(lost)} times: {lost[0].error}", cure)
    for event in told:
        if isinstance(event, kobuki.WrongDeviceSeen | hokuyo.WrongDeviceSeen):
            yield judge_error(subject, WrongDevice(event.reason))


def _firmware(told: Iterable[object]) -> Iterator[Finding]:
    infos = [event for event in told if isinstance(event, kobuki.BaseInfo)]
    if not infos:
        cure = "very old firmware? See kobuki.readthedocs.io/en/devel/firmware.html"
        yield Finding(Verdict.WARNING, BASE, "does not tell its version", cure)
        return
    info = infos[-1]
    name = f"hardware {info.hardware}, firmware {info.firmware}, id {info.udid}"
    yield Finding(Verdict.GOOD, BASE, name)
    if info.compatibility is not kobuki.Compatibility.GOOD:
        grave = info.compatibility is kobuki.Compatibility.INCOMPATIBLE
        yield Finding(Verdict.FAULT if grave else Verdict.WARNING, BASE, info.advice)


def _gyro(samples: Sequence[kobuki.KobukiSample]) -> Iterator[Finding]:
    """Judge the heading's drift while nothing turns the wheels."""
    first, last = samples[0], samples[-1]
    still = first.left_ticks == last.left_ticks and first.right_ticks == last.right_ticks
    if not still or _span_s(samples) < 2.0 or math.isnan(last.gyro_yaw_rad):
        return
    yaw = np.unwrap([sample.gyro_yaw_rad for sample in samples])
    stamps = np.array([sample.stamp_s for sample in samples])
    drift = float(np.polyfit(stamps - stamps[0], yaw, 1)[0])
    if abs(drift) > DRIFT_RADPS:
        cure = "switch the base off, leave it standing still on the floor, switch it on and wait 3 s"
        text = f"the gyro drifts by {math.degrees(abs(drift)) * 60.0:.1f} degrees a minute"
        yield Finding(Verdict.WARNING, BASE, text, cure)


def _power(sample: kobuki.KobukiSample) -> Iterator[Finding]:
    battery = sample.battery
    text = f"battery {battery.voltage_v:.1f} V, {battery.percent:.0f} %"
    if battery.source is PowerSource.ADAPTER:
        yield Finding(Verdict.WARNING, BASE, f"{text}, charging by cable", "pull the cable before driving")
    elif battery.level in {BatteryLevel.LOW, BatteryLevel.CRITICAL}:
        grave = battery.level is BatteryLevel.CRITICAL
        yield Finding(Verdict.FAULT if grave else Verdict.WARNING, BASE, f"{text}: low", "charge it")
    else:
        yield Finding(Verdict.GOOD, BASE, text)


def _contacts(samples: Sequence[kobuki.KobukiSample]) -> Iterator[Finding]:
    """Name what would keep the robot from driving."""
    for flags, text, cure in (
        ("bumper", "a bumper is pressed", "free it; stuck? Press it a few times"),
        ("cliff", "a cliff sensor sees no floor", "put it on the floor; wipe the sensors"),
        ("wheel_drop", "a wheel hangs in the air", "put it on the floor"),
        ("over_current", "a motor draws too much current", "is a wheel blocked?"),
    ):
        if all(getattr(sample, flags) for sample in samples[-10:]):
            yield Finding(Verdict.WARNING, BASE, text, cure)


def _window(scans: Sequence[hokuyo.LaserScan]) -> Iterator[Finding]:
    """Find dirt on the laser's window, and a laser that sees nothing."""
    whole = [scan for scan in scans if len(scan.ranges_m) == len(scans[-1].ranges_m)]
    ranges = np.stack([scan.ranges_m for scan in whole])
    with np.errstate(invalid="ignore"):
        near = np.mean(ranges < NEAR_M, axis=0) > NEAR_SHARE
    if int(near.sum()) >= DIRTY_BEAMS:
        angles = np.degrees(scans[-1].angle_min_rad + scans[-1].angle_step_rad * np.flatnonzero(near))
        where = f"between {angles.min():.0f} and {angles.max():.0f} degrees"
        cure = "wipe the window with a soft cloth; is a cable or a post before it?"
        yield Finding(Verdict.WARNING, LASER, f"{near.sum()} beams end at the window {where}", cure)
    blind = float(np.mean(np.isnan(ranges)))
    if blind > BLIND_SHARE:
        cure = "is it covered, or the room much larger than 5 m and dark?"
        yield Finding(Verdict.FAULT, LASER, f"{100.0 * blind:.0f} % of the beams have no answer", cure)


def _span_s(samples: Sequence[kobuki.KobukiSample]) -> float:
    return samples[-1].stamp_s - samples[0].stamp_s
