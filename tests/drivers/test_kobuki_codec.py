from pathlib import Path

import pytest
from device_side import kobuki_feedback, kobuki_frame
from hypothesis import given, settings
from hypothesis import strategies as st

from lemtomap.drivers.kobuki.codec import Decoder, encode
from lemtomap.drivers.kobuki.commands import (
    ALL_POWER,
    STOP,
    BaseControl,
    ChangeFrame,
    Extra,
    GeneralOutput,
    GetGains,
    Led,
    Output,
    RequestEeprom,
    RequestExtra,
    SetGains,
    Sound,
    SoundSequence,
    Tune,
)
from lemtomap.drivers.kobuki.packets import (
    FACTORY_GAINS,
    BadFrame,
    Feedback,
    Gains,
    Udid,
    Version,
)
from lemtomap.drivers.kobuki.panel import Panel

RAW = Path(__file__).parents[3] / "shared" / "data" / "kobuki_raw"
needs_raw = pytest.mark.skipif(not RAW.is_dir(), reason=f"no recorded bytes in {RAW}")

# The worked frames of the protocol page.
COMMANDS = [
    ("stop", STOP, "06 01 04 00 00 00 00 03"),
    ("straight", BaseControl.from_twist(0.1, 0.0), "06 01 04 64 00 00 00 67"),
    ("backwards", BaseControl.from_twist(-0.1, 0.0), "06 01 04 9C FF 00 00 60"),
    ("turn left", BaseControl.from_twist(0.0, 1.0), "06 01 04 73 00 01 00 71"),
    ("turn right", BaseControl.from_twist(0.0, -1.0), "06 01 04 8D FF 01 00 70"),
    ("arc left", BaseControl.from_twist(0.2, 0.5), "06 01 04 01 01 90 01 92"),
    ("arc right", BaseControl.from_twist(0.2, -0.5), "06 01 04 01 01 70 FE 8D"),
    ("arc back, ccw", BaseControl.from_twist(-0.2, 0.5), "06 01 04 FF FE 70 FE 8C"),
    ("arc back, cw", BaseControl.from_twist(-0.2, -0.5), "06 01 04 FF FE 90 01 93"),
    ("tight arc back", BaseControl.from_twist(-0.03, 0.4), "06 01 04 B4 FF B5 FF 02"),
    ("fastest", BaseControl.from_twist(0.7, 0.0), "06 01 04 BC 02 00 00 BD"),
    ("saturated", BaseControl.from_twist(20.0, 0.5), "06 01 04 59 4E FF 7F 94"),
    ("seen in the field", BaseControl.from_twist(0.0, 1.1), "06 01 04 7E 00 01 00 7C"),
    ("radius -100", BaseControl(100, -100), "06 01 04 64 00 9C FF 04"),
    ("versions", RequestExtra(Extra.HARDWARE | Extra.FIRMWARE | Extra.UDID), "04 09 02 0B 00 04"),
    ("get gains", GetGains(), "03 0E 01 00 0C"),
    ("factory gains", SetGains(FACTORY_GAINS), "0F 0D 0D 00 A0 86 01 00 64 00 00 00 D0 07 00 00 9B"),
    ("user gains", SetGains(Gains(100.0, 0.1, 2.0)), "0F 0D 0D 01 A0 86 01 00 64 00 00 00 D0 07 00 00 9A"),
    ("all power", GeneralOutput(ALL_POWER), "04 0C 02 F0 00 FA"),
    ("LED1 green", GeneralOutput(ALL_POWER | Output.LED1_GREEN), "04 0C 02 F0 02 F8"),
    ("tone", Sound.from_frequency(440.0, 0.2), "05 03 03 3A 03 C8 F4"),
    ("change frame", ChangeFrame(3), "03 0A 01 03 0B"),
    ("eeprom", RequestEeprom(3), "03 0B 01 03 0A"),
    *[
        (tune.name, SoundSequence(tune), f"03 04 01 {tune:02x} {check:02x}")
        for tune, check in zip(Tune, (6, 7, 4, 5, 2, 3, 0), strict=True)
    ],
]
FULL = bytes.fromhex(
    "AA 55 4D 01 0F E8 03 00 00 00 FA FF 0C 00 00 00 00 00 A5 00 03 03 00 00 00 04 07 D8 DC 24 FA 00 00 00"
    "05 06 08 07 12 07 FE 06 06 02 01 02 0D 0E 0A 06 01 00 FE FF 4E F9 00 00 01 00 4C F9 10 10 00 00 FF 0F"
    "00 00 00 00 00 00 00 00 00 00 00 00 C7"
)
CORE = bytes.fromhex("AA 55 11 01 0F FC 03 04 02 01 00 00 00 00 F6 0A 01 06 8C 00 90")
VERSIONS = "0A 04 04 00 01 00 0B 04 00 02 01 00 13 0C 30 FF D2 05 4D 58 36 32 22 61 25 51"
GAINS = "15 0D 00 A0 86 01 00 64 00 00 00 D0 07 00 00"
WITH_VERSIONS = bytes.fromhex("AA5567") + FULL[3:-1] + bytes.fromhex(VERSIONS + "CB")
WITH_GAINS = bytes.fromhex("AA555C") + FULL[3:-1] + bytes.fromhex(GAINS + "5A")


def decode(data):
    return Decoder().feed(data)


def frames(events):
    return [event for event in events if isinstance(event, Feedback)]


@pytest.mark.parametrize(
    ("command", "expected"), [row[1:] for row in COMMANDS], ids=[row[0] for row in COMMANDS]
)
def test_commands_are_the_worked_frames(command, expected):
    assert encode(command) == bytes.fromhex("AA55" + expected)


def test_several_commands_share_a_frame_and_too_many_are_refused():
    two = encode(BaseControl(100, 0), RequestExtra(Extra(0x0B)))
    assert two == bytes.fromhex("AA 55 0A 01 04 64 00 00 00 09 02 0B 00 6B")
    with pytest.raises(ValueError, match="258 bytes of commands"):
        encode(*[STOP] * 43)


@pytest.mark.parametrize("twist", [(float("nan"), 0.0), (0.0, float("inf"))])
def test_velocities_that_are_no_numbers_are_refused(twist):
    with pytest.raises(ValueError, match="not finite"):
        BaseControl.from_twist(*twist)


def test_output_register_remembers_what_others_set():
    panel = Panel()
    assert panel.led(1, Led.RED) == bytes.fromhex("AA55040C02F001FB")
    assert panel.led(2, Led.GREEN) == bytes.fromhex("AA55040C02F009F3")
    panel.led(1, Led.OFF)
    panel.external_power(Output.POWER_12V_5A, on=False)
    panel.digital_output(3, on=True)
    assert panel.bits == ALL_POWER & ~Output.POWER_12V_5A | Output.LED2_GREEN | Output.DO3
    for wrong in (lambda: panel.led(3, Led.RED), lambda: panel.digital_output(4, on=True)):
        with pytest.raises(ValueError, match=r"LED 1 and LED 2|outputs 0 to 3"):
            wrong()


def test_worked_feedback_decodes_field_by_field():
    core, full, versions, gains = frames(decode(CORE + FULL + WITH_VERSIONS + WITH_GAINS))
    assert (core.basic.timestamp_ms, core.basic.bumper, core.basic.wheel_drop, core.basic.cliff) == (
        1020,
        4,
        2,
        1,
    )
    assert (core.basic.left_pwm, core.basic.right_pwm, core.basic.buttons) == (-10, 10, 1)
    assert (core.basic.charger, core.basic.battery_dv, core.inertial) == (6, 140, None)
    assert (full.basic.left_ticks, full.basic.right_ticks, full.basic.battery_dv) == (65530, 12, 165)
    assert (full.inertial.angle_cdeg, full.inertial.rate_cdegps) == (-9000, -1500)
    assert (full.cliff_adc.right, full.cliff_adc.center, full.cliff_adc.left) == (1800, 1810, 1790)
    assert (full.current.left_ca, full.current.right_ca) == (1, 2)
    assert (full.raw_gyro.frame_id, [sample[2] for sample in full.raw_gyro.samples]) == (10, [-1714, -1716])
    assert full.inputs.analog == (4095, 0, 0, 0)
    assert (versions.hardware, versions.firmware) == (Version(1, 0, 4), Version(1, 2, 0))
    assert str(versions.udid) == "97713968-842422349-1361404194"
    assert isinstance(versions.udid, Udid)
    assert gains.gains == FACTORY_GAINS


@pytest.mark.parametrize(
    ("field", "data", "expected"),
    [
        ("hardware", "0A 02 68 00", (1, 0, 4)),
        ("firmware", "0B 02 7B 00", (1, 0, 0)),
        ("firmware", "0B 02 75 27", (1, 1, 1)),
        ("firmware", "0B 02 6E 00", (1, 1, 0)),
    ],
)
def test_versions_of_the_first_firmware_are_two_bytes(field, data, expected):
    (frame,) = frames(decode(kobuki_feedback(extras=bytes.fromhex(data))))
    assert getattr(frame, field) == Version(*expected)


def test_unknown_sub_payloads_are_kept_when_they_tile():
    (frame,) = frames(decode(kobuki_feedback(extras=bytes.fromhex("14 03 01 02 03"))))
    assert frame.unknown == ((20, b"\x01\x02\x03"),)


@pytest.mark.parametrize(
    ("what", "bad"),
    [
        ("checksum", FULL[:-1] + b"\xc6"),
        ("size of a known part", kobuki_feedback(extras=bytes.fromhex("13 0B") + bytes(11))),
        ("tiling", kobuki_feedback(extras=b"\x14\x09\x00")),
        ("a part twice", kobuki_feedback(extras=b"\x03\x03\x00\x00\x00")),
        ("first part", kobuki_frame(b"\x03\x03\x00\x00\x00" + FULL[3:20])),
        ("bumper bit 3", kobuki_feedback(bumper=8)),
        ("gyro word count", kobuki_feedback().replace(b"\x0d\x0e\x00\x06", b"\x0d\x0e\x01\x07")),
    ],
)
def test_frames_wrong_in_one_thing_are_refused(what, bad):
    first, second = kobuki_feedback(1), kobuki_feedback(2)
    events = decode(first + bad + second)
    assert [type(event) for event in events] == [Feedback, BadFrame, Feedback], what
    assert events[1].data == bad


def test_a_frame_that_lost_zeros_costs_only_itself():
    """The published failure: an XOR does not see lost zeros, and the reader runs into the next frame."""
    stream = [kobuki_feedback(i, left=7 * i, right=5 * i) for i in range(60)]
    for position in [i for i, byte in enumerate(stream[30]) if byte == 0]:
        damaged = stream[30][:position] + stream[30][position + 1 :]
        got = frames(decode(b"".join([*stream[:30], damaged, *stream[31:]])))
        assert [frame.basic.timestamp_ms for frame in got] == [20 * i for i in range(60) if i != 30]


@needs_raw
def test_recorded_packets_decode_exactly():
    events = decode((RAW / "tortuga_3packets.bin").read_bytes())
    assert [frame.basic.timestamp_ms for frame in frames(events)] == [0xF190, 0xF1A4, 0xF1B8]
    assert [frame.basic.left_ticks for frame in frames(events)] == [0x2BED, 0x2BF4, 0x2BFC]
    assert [frame.inertial.angle_cdeg for frame in frames(events)] == [7484, 7485, 7486]
    assert [event.data for event in events if isinstance(event, BadFrame)] == [b"\x00"]
    for name in ("read200_midstream.bin", "read204_prefixed.bin"):  # bytes lost in every frame
        assert frames(decode((RAW / name).read_bytes())) == []


good = st.builds(
    kobuki_feedback,
    st.integers(0, 5000),
    bumper=st.integers(0, 7),
    left=st.integers(0, 65535),
    yaw_cdeg=st.integers(-18000, 18000),
    extras=st.sampled_from([b"", bytes.fromhex(VERSIONS), bytes.fromhex(GAINS)]),
)
junk = st.one_of(
    st.binary(max_size=40),
    st.builds(lambda frame, cut: frame[: cut % len(frame)], good, st.integers(0, 200)),
    st.builds(
        lambda frame, at, bit: bytes(b ^ (bit if i == at % len(frame) else 0) for i, b in enumerate(frame)),
        good,
        st.integers(0, 200),
        st.sampled_from([1, 2, 4, 8, 16, 32, 64, 128]),
    ),
    st.just(b"\xaa\x55"),
    st.just(b"\xaa"),
    st.just(bytes(1500)),
)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.one_of(good, junk), max_size=8), st.lists(st.integers(1, 90), min_size=1, max_size=30))
def test_any_split_gives_the_same_events(parts, sizes):
    data = b"".join(parts)
    whole = decode(data)
    decoder, at, pieces = Decoder(), 0, []
    while at < len(data):
        size = sizes[len(pieces) % len(sizes)]
        pieces += decoder.feed(data[at : at + size])
        at += size
    assert pieces == whole
    single = Decoder()
    assert [event for byte in data for event in single.feed(bytes([byte]))] == whole


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(junk, good), min_size=1, max_size=6))
def test_every_whole_frame_between_junk_is_found_and_no_byte_is_lost(pairs):
    data = b"".join(noise + frame for noise, frame in pairs)
    events = decode(data + FULL)
    # junk may end in the beginning of a frame that swallows nothing: each real frame is there, in order
    wanted = [frames(decode(frame))[0] for _, frame in pairs]
    got = iter(frames(events))
    assert all(any(frame == seen for seen in got) for frame in wanted)
    lost = len(data) - sum(len(event.data) for event in events if isinstance(event, BadFrame))
    assert lost >= sum(len(frame) for _, frame in pairs)


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=400))
def test_noise_never_raises_and_never_decodes(noise):
    assert frames(decode(noise)) == []
