"""What goes wrong: on the two cables, at the wheels, before the laser. From a world file or from a test."""

from dataclasses import dataclass, field

Window = tuple[float, float]
"""Seconds of the run, from and to."""


@dataclass(frozen=True, slots=True)
class LinkFaults:
    """What is wrong with one cable; all zero is a perfect one."""

    lose_byte: float = 0.0
    """Chance that a byte towards the host is lost."""
    flip_bit: float = 0.0
    """Chance that a byte towards the host has one bit flipped."""
    burst_s: float = 0.0
    """Bytes arrive only at multiples of this (an FTDI latency timer of 16 ms: 0.016)."""
    delay_s: float = 0.0
    """Bytes arrive later by this."""
    jitter_s: float = 0.0
    """Bytes arrive later by up to this, at random."""
    unplugged: tuple[Window, ...] = ()
    """When the cable is out."""


@dataclass(frozen=True, slots=True)
class Faults:
    """Everything that goes wrong in one run."""

    kobuki: LinkFaults = field(default_factory=LinkFaults)
    hokuyo: LinkFaults = field(default_factory=LinkFaults)
    stuck_left: Window | None = None
    """When the left encoder does not count."""
    stuck_right: Window | None = None
    blocked_laser: Window | None = None
    """When something hangs right before the laser."""
