"""What the host can tell a SCIP sensor. Every function returns the bytes of one command."""

from dataclasses import dataclass
from typing import Final, Literal

VERSION: Final = b"VV\n"
PARAMETERS: Final = b"PP\n"
STATE: Final = b"II\n"
LASER_ON: Final = b"BM\n"
QUIT: Final = b"QT\n"
RESET: Final = b"RS\n"
SOFT_RESET: Final = b"RT\n"
USE_SCIP2: Final = b"SCIP2.0\n"

_TAG: Final = frozenset("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789 ._+@")
_BIT_RATES: Final = (19200, 38400, 57600, 115200, 250000, 500000, 750000)


@dataclass(frozen=True, slots=True)
class ScanRequest:
    """Which beams to send, and how often. Raises ValueError for what no sensor can do."""

    start: int
    end: int
    cluster: int = 1
    skip: int = 0
    """Scans left out between two sent ones."""
    count: int = 0
    """Scans to send; 0 = until told to stop."""
    encoding: Literal["D", "S"] = "D"
    """D: three characters a beam; S: two, and nothing beyond 4095 mm."""

    def __post_init__(self) -> None:
        limits = (("start", 0, 9999), ("end", 0, 9999), ("cluster", 0, 99), ("skip", 0, 9), ("count", 0, 99))
        for name, low, high in limits:
            if not low <= getattr(self, name) <= high:
                raise ValueError(f"{name} is {getattr(self, name)}, must lie between {low} and {high}")
        if self.end < self.start:
            raise ValueError(f"end step {self.end} lies before start step {self.start}")

    @property
    def beams(self) -> int:
        """Number of distances in each scan."""
        return (self.end - self.start) // max(1, self.cluster) + 1


def stream(request: ScanRequest) -> bytes:
    """Return MD or MS: scan after scan until count or QT."""
    r = request
    return f"M{r.encoding}{r.start:04d}{r.end:04d}{r.cluster:02d}{r.skip:d}{r.count:02d}\n".encode()


def newest(request: ScanRequest) -> bytes:
    """Return GD or GS: the newest scan, once; the laser must be on."""
    r = request
    return f"G{r.encoding}{r.start:04d}{r.end:04d}{r.cluster:02d}\n".encode()


def time_adjust(code: Literal[0, 1, 2]) -> bytes:
    """Return TM: 0 enters time-adjust mode (laser off), 1 reads the clock, 2 leaves."""
    return f"TM{code}\n".encode()


def motor_speed(ratio: int) -> bytes:
    """Return CR: 0 default, 1 to 10 a ratio, 99 back to the initial setting."""
    if ratio not in {*range(11), 99}:
        raise ValueError(f"motor speed ratio is {ratio}, must be 0 to 10 or 99")
    return f"CR{ratio:02d}\n".encode()


def bit_rate(bps: int) -> bytes:
    """Return SS; without effect over USB."""
    if bps not in _BIT_RATES:
        raise ValueError(f"bit rate is {bps}, must be one of {_BIT_RATES}")
    return f"SS{bps:06d}\n".encode()


def sensitivity(*, high: bool) -> bytes:
    """Return HS: about a fifth more range, but strong reflectors may be misread."""
    return f"HS{high:d}\n".encode()


def tagged(command: bytes, tag: str) -> bytes:
    """Return the command with a user string that the reply repeats. Raises ValueError for a bad one."""
    if len(tag) > 16 or not _TAG.issuperset(tag):
        raise ValueError(f"tag {tag!r} must be at most 16 of A-Z a-z 0-9 space . _ + @")
    return command.rstrip(b"\n") + b";" + tag.encode() + b"\n"
