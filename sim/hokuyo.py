"""URG-04LX-UG01 firmware as seen through its serial port: SCIP 2.0 (hokuyo-scip, sections 2-9, 11 and 13).

Command bytes in, reply bytes out; finished scans in, stream bytes out. Knows no clock: times are arguments.
"""

import string
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lemtomap.sim import scip
from lemtomap.sim.hokuyo_stream import (
    Stream,
    check_range,
    cut,
    remaining,
)

FIRST_STEP, FRONT_STEP, LAST_STEP, SLITS = 44, 384, 725, 1024
"""Steps with data are FIRST..LAST, 682 of them; 0..768 may be asked for, 1024 make a full turn."""
INITIAL_RPM = 600
NOT_MEASURABLE = 19
STRING_MAX = 16
STRING_CHARS = frozenset(string.ascii_letters + string.digits + " ._+@")
LINE_MAX = 128  # more without an end of line is noise
BIT_RATES = ("019200", "038400", "057600", "115200", "250000", "500000", "750000")
HEALTHY = "Sensor works well."
BROKEN_STATUS, PAUSED_STATUS, RESUMED_STATUS = "50", "21", "98"
DB_SCANS = 20  # simulated failures 03-05 show after this many scans


@dataclass(frozen=True, slots=True)
class FakeHokuyoConfig:
    """What differs between one sensor and another."""

    serial: str = "H1510998"
    firmware: str = "3.4.03(17/Dec./2012)"
    clock_ppm: float = -60.0
    """How much the device's clock runs fast."""
    power_on_ms: int = 16_700_000
    """The 24-bit timer at the start of a run: near its wrap, so that every longer run crosses it."""
    laser_fault: bool = False
    """The laser cannot be turned on."""


@dataclass
class HokuyoFirmware:
    """The state machine of section 13."""

    config: FakeHokuyoConfig = field(default_factory=FakeHokuyoConfig)
    laser_on: bool = False
    sensitive: bool = False
    motor_ratio: int = 0
    adjusting: bool = False
    bit_rate: str = "019200"
    failure: str = ""
    """DB code of a simulated failure."""
    _buffer: bytearray = field(default_factory=bytearray)
    _epoch_s: float = 0.0
    _epoch_ms: int = -1
    _stream: Stream | None = None
    _asked: list[tuple[str, int, int, int, int]] = field(default_factory=list)
    _latest: tuple[int, NDArray[np.int64]] | None = None

    def timer_ms(self, now_s: float) -> int:
        """Return the 24-bit millisecond timer."""
        start = self.config.power_on_ms if self._epoch_ms < 0 else self._epoch_ms
        return (start + int((now_s - self._epoch_s) * (1e3 + self.config.clock_ppm * 1e-3))) & 0xFFFFFF

    @property
    def streaming(self) -> bool:
        """Whether an MD or MS is running."""
        return self._stream is not None

    @property
    def rpm(self) -> int:
        """Motor speed; each CR step slows by one percent (the true steps are not established)."""
        return INITIAL_RPM - INITIAL_RPM // 100 * self.motor_ratio

    def receive(self, data: bytes, now_s: float) -> bytes:
        """Take command bytes and return the replies."""
        self._buffer += data
        replies: list[bytes] = []
        while True:
            ends = [i for i in (self._buffer.find(b"\n"), self._buffer.find(b"\r")) if i >= 0]
            if not ends:
                if len(self._buffer) > LINE_MAX:
                    self._buffer.clear()
                return b"".join(replies)
            line = bytes(self._buffer[: min(ends)])
            del self._buffer[: min(ends) + 1]
            if line:
                replies.append(self._answer(line.decode("latin-1"), now_s))

    def scan_done(self, started_s: float, ranges_mm: NDArray[np.int64]) -> bytes:
        """Take a finished scan, int64 (769,) in mm or error codes by step, and return what is to be sent."""
        if not self.laser_on:
            return b""
        stamp = self.timer_ms(started_s)
        self._latest = (stamp, ranges_mm)
        replies = [self._single(*asked) for asked in self._asked]
        self._asked.clear()
        if self._stream is not None and started_s >= self._stream.asked_s:
            replies.append(self._continue(self._stream, stamp, ranges_mm))
        return b"".join(replies)

    def _continue(self, stream: Stream, stamp: int, ranges_mm: NDArray[np.int64]) -> bytes:
        if stream.skip:
            stream.skip -= 1
            return b""
        stream.skip = stream.interval
        stream.sent += 1
        trouble = self._trouble(stream)
        if trouble == BROKEN_STATUS:
            self._stop()
        if trouble:
            return scip.reply(remaining(stream), trouble)
        if not stream.endless:
            stream.left -= 1
        values = cut(ranges_mm, stream.first, stream.last, stream.cluster)
        frame = scip.reply(remaining(stream), "99", scip.measurement(stamp, values, stream.characters))
        if not stream.endless and stream.left == 0:
            self._stop()
        return frame

    def _trouble(self, stream: Stream) -> str:
        """Return the status a simulated failure gives now, empty for none."""
        over = stream.sent - DB_SCANS
        if self.config.laser_fault or self.failure in {"01", "02"}:
            return BROKEN_STATUS
        if self.failure == "05":
            return BROKEN_STATUS if over > 0 else ""
        if self.failure in {"03", "04"} and 0 < over <= 5:
            return PAUSED_STATUS
        if self.failure == "03" and over == 6:
            self.failure = ""
            return RESUMED_STATUS
        return BROKEN_STATUS if self.failure == "04" and over > 5 else ""

    def _single(self, line: str, characters: int, first: int, last: int, cluster: int) -> bytes:
        if self._latest is None:
            return scip.reply(line, "10")
        stamp, ranges_mm = self._latest
        return scip.reply(
            line, "00", scip.measurement(stamp, cut(ranges_mm, first, last, cluster), characters)
        )

    def _stop(self) -> None:
        self._stream = None
        self.laser_on = False
        self._latest = None
        self.hung_up()

    def hung_up(self) -> None:
        """Forget scans asked for and not yet answered: closing a port drops DTR: nobody waits now."""
        self._asked.clear()

    def _answer(self, line: str, now_s: float) -> bytes:
        command, _, text = line.partition(";")
        if len(text) > STRING_MAX:
            return scip.reply(line, "0G")
        if not STRING_CHARS.issuperset(text):
            return scip.reply(line, "0H")
        handler = _HANDLERS.get(command[:2])
        if handler is None or (self.adjusting and command[:2] != "TM"):
            return scip.reply(line, "0E")
        return handler(self, line, command[2:], now_s)

    def _information(self, line: str, rest: str, now_s: float) -> bytes:
        if rest:
            return scip.reply(line, "0E")
        fields = {"VV": self._version, "PP": self._parameters, "II": self._state}[line[:2]](now_s)
        lines = [f"{key}:{value}" for key, value in fields]
        return scip.reply(line, "00", [scip.summed(text.encode(), ";") for text in lines])

    def _version(self, _now_s: float) -> list[tuple[str, str]]:
        return [
            ("VEND", "Hokuyo Automatic Co.,Ltd."),
            ("PROD", "SOKUIKI Sensor URG-04LX-UG01(Simple-URG)"),
            ("FIRM", self.config.firmware),
            ("PROT", "SCIP 2.0"),
            ("SERI", self.config.serial),
        ]

    def _parameters(self, _now_s: float) -> list[tuple[str, str]]:
        return [
            ("MODL", "URG-04LX-UG01(Simple-URG)(Hokuyo Automatic Co.,Ltd.)"),
            ("DMIN", "20"),
            ("DMAX", "5600"),
            ("ARES", str(SLITS)),
            ("AMIN", str(FIRST_STEP)),
            ("AMAX", str(LAST_STEP)),
            ("AFRT", str(FRONT_STEP)),
            ("SCAN", str(INITIAL_RPM)),
        ]

    def _state(self, now_s: float) -> list[tuple[str, str]]:
        healthy = not self.config.laser_fault and not self.failure
        return [
            ("MODL", "URG-04LX-UG01(Simple-URG)(Hokuyo Automatic Co.,Ltd.)"),
            ("LASR", "ON" if self.laser_on else "OFF"),
            ("SCSP", f"Initial({self.rpm}[rpm])<-Default setting by user"),
            ("MESM", "Measuring by Sensitive Mode" if self.sensitive else "Measuring by Normal Mode"),
            ("SBPS", f"{int(self.bit_rate)}[bps]<-Default setting by user"),
            ("TIME", f"{self.timer_ms(now_s):06X}"),
            ("STAT", HEALTHY if healthy else "Sensor is abnormal."),
        ]

    def _laser(self, line: str, rest: str, _now_s: float) -> bytes:
        if rest:
            return scip.reply(line, "0E")
        if self.config.laser_fault:
            return scip.reply(line, "01")
        status = "02" if self.laser_on else "00"
        self.laser_on = True
        return scip.reply(line, status)

    def _quit(self, line: str, rest: str, _now_s: float) -> bytes:
        if rest:
            return scip.reply(line, "0E")
        self._stop()
        return scip.reply(line, "00")

    def _reset(self, line: str, rest: str, now_s: float) -> bytes:
        if rest:
            return scip.reply(line, "0E")
        self._stop()
        self.motor_ratio, self.sensitive, self.bit_rate, self.failure = 0, False, "019200", ""
        self._epoch_s, self._epoch_ms = now_s, 0
        return scip.reply(line, "00")

    def _time(self, line: str, rest: str, now_s: float) -> bytes:
        if rest == "0":
            status = "02" if self.adjusting else "00"
            self.adjusting = True
            self._stop()
            return scip.reply(line, status)
        if rest == "1" and self.adjusting:
            return scip.reply(line, "00", [scip.summed(scip.encode([self.timer_ms(now_s)], 4))])
        if rest == "2":
            status = "00" if self.adjusting else "03"
            self.adjusting = False
            return scip.reply(line, status)
        return scip.reply(line, "04" if rest == "1" else "01")

    def _bit_rate(self, line: str, rest: str, _now_s: float) -> bytes:
        if not rest.isdigit() or len(rest) != 6:
            return scip.reply(line, "01")
        if rest not in BIT_RATES:
            return scip.reply(line, "02")
        status = "03" if rest == self.bit_rate else "00"
        self.bit_rate = rest
        return scip.reply(line, status)

    def _motor(self, line: str, rest: str, _now_s: float) -> bytes:
        if not rest.isdigit() or len(rest) != 2:
            return scip.reply(line, "01")
        ratio = 0 if rest == "99" else int(rest)
        if ratio > 10:
            return scip.reply(line, "02")
        status = "03" if ratio == self.motor_ratio else "00"
        self.motor_ratio = ratio
        return scip.reply(line, status)

    def _sensitivity(self, line: str, rest: str, _now_s: float) -> bytes:
        if rest not in {"0", "1"}:
            return scip.reply(line, "01")
        status = "02" if self.sensitive == (rest == "1") else "00"
        self.sensitive = rest == "1"
        return scip.reply(line, status)

    def _failure(self, line: str, rest: str, _now_s: float) -> bytes:
        if rest not in {"01", "02", "03", "04", "05", "10"}:
            return scip.reply(line, "01")
        if rest == "10":
            status = "00" if self.failure else "03"
            self.failure = ""
            return scip.reply(line, status)
        status = "02" if self.failure else "00"
        self.failure = self.failure or rest
        return scip.reply(line, status)

    def _get(self, line: str, rest: str, _now_s: float) -> bytes:
        status = check_range(rest, 10)
        if status is None and not self.laser_on:
            status = "10"
        if status is not None:
            return scip.reply(line, status)
        asked = (line, 3 if line[1] == "D" else 2, int(rest[:4]), int(rest[4:8]), int(rest[8:10]))
        if self._latest is not None:
            return self._single(*asked)
        self._asked.append(asked)
        return b""

    def _measure(self, line: str, rest: str, now_s: float) -> bytes:
        status = check_range(rest, 13)
        if status is None and not rest[10].isdigit():
            status = "06"
        if status is None and not rest[11:13].isdigit():
            status = "07"
        if status is None and (self.config.laser_fault or self.failure in {"01", "02"}):
            status = BROKEN_STATUS
        if status is not None:
            return scip.reply(line, status)
        count = int(rest[11:13])
        self.laser_on = True
        self._stream = Stream(
            echo=line[:13],
            characters=3 if line[1] == "D" else 2,
            first=int(rest[:4]),
            last=int(rest[4:8]),
            cluster=int(rest[8:10]),
            interval=int(rest[10]),
            left=count,
            endless=count == 0,
            tail=line[15:],
            asked_s=now_s,
        )
        return scip.reply(line, "00")


_HANDLERS: dict[str, Callable[[HokuyoFirmware, str, str, float], bytes]] = {
    "VV": HokuyoFirmware._information,  # noqa: SLF001 - the table of this very class
    "PP": HokuyoFirmware._information,  # noqa: SLF001
    "II": HokuyoFirmware._information,  # noqa: SLF001
    "BM": HokuyoFirmware._laser,  # noqa: SLF001
    "QT": HokuyoFirmware._quit,  # noqa: SLF001
    "RS": HokuyoFirmware._reset,  # noqa: SLF001
    "TM": HokuyoFirmware._time,  # noqa: SLF001
    "SS": HokuyoFirmware._bit_rate,  # noqa: SLF001
    "CR": HokuyoFirmware._motor,  # noqa: SLF001
    "HS": HokuyoFirmware._sensitivity,  # noqa: SLF001
    "DB": HokuyoFirmware._failure,  # noqa: SLF001
    "GD": HokuyoFirmware._get,  # noqa: SLF001
    "GS": HokuyoFirmware._get,  # noqa: SLF001
    "MD": HokuyoFirmware._measure,  # noqa: SLF001
    "MS": HokuyoFirmware._measure,  # noqa: SLF001
}
