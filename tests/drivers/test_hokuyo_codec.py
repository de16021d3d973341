from pathlib import Path

import numpy as np
import pytest
from device_side import scip_fields, scip_scan, scip_status
from hypothesis import given, settings
from hypothesis import strategies as st

from lemtomap.drivers.hokuyo import commands
from lemtomap.drivers.hokuyo.codec import Decoder
from lemtomap.drivers.hokuyo.commands import ScanRequest
from lemtomap.drivers.hokuyo.numbers import (
    BadDigitError,
    decode_number,
    encode_number,
    line_sum,
)
from lemtomap.drivers.hokuyo.packets import (
    BadReply,
    ClockReading,
    Info,
    ScanFrame,
    SensorParameters,
    Status,
    explain_status,
)

RAW = Path(__file__).parents[3] / "shared" / "data" / "scip_raw" / "GD_urg04lx-ug01_H1620274.scip"
needs_raw = pytest.mark.skipif(not RAW.is_file(), reason=f"no recorded bytes at {RAW}")


def decode(data):
    return Decoder().feed(data)


def scans(events):
    return [event for event in events if isinstance(event, ScanFrame)]


NUMBERS = """1234 CB, 5432 1Dh, 16000000 m2@0, 0 00, 6 006, 19 0C, 20 00D, 1000 ?X, 4095 oo, 4095 0oo,
    5600 1GP,    16777215 oooo, 66051 0@83, 50000 0<=@, 11149560 ZR3h"""


@pytest.mark.parametrize(("value", "text"), [pair.split() for pair in NUMBERS.split(",")])
def test_numbers_are_the_worked_ones(value, text):
    assert encode_number(int(value), len(text)) == text.encode()
    assert decode_number(text.encode()) == int(value)


def test_numbers_that_do_not_fit_and_characters_that_are_no_digits_are_refused():
    with pytest.raises(ValueError, match="4096 does not fit into 2"):
        encode_number(4096, 2)
    with pytest.raises(BadDigitError):
        decode_number(b"0/")


SUMMED = """00P 01Q 02R 03S 04T 05U 06V 07W 08X 09Y 10Q 21S 50U 98a 99b 0Aa 0Bb 0Cc 0Dd 0Ee 0Ff 0Gg 0Hh 0Ii
    0Ll 0Mm ooool 0@83K 0<=@Y ZR3h7 BI9YM <SfkP DMIN:204 SERI:H1510998V TIME:00C350T"""


@pytest.mark.parametrize("line", SUMMED.split())
def test_sums_are_the_recorded_ones(line):
    assert line_sum(line[:-1].encode()) == ord(line[-1])


def test_commands_are_the_worked_ones():
    everything = ScanRequest(44, 725)
    assert commands.stream(everything) == b"MD0044072501000\n"
    assert commands.stream(ScanRequest(383, 385, 1, 0, 2, "S")) == b"MS0383038501002\n"
    assert commands.newest(everything) == b"GD0044072501\n"
    assert commands.tagged(commands.VERSION, "abc") == b"VV;abc\n"
    assert (commands.time_adjust(1), commands.motor_speed(0)) == (b"TM1\n", b"CR00\n")
    assert (commands.bit_rate(115200), commands.sensitivity(high=True)) == (b"SS115200\n", b"HS1\n")
    assert (commands.SOFT_RESET, commands.RESET, commands.QUIT, commands.LASER_ON) == (
        b"RT\n",
        b"RS\n",
        b"QT\n",
        b"BM\n",
    )


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: ScanRequest(725, 44), "end step 44 lies before start step 725"),
        (lambda: ScanRequest(-1, 44), "start is -1"),
        (lambda: ScanRequest(0, 44, cluster=100), "cluster is 100"),
        (lambda: ScanRequest(0, 44, skip=10), "skip is 10"),
        (lambda: commands.motor_speed(11), "ratio is 11"),
        (lambda: commands.bit_rate(9600), "bit rate is 9600"),
        (lambda: commands.tagged(b"VV\n", "no;good"), "tag 'no;good'"),
    ],
)
def test_commands_no_sensor_can_obey_are_refused(make, words):
    with pytest.raises(ValueError, match=words):
        make()


def test_worked_exchanges_decode():
    accepted, scan, two_chars, *rest = decode(
        b"MD0383038501001\n00P\n\n"
        b"MD0383038501000\n99b\n0@83K\n0?X0?Y0nPm\n\n"
        b"GS0383038501\n00P\n0@83K\n?X?YnP]\n\n"
        b"BM\n00P\n\nBM\n02R\n\nTM1\n04T\n\nTM1\n00P\n0@83K\n\nMD0044080001000\n04T\n\nCR00\n03S\n\n"
        b"SS115200\n03S\n\nME0044072501000\n0Ee\n\n%ST\n0Ee\n\nSCIP2.0\n0Ee\n\nSCIP2.0\n0\n\nQT\nE\n\nRT\n0Ee\n\n"
    )
    assert accepted == Status("MD0383038501001", "00")
    assert (scan.stamp_ms, list(scan.raw_mm), scan.remaining, scan.intact) == (
        66051,
        [1000, 1001, 4000],
        0,
        True,
    )
    assert (scan.command, scan.start, scan.end, scan.cluster, scan.interval) == (
        "MD0383038501",
        383,
        385,
        1,
        0,
    )
    assert (list(two_chars.raw_mm), two_chars.remaining) == ([1000, 1001, 4000], None)
    assert rest[3] == ClockReading(66051)
    statuses = [(event.command, event.status) for event in rest if isinstance(event, Status)]
    assert statuses == [
        ("BM", "00"),
        ("BM", "02"),
        ("TM1", "04"),
        ("MD0044080001000", "04"),
        ("CR00", "03"),
        ("SS115200", "03"),
        ("ME0044072501000", "0E"),
        ("%ST", "0E"),
        ("SCIP2.0", "0E"),
        ("SCIP2.0", "0"),
        ("QT", "E"),
        ("RT", "0E"),
    ]


def test_values_that_straddle_two_lines_decode():
    (scan,) = decode(
        b"MD0383040401000\n99b\n0@83K\n"
        b"0?X0?Y0?Z0?[0?\\0?]0?^0?_0?`0?a0?b0?c0?d0?e0?f0?g0?h0?i0?j0?k0?l0E\n?m\\\n\n"
    )
    assert list(scan.raw_mm) == list(range(1000, 1022))


VV = (
    b"VV;abc\n00P\nVEND:Hokuyo Automatic Co.,Ltd.;[\nPROD:SOKUIKI Sensor URG-04LX-UG01(Simple-URG);[\n"
    b"FIRM:3.4.03(17/Dec./2012);T\nPROT:SCIP 2.0;N\nSERI:H1510998;V\n\n"
)
PP = (
    b"PP\n00P\nMODL:URG-04LX-UG01(Simple-URG)(Hokuyo Automatic Co.,Ltd.);N\nDMIN:20;4\nDMAX:5600;_\n"
    b"ARES:1024;\\\nAMIN:44;7\nAMAX:725;o\nAFRT:384;6\nSCAN:600;e\n\n"
)
II = (
    b"II\n00P\nMODL:URG-04LX(Hokuyo Automatic Co.,Ltd.);N\nLASR:OFF;7\n"
    b"SCSP:Initial(600[rpm])<-Default setting by user;A\n"
    b"MESM:CLASSIC;^\nSBPS:19200[bps]<-Default setting by user;A\n"
    b"TIME:6A5404;]\nSTAT:Sensor works well.;8\n\n"
)


def test_recorded_information_decodes_with_every_sum_right():
    version, parameters, state = decode(VV + PP + II)
    assert (version.fields["SERI"], version.tag) == ("H1510998", "abc")
    assert not version.doubtful | parameters.doubtful | state.doubtful
    sensor = SensorParameters.from_fields(parameters.fields)
    assert (sensor.min_mm, sensor.max_mm, sensor.first_step, sensor.last_step) == (20, 5600, 44, 725)
    assert (sensor.period_s, sensor.front_step) == (0.1, 384)
    assert state.fields["STAT"] == "Sensor works well."


def test_version_with_a_wrong_sum_and_a_stray_line_is_taken_with_a_warning():
    (info,) = decode(VV.replace(b"H1510998;V", b"H1510998;W").replace(b"PROT", b"stray\nPROT"))
    assert isinstance(info, Info)
    assert (info.fields["SERI"], info.doubtful, info.stray_lines) == ("H1510998", {"SERI"}, 1)


def test_state_line_whose_sum_leaves_out_the_remark_is_right():
    (info,) = decode(scip_fields(b"II", [("SCSP", "Initial(2400[rpm])")]).replace(b");", b")<-Default;"))
    assert info.doubtful == frozenset()


MEANINGS = [("0E", "undefined"), ("10", "off"), ("33", "checks"), ("71", "motor")]


@pytest.mark.parametrize(("status", "words"), MEANINGS)
def test_status_codes_are_explained(status, words):
    assert words in explain_status(status)


@needs_raw
def test_recorded_scan_decodes_exactly():
    (scan,) = decode(RAW.read_bytes())
    assert (scan.stamp_ms, len(scan.raw_mm), scan.intact) == (11149560, 682, True)
    assert list(scan.raw_mm[3:7]) == [4190, 6, 7, 6]  # from line one
    line3 = [
        3505,
        3505,
        3505,
        3351,
        1061,
        1047,
        1042,
        1042,
        1034,
        1031,
        1028,
        1025,
        1008,
        1001,
        1001,
        997,
        981,
    ]
    assert list(scan.raw_mm[20:37]) == line3
    assert set(scan.raw_mm[scan.raw_mm < 20]) <= {0, 6, 7}


RANGES = np.random.default_rng(1).integers(20, 5600, 682)
SCAN = scip_scan(123456, RANGES)


def test_a_scan_with_a_damaged_line_keeps_the_others_and_marks_its_beams():
    for at in (200, 700, 1500):
        damaged = bytearray(SCAN)
        damaged[at] ^= 0x04
        for data in (bytes(damaged), SCAN[:at] + SCAN[at + 1 :]):
            (scan,) = decode(data)
            assert not scan.intact
            assert 682 - 23 <= scan.valid.sum() <= 682 - 21
            np.testing.assert_array_equal(scan.raw_mm[scan.valid], RANGES[scan.valid])


def test_every_single_flipped_bit_and_lost_byte_is_noticed():
    for at in range(len(SCAN)):
        for damaged in [
            SCAN[:at] + bytes([SCAN[at] ^ 1 << at % 8]) + SCAN[at + 1 :],
            SCAN[:at] + SCAN[at + 1 :],
        ]:
            for scan in scans(decode(damaged + SCAN)[:-1]):
                assert not scan.intact
                assert (scan.start, scan.end, scan.stamp_ms) == (44, 725, 123456)
                np.testing.assert_array_equal(scan.raw_mm[scan.valid], RANGES[scan.valid])


@pytest.mark.parametrize("cut", [1, 14, 17, 21, 27, 100, 2000, len(SCAN) - 2, len(SCAN) - 1])
def test_a_reply_cut_short_costs_only_itself(cut):
    events = decode(SCAN + SCAN[:cut] + SCAN + scip_status(b"QT"))
    whole = [scan for scan in scans(events) if scan.intact]
    assert len(whole) == 2
    assert events[-1] == Status("QT", "00")


def test_endless_noise_is_bounded_and_does_not_hide_what_follows():
    decoder = Decoder()
    events = []
    for _ in range(100):
        events += decoder.feed(b"0123456789" * 100 + b"\n")
    events += decoder.feed(b"x" + SCAN + SCAN)
    assert len(scans(events)) == 2
    assert all(len(event.data) <= 8192 for event in events if isinstance(event, BadReply))


replies = st.one_of(
    st.builds(
        lambda stamp, values, kind: scip_scan(
            stamp, values, f"M{kind}0100{99 + len(values):04d}01000".encode(), chars=3 - (kind == "S")
        ),
        st.integers(0, 0xFFFFFF),
        st.lists(st.integers(0, 4095), min_size=1, max_size=90),
        st.sampled_from("DS"),
    ),
    st.sampled_from([VV, PP, II, b"QT\n00P\n\n", b"TM1\n00P\n0@83K\n\n", b"SCIP2.0\n0\n\n"]),
)
junk = st.one_of(
    st.binary(max_size=40),
    st.builds(lambda reply, cut: reply[: cut % len(reply)], replies, st.integers(0, 400)),
    st.builds(
        lambda reply, at, bit: bytes(b ^ (bit if i == at % len(reply) else 0) for i, b in enumerate(reply)),
        replies,
        st.integers(0, 400),
        st.sampled_from([1, 2, 4, 8, 16, 32, 64, 128]),
    ),
    st.sampled_from([b"\n", b"\n\n\n", b"x" * 9000]),
)


def key(event):
    if isinstance(event, ScanFrame):
        return (event.command, event.remaining, event.stamp_ms, event.raw_mm.tolist(), event.intact)
    return event


@settings(max_examples=60, deadline=None)
@given(st.lists(st.one_of(replies, junk), max_size=8), st.lists(st.integers(1, 90), min_size=1, max_size=30))
def test_any_split_gives_the_same_events(parts, sizes):
    data = b"".join(parts)
    whole = [key(event) for event in decode(data)]
    decoder, at, pieces, turn = Decoder(), 0, [], 0
    while at < len(data):
        size = sizes[turn % len(sizes)]
        pieces += decoder.feed(data[at : at + size])
        at, turn = at + size, turn + 1
    assert [key(event) for event in pieces] == whole
    single = Decoder()
    assert [key(event) for byte in data for event in single.feed(bytes([byte]))] == whole


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=400))
def test_noise_never_raises_and_never_decodes(noise):
    assert all(isinstance(event, BadReply) for event in decode(noise + b"\n\n"))
