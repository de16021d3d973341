"""A few lines of each device's side, written from the protocol pages without drivers/ or sim/."""

import functools
import operator
import struct


def kobuki_frame(payload):
    body = bytes([len(payload)]) + payload
    return b"\xaa\x55" + body + bytes([functools.reduce(operator.xor, body)])


def kobuki_feedback(
    index=0, *, bumper=0, left=0, right=0, yaw_cdeg=0, extras=b"", stamp_ms=None, flags=(0, 0, 0, 0)
):
    """One packet in the order real robots send, every part of it consistent from index to index."""
    stamp = (20 * index if stamp_ms is None else stamp_ms) & 0xFFFF
    drop, cliff, buttons, over = flags
    ticks = (left & 0xFFFF, right & 0xFFFF)
    basic = struct.pack("<HBBBHHbbBBBB", stamp, bumper, drop, cliff, *ticks, 0, 0, buttons, 0, 165, over)
    gyro = struct.pack("<BB6h", 2 * index & 0xFF, 6, *([0] * 6))
    return kobuki_frame(
        b"\x01\x0f" + basic
        + b"\x03\x03\x00\x00\x00"
        + b"\x04\x07" + struct.pack("<hh3x", yaw_cdeg, 0)
        + b"\x05\x06" + struct.pack("<3H", 1800, 1810, 1790)
        + b"\x06\x02\x01\x02"
        + b"\x0d\x0e" + gyro
        + b"\x10\x10" + struct.pack("<8H", 15, 4095, 0, 0, 0, 0, 0, 0)
        + extras
    )  # fmt: skip


KOBUKI_VERSIONS = bytes.fromhex("0a0404000100 0b0400020100 130c30ffd2054d58363222612551")


def scip_sum(text):
    return bytes([(sum(text) & 0x3F) + 0x30])


def scip_number(value, chars):
    return bytes((value >> 6 * i & 0x3F) + 0x30 for i in reversed(range(chars)))


def scip_scan(stamp_ms, ranges_mm, echo=b"MD0044072501000", status=b"99", chars=3):
    text = b"".join(scip_number(int(value), chars) for value in ranges_mm)
    lines = [text[i : i + 64] for i in range(0, len(text), 64)]
    stamp = scip_number(stamp_ms & 0xFFFFFF, 4)
    rows = [status, stamp, *lines]
    return echo + b"\n" + b"".join(row + scip_sum(row) + b"\n" for row in rows) + b"\n"


def scip_status(echo, status=b"00"):
    return echo + b"\n" + status + scip_sum(status) + b"\n\n"


def scip_fields(echo, fields):
    rows = b"".join(
        f"{key}:{value}".encode() + b";" + scip_sum(f"{key}:{value}".encode()) + b"\n"
        for key, value in fields
    )
    return echo + b"\n00P\n" + rows + b"\n"


VV = [
    ("VEND", "Hokuyo Automatic Co.,Ltd."),
    ("PROD", "SOKUIKI Sensor URG-04LX-UG01(Simple-URG)"),
    ("FIRM", "3.4.03(17/Dec./2012)"),
    ("PROT", "SCIP 2.0"),
    ("SERI", "H1510998"),
]
PP = [
    ("MODL", "URG-04LX-UG01(Simple-URG)(Hokuyo Automatic Co.,Ltd.)"),
    *[("DMIN", "20"), ("DMAX", "5600"), ("ARES", "1024"), ("AMIN", "44"), ("AMAX", "725")],
    *[("AFRT", "384"), ("SCAN", "600")],
]
II = [("LASR", "OFF"), ("TIME", "00C350"), ("STAT", "Sensor works well.")]


class Urg:
    """A UG01: feed it command bytes with the time, get reply bytes; `scan` gives a turn while it streams."""

    def __init__(
        self, *, scip1=False, time_mode=False, refuse_time=False, mute=(), boot_s=0.0, parameters=()
    ):
        self.parameters = list(parameters) or PP
        self.scip1, self.time_mode, self.refuse_time = scip1, time_mode, refuse_time
        self.mute = set(mute)
        self.epoch_s = boot_s
        self.streaming = None
        self.heard = []
        self._line = b""

    def ms(self, now_s):
        return int((now_s - self.epoch_s) * 1000) & 0xFFFFFF

    def feed(self, data, now_s):
        replies = b""
        for byte in data:
            if byte in b"\r\n":
                line, self._line = self._line, b""
                replies += self._answer(line, now_s) if line else b""
            else:
                self._line += bytes([byte])
        return replies

    def scan(self, now_s, ranges=None):
        """The turn that began 0.1 s ago."""
        if self.streaming is None:
            return b""
        return scip_scan(self.ms(now_s - 0.1), [1000] * 682 if ranges is None else ranges, self.streaming)

    def _answer(self, line, now_s):
        self.heard.append(line)
        name = line[:2]
        if line in self.mute or name in self.mute:
            return b""
        if self.scip1:
            if line == b"SCIP2.0":
                self.scip1 = False
                return b"SCIP2.0\n0\n\n"
            return line + b"\nE\n\n"
        if name == b"TM" and not self.refuse_time:
            return self._time(line, now_s)
        if self.time_mode:
            return scip_status(line, b"0E")
        if name == b"QT":
            self.streaming = None
        elif name == b"RS":
            self.streaming, self.epoch_s = None, now_s
        elif name == b"VV":
            return scip_fields(line, VV)
        elif name == b"PP":
            return scip_fields(line, self.parameters)
        elif name == b"II":
            return scip_fields(line, II)
        elif name == b"MD":
            self.streaming = line[:13] + b"00"
        else:
            return scip_status(line, b"0E")
        return scip_status(line)

    def _time(self, line, now_s):
        if line == b"TM0":
            status, self.time_mode, self.streaming = (b"02" if self.time_mode else b"00"), True, None
        elif line == b"TM2":
            status, self.time_mode = (b"00" if self.time_mode else b"03"), False
        else:
            stamp = scip_number(self.ms(now_s), 4)
            return (
                line + b"\n00P\n" + stamp + scip_sum(stamp) + b"\n\n"
                if self.time_mode
                else scip_status(line, b"04")
            )
        return scip_status(line, status)
