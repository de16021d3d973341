"""Who the base is: asks for versions, unique id and gains until they came, and judges the firmware."""

from dataclasses import dataclass
from typing import Final

from lemtomap.drivers.kobuki.codec import encode
from lemtomap.drivers.kobuki.commands import Extra, GetGains, RequestExtra
from lemtomap.drivers.kobuki.events import BaseInfo, Compatibility, GainsReport
from lemtomap.drivers.kobuki.packets import (
    Feedback,
    Gains,
    Udid,
    Version,
)

GAINS_SINCE: Final = Version(1, 2, 0)
_COMPATIBLE_MAJOR: Final = 1  # kobuki_core, version policy
_RECOMMENDED: Final = (Version(1, 1, 4), Version(1, 2, 0))


@dataclass(frozen=True, slots=True)
class AskConfig:
    """How often to ask; the official driver asks 50 times a second for ever."""

    every_s: float = 0.5
    times: int = 20
    patience: int = 4
    """After so many questions the firmware is judged by its version alone: the first ones told nothing
    else.
    """


class BaseIdentity:
    """What is known of one base."""

    def __init__(self, config: AskConfig) -> None:
        self._config = config
        self.hardware: Version | None = None
        self.firmware: Version | None = None
        self.udid: Udid | None = None
        self.gains: Gains | None = None
        self._told: BaseInfo | None = None
        self._asked = 0
        self._asked_gains = 0
        self._next_ask_s = float("-inf")

    def requests(self, now_s: float) -> bytes:
        """Return what to ask now."""
        if now_s < self._next_ask_s:
            return b""
        self._next_ask_s = now_s + self._config.every_s
        requests = b""
        missing = self._missing()
        if missing and self._asked < self._config.times:
            self._asked += 1
            requests += encode(RequestExtra(missing))
        if self.has_gains and self.gains is None and self._asked_gains < self._config.times:
            self._asked_gains += 1
            requests += encode(GetGains())
        return requests

    @property
    def has_gains(self) -> bool:
        """Return True if the firmware is known to have gain commands; an older one never answers."""
        return self.firmware is not None and self.firmware >= GAINS_SINCE

    def ask_gains_again(self) -> None:
        """Make `requests` ask for the gains anew."""
        self.gains, self._asked_gains, self._next_ask_s = None, 0, float("-inf")

    def take(self, frame: Feedback) -> list[BaseInfo | GainsReport]:
        """Take what a frame tells about the base."""
        events: list[BaseInfo | GainsReport] = []
        self.hardware = frame.hardware or self.hardware
        self.firmware = frame.firmware or self.firmware
        self.udid = frame.udid or self.udid
        if self.firmware is not None and (self._asked >= self._config.patience or not self._missing()):
            info = BaseInfo(self.hardware, self.firmware, self.udid, *judge_firmware(self.firmware))
            if info != self._told:
                self._told = info
                events.append(info)
        if frame.gains is not None:
            self.gains = frame.gains
            events.append(GainsReport(frame.gains))
        return events

    def _missing(self) -> Extra:
        missing = Extra(0)
        for known, flag in (
            (self.hardware, Extra.HARDWARE),
            (self.firmware, Extra.FIRMWARE),
            (self.udid, Extra.UDID),
        ):
            missing |= flag if known is None else Extra(0)
        return missing


def judge_firmware(firmware: Version) -> tuple[Compatibility, str]:
    """Return the verdict on a firmware version and one line of advice (empty when good)."""
    if firmware.major != _COMPATIBLE_MAJOR:
        advice = f"firmware {firmware} speaks another protocol: version 1.2.0 is needed"
        return Compatibility.INCOMPATIBLE, advice
    if firmware in _RECOMMENDED:
        return Compatibility.GOOD, ""
    if firmware > max(_RECOMMENDED):
        return Compatibility.UNTESTED, f"firmware {firmware} is newer than the tested {max(_RECOMMENDED)}"
    ills = (
        "the heading drifts"
        if firmware >= Version(1, 1, 1)
        else "the heading drifts and the first command jumps"
    )
    return Compatibility.UNTESTED, f"firmware {firmware} is old ({ills}): update to {max(_RECOMMENDED)}"
