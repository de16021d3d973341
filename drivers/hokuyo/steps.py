"""The steps from an unknown sensor to a stream of scans, as a table: what is sent, what answers, how long to
wait.

Nothing here relies on silence: a sensor that a crashed program left streaming never is. VV is sent once for
each opening of the port (repeated, it makes old sensors mute), ME never (it hangs them until they lose
power).
"""

from dataclasses import dataclass
from enum import Enum, auto

from lemtomap.drivers.hokuyo import commands


class HandshakeStep(Enum):
    """Where the conversation is."""

    QUIET = auto()
    """Stop whatever the sensor was doing; the line feed ends half a command that somebody left."""
    SWITCH = auto()
    """Ask a SCIP 1.1 sensor to speak SCIP 2.0."""
    LEAVE_TIME = auto()
    """Leave a time-adjust mode that somebody left on."""
    RESET = auto()
    VERSION = auto()
    PARAMETERS = auto()
    STATE = auto()
    ENTER_TIME = auto()
    READ_TIME = auto()
    END_TIME = auto()
    START = auto()
    """Ask for scans."""
    STREAM = auto()
    FAILED = auto()


@dataclass(frozen=True, slots=True)
class Question:
    """What one step sends, and for how long."""

    command: bytes
    echo: str
    """What the echo of its answer begins with."""
    timeout_s: float
    tries: int
    unanswered: HandshakeStep
    """Where to go when nobody answers."""


QUESTIONS: dict[HandshakeStep, Question] = {
    HandshakeStep.QUIET: Question(b"\n" + commands.QUIT, "QT", 0.4, 3, HandshakeStep.SWITCH),
    HandshakeStep.SWITCH: Question(commands.USE_SCIP2, "SCIP2.0", 0.4, 1, HandshakeStep.FAILED),
    HandshakeStep.LEAVE_TIME: Question(commands.time_adjust(2), "TM2", 0.4, 2, HandshakeStep.RESET),
    HandshakeStep.RESET: Question(commands.RESET, "RS", 0.8, 2, HandshakeStep.VERSION),
    HandshakeStep.VERSION: Question(commands.VERSION, "VV", 0.8, 1, HandshakeStep.PARAMETERS),
    HandshakeStep.PARAMETERS: Question(commands.PARAMETERS, "PP", 0.5, 4, HandshakeStep.FAILED),
    HandshakeStep.STATE: Question(commands.STATE, "II", 0.5, 2, HandshakeStep.ENTER_TIME),
    HandshakeStep.ENTER_TIME: Question(commands.time_adjust(0), "TM0", 0.3, 2, HandshakeStep.END_TIME),
    HandshakeStep.READ_TIME: Question(commands.time_adjust(1), "TM1", 0.3, 2, HandshakeStep.END_TIME),
    HandshakeStep.END_TIME: Question(commands.time_adjust(2), "TM2", 0.3, 3, HandshakeStep.START),
    HandshakeStep.START: Question(
        b"", "M", 0.8, 3, HandshakeStep.FAILED
    ),  # the command depends on the sensor's parameters
}
