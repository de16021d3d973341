"""The fake Kobuki against the worked frames of the protocol reference."""

import pytest

from lemtomap.sim.kobuki import (
    BaseReadings,
    FakeKobukiConfig,
    KobukiFirmware,
    wheel_speeds_mmps,
)

READINGS = BaseReadings(
    timestamp_ms=1000,
    left_ticks=65530,
    right_ticks=12,
    angle_cdeg=-9000,
    rate_cdegps=-1500,
    cliff_adc=(1800, 1810, 1790),
    current_10ma=(1, 2),
    gyro_frame=10,
    gyro=((1, -2, -1714), (0, 1, -1716)),
)
BODY = (
    "010FE803000000FAFF0C0000000000A50003030000000407D8DC24FA888888050608071207FE06060201020D0E0A060100FE"
    "FF4EF9000001004CF91010"
)


def payload(frame: bytes) -> bytes:
    assert frame[:2] == b"\xaa\x55"
    checksum = 0
    for byte in frame[2:]:
        checksum ^= byte
    assert checksum == 0
    assert frame[2] == len(frame) - 4
    return frame[3:-1]


def test_feedback_matches_the_worked_frame():
    body = payload(KobukiFirmware().packet(READINGS))
    assert len(body) == 0x4D
    assert body.hex().upper().startswith(BODY)


def test_three_gyro_samples_make_a_longer_packet():
    longer = BaseReadings(0, 0, 0, 0, 0, gyro=((0, 0, 0),) * 3)
    assert len(payload(KobukiFirmware().packet(longer))) == 0x53


def test_requested_extras_come_once_however_often_asked():
    firmware = KobukiFirmware()
    for _ in range(60):
        firmware.receive(bytes.fromhex("AA550409020B0004"), 0.0)
        firmware.receive(bytes.fromhex("AA55030E01000C"), 0.0)
    body = payload(firmware.packet(READINGS))[0x4D:]
    assert body.hex().upper() == (
        "0A04040001000B0400020100130C30FFD2054D58363222612551150D00A086010064000000D0070000"
    )
    assert len(payload(firmware.packet(READINGS))) == 0x4D


@pytest.mark.parametrize(
    ("speed", "radius", "wheels"),
    [
        (100, 0, (100, 100)),
        (115, 1, (-115, 115)),
        (-115, 1, (115, -115)),
        (115, -1, (115, -115)),
        (-76, -75, (-76, 16)),
        (257, 400, (142, 257)),
        (257, -400, (257, 142)),
        (1400, 400, (387, 700)),
    ],
)
def test_wheels_follow_speed_and_radius(speed, radius, wheels):
    assert wheel_speeds_mmps(speed, radius) == wheels


def test_command_is_found_between_garbage_and_a_damaged_frame():
    firmware = KobukiFirmware()
    good = bytes.fromhex("AA5506010464000000" + "67")
    damaged = bytes.fromhex("AA55060104640001")  # its tail is lost: the next header starts inside it
    for byte in b"\x00\xaa" + damaged + good:
        firmware.receive(bytes((byte,)), 1.0)
    assert firmware.wheel_targets_mps(1.0) == (0.1, 0.1)


def test_wheels_stop_when_the_host_falls_silent():
    firmware = KobukiFirmware(FakeKobukiConfig(command_timeout_s=0.6))
    firmware.receive(bytes.fromhex("AA550601046400000067"), 1.0)
    assert firmware.wheel_targets_mps(1.59) == (0.1, 0.1)
    assert firmware.wheel_targets_mps(1.61) == (0.0, 0.0)


def test_several_commands_share_a_frame_and_unknown_ones_are_skipped():
    firmware = KobukiFirmware()
    firmware.receive(bytes.fromhex("AA550A0104640000000902" + "0B006B"), 0.0)
    assert firmware.wheel_targets_mps(0.0) == (0.1, 0.1)
    assert len(payload(firmware.packet(READINGS))) == 0x67
    body = bytes((5 + 4, 0x63, 3, 1, 2, 3, 12, 2, 0xF0, 0x09))
    checksum = 0
    for byte in body:
        checksum ^= byte
    firmware.receive(b"\xaa\x55" + body + bytes((checksum,)), 0.0)
    assert firmware.outputs == 0x09F0
