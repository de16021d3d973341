"""The fake URG against the worked exchanges of the SCIP reference."""

import numpy as np
import pytest

from lemtomap.sim.hokuyo import FakeHokuyoConfig, HokuyoFirmware


def scanner(**settings) -> HokuyoFirmware:
    return HokuyoFirmware(FakeHokuyoConfig(power_on_ms=66051, clock_ppm=0.0, **settings))


def ranges() -> np.ndarray:
    scan = np.zeros(769, dtype=np.int64)
    scan[383:386] = 1000, 1001, 4000
    return scan


@pytest.mark.parametrize(
    ("sent", "answer"),
    [
        (b"BM\n", b"BM\n00P\n\n"),
        (b"BM\r\nBM\r\n", b"BM\n00P\n\nBM\n02R\n\n"),
        (b"QT\n", b"QT\n00P\n\n"),
        (b"\n\nRS\n", b"RS\n00P\n\n"),
        (b"TM1\n", b"TM1\n04T\n\n"),
        (b"TM0\nTM1\nVV\nTM2\n", b"TM0\n00P\n\nTM1\n00P\n0@83K\n\nVV\n0Ee\n\nTM2\n00P\n\n"),
        (b"GD0044072501\n", b"GD0044072501\n10Q\n\n"),
        (b"MD0044080001000\n", b"MD0044080001000\n04T\n\n"),
        (b"MD0044003001000\n", b"MD0044003001000\n05U\n\n"),
        (b"MD00x4080001000\n", b"MD00x4080001000\n01Q\n\n"),
        (b"MD004407250100\n", b"MD004407250100\n0Cc\n\n"),
        (b"CR00\n", b"CR00\n03S\n\n"),
        (b"SS115200\nSS115200\n", b"SS115200\n00P\n\nSS115200\n03S\n\n"),
        (b"ME0044072501000\n", b"ME0044072501000\n0Ee\n\n"),
        (b"%ST\nSCIP2.0\n", b"%ST\n0Ee\n\nSCIP2.0\n0Ee\n\n"),
        (b"QT;12345678901234567\n", b"QT;12345678901234567\n0Gg\n\n"),
        (b"QT;a#\n", b"QT;a#\n0Hh\n\n"),
        (b"HS1\nHS1\n", b"HS1\n00P\n\nHS1\n02R\n\n"),
    ],
)
def test_replies_as_in_the_reference(sent, answer):
    assert scanner().receive(sent, 0.0) == answer


def test_real_information_lines_come_out_with_their_real_sums():
    replies = scanner().receive(b"VV\nPP\nII\n", 0.0)
    for line in (b"VEND:Hokuyo Automatic Co.,Ltd.;[", b"SERI:H1510998;V", b"DMAX:5600;_", b"SCAN:600;e"):
        assert line in replies.split(b"\n")
    assert b"STAT:Sensor works well.;8\n\n" in replies
    assert max(len(line) for line in replies.split(b"\n")) <= 71


def test_stream_counts_down_and_turns_the_laser_off():
    device = scanner()
    assert device.receive(b"MD0383038501002\n", 0.0) == b"MD0383038501002\n00P\n\n"
    body = b"\n99b\n0@83K\n0?X0?Y0nPm\n\n"
    assert device.scan_done(0.0, ranges()) == b"MD0383038501001" + body
    assert device.scan_done(0.0, ranges()) == b"MD0383038501000" + body
    assert not device.laser_on
    assert device.scan_done(0.0, ranges()) == b""


def test_two_character_scan_waits_for_the_first_turn():
    device = scanner()
    device.receive(b"BM\n", 0.0)
    assert device.receive(b"GS0383038501\n", 0.0) == b""
    assert device.scan_done(0.0, ranges()) == b"GS0383038501\n00P\n0@83K\n?X?YnP]\n\n"


@pytest.mark.parametrize("ending", [b"QT\n", b"RS\n", b"TM0\n", None])
def test_scans_asked_for_are_not_answered_after_an_end_or_a_reset_or_to_the_next_client(ending):
    device = scanner()
    device.receive(b"BM\nGD0383038501\nGS0383038501\n", 0.0)
    if ending is None:
        device.hung_up()
    else:
        assert device.receive(ending, 0.0) == ending + b"00P\n\n"
        device.receive(b"TM2\nBM\n", 0.0)
    assert device.scan_done(0.1, ranges()) == b""


def test_stream_skips_scans_and_ignores_one_begun_before_the_command():
    device = scanner()
    device.receive(b"MD0383038501200\n", 5.0)
    assert device.scan_done(4.99, ranges()) == b""
    sent = [bool(device.scan_done(5.0 + 0.1 * k, ranges())) for k in range(7)]
    assert sent == [True, False, False, True, False, False, True]


def test_cluster_gives_the_smallest_valid_distance():
    device = scanner()
    device.receive(b"BM\n", 0.0)
    device.scan_done(0.0, ranges())
    assert b"\n0?X" in device.receive(b"GD0382038503\n", 0.0)


def test_full_scan_is_32_lines_and_timer_wraps():
    device = HokuyoFirmware(FakeHokuyoConfig(power_on_ms=0xFFFFFF, clock_ppm=0.0))
    device.receive(b"MD0044072501000\n", 0.0)
    reply = device.scan_done(0.001, ranges())
    assert len(reply) == 2137
    assert reply.split(b"\n")[2] == b"00000"


def test_broken_laser_is_refused_and_shown():
    device = scanner(laser_fault=True)
    assert device.receive(b"BM\n", 0.0) == b"BM\n01Q\n\n"
    assert b"works well" not in device.receive(b"II\n", 0.0)


def test_simulated_failure_ends_the_stream_after_twenty_scans():
    device = scanner()
    device.receive(b"DB05\nMD0044072501000\n", 0.0)
    statuses = [device.scan_done(0.1 * k, ranges()).split(b"\n")[1] for k in range(21)]
    assert statuses == [b"99b"] * 20 + [b"50U"]
    assert not device.streaming
