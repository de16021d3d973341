import math
import struct

import pytest
from device_side import KOBUKI_VERSIONS, Urg, kobuki_feedback

from lemtomap.drivers.kobuki.battery import (
    BatteryConfig,
    BatteryModel,
    ChargeLevel,
    PowerChange,
    PowerSource,
)
from lemtomap.drivers.kobuki.commands import Led, Tune
from lemtomap.drivers.kobuki.events import (
    BaseInfo,
    BumperEvent,
    ButtonEvent,
    CliffEvent,
    Compatibility,
    GainsReport,
    KobukiSample,
    LinkDown,
    LinkUp,
    OverCurrentEvent,
    WheelDropEvent,
    WrongDeviceSeen,
)
from lemtomap.drivers.kobuki.identity import judge_firmware
from lemtomap.drivers.kobuki.packets import (
    BadFrame,
    Bumper,
    Gains,
    Version,
)
from lemtomap.drivers.kobuki.session import KobukiSession

VERSIONS_PLEASE = bytes.fromhex("AA5504 09 02 0B 00 04")


def of(events, kind):
    return [event for event in events if isinstance(event, kind)]


def stream(session, frames, start_s=0.0):
    """Feed one packet every 20 ms, ticking as a driver does; return all events and all bytes sent."""
    events, sent = [], b""
    for i, frame in enumerate(frames):
        now_s = start_s + 0.02 * i
        events += session.receive(frame, now_s)
        sent += session.tick(now_s)
    return events, sent


def test_samples_are_in_si_units_and_on_the_host_clock():
    extras = KOBUKI_VERSIONS
    frames = [kobuki_feedback(i, left=65530 + i, right=i, yaw_cdeg=-9000) for i in range(50)]
    events, _ = stream(KobukiSession(), [*frames, kobuki_feedback(50, extras=extras, yaw_cdeg=-9000)], 500.0)
    sample = of(events, KobukiSample)[20]
    assert (sample.left_ticks, sample.right_ticks) == (14, 20)
    assert sample.gyro_yaw_rad == pytest.approx(-math.pi / 2)
    assert sample.stamp_s == pytest.approx(500.4 - 0.008)  # the wire takes 8 ms
    assert sample.battery.voltage_v == pytest.approx(16.5)
    assert sample.raw_gyro_radps.shape == (2, 3)
    assert not sample.contact
    assert of(events, LinkUp) == [LinkUp(500.0)]


def test_raw_gyro_axes_are_turned_back():
    frame = bytearray(kobuki_feedback())
    at = frame.index(b"\x0d\x0e\x00\x06") + 4
    frame[at : at + 12] = struct.pack("<6h", 100, 200, 300, 0, 0, 0)
    frame[-1] = 0
    for byte in frame[2:-1]:
        frame[-1] ^= byte
    (sample,) = of(KobukiSession().receive(bytes(frame), 0.0), KobukiSample)
    assert sample.raw_gyro_radps[0] == pytest.approx([math.radians(0.00875 * d) for d in (-200, 100, 300)])


def test_a_bump_shorter_than_a_step_is_an_event_all_the_same():
    frames = [kobuki_feedback(i, bumper=6 if i == 5 else 0) for i in range(9)]
    events = KobukiSession().receive(b"".join(frames), 1.0)
    bumps = [(event.side, event.pressed) for event in of(events, BumperEvent)]
    assert bumps == [(Bumper.CENTER, True), (Bumper.LEFT, True), (Bumper.CENTER, False), (Bumper.LEFT, False)]
    assert of(events, KobukiSample)[5].contact


def test_every_contact_button_and_motor_flag_makes_one_event_for_each_change():
    frames = [kobuki_feedback(i, flags=(2, 4, 1, 2) if 3 <= i < 6 else (0, 0, 0, 0)) for i in range(9)]
    events, _ = stream(KobukiSession(), frames)
    assert [(e.side, e.dropped) for e in of(events, WheelDropEvent)] == [(2, True), (2, False)]
    assert [(e.side, e.seen, e.adc) for e in of(events, CliffEvent)] == [(4, True, 1790), (4, False, 1790)]
    assert [(e.button, e.pressed) for e in of(events, ButtonEvent)] == [(1, True), (1, False)]
    assert [(e.side, e.above) for e in of(events, OverCurrentEvent)] == [(2, True), (2, False)]
    assert [sample.contact for sample in of(events, KobukiSample)] == [False] * 3 + [True] * 3 + [False] * 3


def test_a_talkative_stranger_is_named_at_once():
    (seen,) = of(KobukiSession().receive(b"$GPRMC,081836,A,3751.65,S,14507.36,E" * 12, 0.0), WrongDeviceSeen)
    assert "not a Kobuki base but a device that speaks NMEA (a GPS receiver?) answers, it sent" in seen.reason
    assert "'$GPRMC,081836,A,3751.65," in seen.reason
    (seen,) = of(KobukiSession().receive(bytes(range(128, 228)) * 4, 0.0), WrongDeviceSeen)
    assert "an unknown device answers, it sent 80 81 82" in seen.reason


def listen(line, period_s=1.0, until_s=6.0):
    """Return what a base session says of somebody who prints one line a period, and when."""
    session, told = KobukiSession(), []
    for i in range(round(50 * until_s)):
        now_s = 0.02 * i
        data = line if line and i % round(50 * period_s) == 30 else b""
        told += [(now_s, event) for event in session.receive(data, now_s)]
        session.tick(now_s)
    return told


@pytest.mark.parametrize(
    ("line", "name"),
    [
        (b"$GPGGA,092750.000,5321.6802,N,00630.3372,W,1,8,1.03,61.7,M,55.2,M,,*76\r\n", "NMEA"),
        (b"temperature 21.5\r\n", "plain text"),
        (b"42\n", "plain text"),
    ],
    ids=str,
)
def test_a_slow_stranger_is_named_after_a_few_seconds_by_what_it_said(line, name):
    told = listen(line)
    (when_s,) = [now_s for now_s, event in told if isinstance(event, WrongDeviceSeen)]
    (reason,) = [event.reason for _, event in told if isinstance(event, WrongDeviceSeen)]
    assert when_s < 4.0
    assert name in reason
    assert line[:10].decode().strip() in reason


@pytest.mark.parametrize("line", [b"", b"\xff\x00\x81", b"\xfe\xf8ab\n\x80"], ids=str)
def test_silence_and_a_little_noise_are_no_stranger(line):
    assert not [event for _, event in listen(line) if isinstance(event, WrongDeviceSeen)]


def test_versions_are_asked_for_until_they_come_and_gains_only_of_firmware_that_has_them():
    session = KobukiSession()
    _, sent = stream(session, [kobuki_feedback(i) for i in range(60)])
    assert sent == VERSIONS_PLEASE * 3  # every half second, not with every packet
    events, sent = stream(session, [kobuki_feedback(i, extras=KOBUKI_VERSIONS) for i in range(60, 61)], 1.2)
    (info,) = of(events, BaseInfo)
    assert (info.hardware, info.firmware) == (Version(1, 0, 4), Version(1, 2, 0))
    assert (info.compatibility, info.advice) == (Compatibility.GOOD, "")
    _, sent = stream(session, [kobuki_feedback(i) for i in range(61, 90)], 1.22)
    assert sent == bytes.fromhex("AA55030E01000C")
    gains = bytes.fromhex("15 0D 00 A0 86 01 00 64 00 00 00 D0 07 00 00")
    events, sent = stream(
        session, [kobuki_feedback(90, extras=gains), *map(kobuki_feedback, range(91, 150))], 1.8
    )
    assert of(events, GainsReport) == [GainsReport(Gains(100.0, 0.1, 2.0, user=False))]
    assert sent == b""


def test_firmware_that_tells_only_its_version_is_judged_all_the_same():
    frames = [
        kobuki_feedback(i, extras=bytes.fromhex("0B027B00") if i % 25 == 3 else b"") for i in range(150)
    ]
    events, _ = stream(KobukiSession(), frames)
    (info,) = of(events, BaseInfo)
    assert (info.hardware, info.firmware, info.udid) == (None, Version(1, 0, 0), None)
    assert info.compatibility is Compatibility.UNTESTED


@pytest.mark.parametrize(
    ("version", "verdict", "words"),
    [
        (Version(1, 2, 0), Compatibility.GOOD, ""),
        (Version(1, 1, 4), Compatibility.GOOD, ""),
        (Version(1, 3, 0), Compatibility.UNTESTED, "newer"),
        (Version(1, 1, 2), Compatibility.UNTESTED, "the heading drifts"),
        (Version(1, 1, 0), Compatibility.UNTESTED, "first command jumps"),
        (Version(2, 0, 0), Compatibility.INCOMPATIBLE, "another protocol"),
        (Version(0, 9, 0), Compatibility.INCOMPATIBLE, "another protocol"),
    ],
)
def test_firmware_is_judged_as_the_official_driver_does(version, verdict, words):
    judged, advice = judge_firmware(version)
    assert judged is verdict
    assert words in advice


def test_gains_are_refused_when_negative_or_too_early():
    session = KobukiSession()
    with pytest.raises(ValueError, match="between 0 and"):
        session.set_gains(Gains(-1.0, 0.1, 2.0))
    stream(session, [kobuki_feedback(0, extras=bytes.fromhex("0B0404010100"))])
    with pytest.raises(ValueError, match=r"need firmware 1\.2\.0, this base has 1\.1\.4"):
        session.set_gains(Gains(100.0, 0.1, 2.0))


def test_silence_is_told_once_and_the_clock_starts_anew_after_it():
    session = KobukiSession()
    stream(session, [kobuki_feedback(i) for i in range(50)])
    events, _ = stream(session, [b""] * 50, 1.0)
    (down,) = of(events, LinkDown)
    assert down.stamp_s == pytest.approx(1.1, abs=0.03)
    assert not session.alive
    events, _ = stream(session, [kobuki_feedback(i) for i in range(7, 10)], 2.0)  # it was switched off and on
    assert [sample.stamp_s for sample in of(events, KobukiSample)] == pytest.approx([1.992, 2.012, 2.032])


def test_a_host_that_slept_does_not_blame_the_base():
    session = KobukiSession()
    stream(session, [kobuki_feedback(i) for i in range(50)])
    events, _ = stream(
        session, [b"".join(kobuki_feedback(i) for i in range(50, 300)), *map(kobuki_feedback, [300])], 6.0
    )
    assert not of(events, LinkDown)
    stamps = [sample.stamp_s for sample in of(events, KobukiSample)]
    assert stamps == pytest.approx([0.02 * i - 0.008 for i in range(50, 301)])


def damaged(i, **changes):
    """A frame whose fields lie while its checksum is right, as two flipped bits in one column make it."""
    fields = {"left": 5 * i, "right": 5 * i, "yaw_cdeg": i, **changes}
    return kobuki_feedback(i, **fields)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"left": 5 * 30 ^ 0x0400}, "encoder"),
        ({"right": 5 * 30 ^ 0x8000}, "encoder"),
        ({"yaw_cdeg": 30 ^ 0x0800}, "heading"),
        ({"stamp_ms": 600 ^ 0x0004}, "timestamp"),
        ({"stamp_ms": 600 ^ 0x2000}, "clock"),
        ({"stamp_ms": 580}, "timestamp"),
        ({"extras": b"\x14\x01\x00"}, "composition"),
    ],
)
def test_lies_that_pass_the_checksum_are_found_by_the_frame_before(changes, words):
    session = KobukiSession()
    frames = [damaged(i, **(changes if i == 30 else {})) for i in range(60)]
    events, _ = stream(session, frames)
    (bad,) = of(events, BadFrame)
    assert words in bad.reason
    assert len(of(events, KobukiSample)) == 59
    assert session.counters.implausible == 1
    assert session.counters.missed == 1


def test_a_world_that_really_jumped_is_believed_at_the_second_packet():
    session = KobukiSession()
    frames = [damaged(i, left=5 * i + (20000 if i >= 30 else 0)) for i in range(60)]
    events, _ = stream(session, frames)
    assert len(of(events, KobukiSample)) == 59


def test_a_rule_the_firmware_keeps_breaking_is_silenced():
    session = KobukiSession()
    frames = [kobuki_feedback(i, stamp_ms=23 * i) for i in range(100)]  # a clock that does not do 20 ms
    events = [event for i, frame in enumerate(frames) for event in session.receive(frame, 0.023 * i)]
    assert len(of(events, KobukiSample)) > 75
    assert not of(events[-70:], BadFrame)


def test_an_idle_laser_on_the_port_is_named():
    session, urg, events, data = KobukiSession(), Urg(), [], b""
    for i in range(120):
        events += session.receive(data, 0.02 * i)
        data = urg.feed(session.tick(0.02 * i), 0.02 * i)
    (seen,) = of(events, WrongDeviceSeen)
    assert "not a Kobuki base but a SCIP laser scanner answers, it sent 'QT" in seen.reason
    assert [type(event) for event in events] == [LinkDown, WrongDeviceSeen]


def test_sounds_and_lights_are_the_worked_frames():
    session = KobukiSession()
    assert session.sound(Tune.ERROR) == bytes.fromhex("AA5503040104 02".replace(" ", ""))
    assert session.led(2, Led.ORANGE) == bytes.fromhex("AA55040C02F00CF6")
    assert session.melody([(440.0, 0.2)]) == [bytes.fromhex("AA55050303 3A03C8F4".replace(" ", ""))]
    assert session.close_bytes() == session.stop_bytes() == bytes.fromhex("AA550601040000000003")


def follow(model, readings):
    """Feed (voltage, charger byte, seconds) rows at 50 Hz; return (time, change) of all changes."""
    changes, now_s = [], 0.0
    for voltage_v, charger, seconds in readings:
        for _ in range(round(seconds * 50)):
            battery, news = model.update(voltage_v, charger, now_s)
            changes += [(round(now_s, 1), change) for change in news]
            now_s += 0.02
    return battery, changes


def test_battery_falls_through_its_levels_once_and_not_by_a_sag():
    rows = [
        (15.0, 0, 5),
        (13.9, 0, 1),
        (15.0, 0, 5),
        (13.9, 0, 10),
        (14.1, 0, 1),
        (13.9, 0, 5),
        (13.1, 0, 10),
    ]
    battery, changes = follow(BatteryModel(BatteryConfig()), rows)
    assert [change for _, change in changes] == [PowerChange.BATTERY_LOW, PowerChange.BATTERY_CRITICAL]
    assert (battery.level, battery.percent) == (ChargeLevel.CRITICAL, pytest.approx(5 - 95 * 0.1 / 3.3))


def test_charging_is_followed_and_the_false_charged_of_old_firmware_is_not():
    rows = [(14.5, 0, 2), (15.0, 2, 1), (15.0, 6, 5), (16.4, 2, 5), (16.3, 0, 5), (16.3, 22, 3)]
    battery, changes = follow(BatteryModel(BatteryConfig()), rows)
    assert changes == [
        (4.5, PowerChange.PLUGGED_TO_DOCK),
        (9.5, PowerChange.CHARGE_COMPLETED),
        (14.5, PowerChange.UNPLUGGED),
        (19.5, PowerChange.PLUGGED_TO_ADAPTER),
    ]
    assert (battery.source, battery.charging, battery.percent) == (
        PowerSource.ADAPTER,
        True,
        pytest.approx(96.9, abs=0.2),
    )
