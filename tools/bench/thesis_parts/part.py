"""One subsystem in a process of its own, so that its CPU time and its memory are its own.

    python -m tools.bench.thesis_parts.part "metric mapping" OPTIONS.json <frames >frames

Frames come from standard input and go on to standard output. What is measured is the work on a frame by the
thread's clock; carrying frames between processes, which a robot does not do, is not.
"""

import json
import sys
import time
from pathlib import Path
from typing import IO, Any

from tools.bench.parts.measuring import resident_mb
from tools.bench.thesis_parts.frames import (
    Begin,
    Frame,
    receive,
    send,
)
from tools.bench.thesis_parts.parts import PARTS, Part, PartOptions

SAMPLE_S = 5.0  # of the drive, between two readings of memory


class Meter:
    """Readings of one subsystem over the drive: seconds of the drive, CPU s so far, resident MB."""

    def __init__(self) -> None:
        self.rows: list[tuple[float, float, float]] = []
        self._cpu_s = 0.0
        self._start_mb = resident_mb()
        self._next_s = 0.0

    def work(self, part: Part, frame: Frame) -> None:
        """Let the part work, and take a reading when it is time."""
        begun = time.thread_time()
        part.take(frame)
        self._cpu_s += time.thread_time() - begun
        if frame.drive_s >= self._next_s:
            self._next_s += SAMPLE_S
            self._read(frame.drive_s)
        self._last_s = frame.drive_s

    def _read(self, drive_s: float) -> None:
        self.rows.append((round(drive_s, 2), round(self._cpu_s, 5), round(resident_mb(), 3)))

    def told(self) -> dict[str, Any]:
        """Return everything, with a last reading."""
        self._read(self._last_s)
        return {"start_mb": round(self._start_mb, 3), "rows": self.rows}


def run(name: str, options: PartOptions, source: IO[bytes], sink: IO[bytes]) -> dict[str, Any]:
    """Work until the frames end; return readings and figures."""
    part = PARTS[name](options)
    part.begin()
    meter: Meter | None = None
    for message in receive(source):
        if isinstance(message, Begin):
            part.drop()
            part = PARTS[name](options)
            if message.measured:  # the last one is gone, the next has not begun: this is the process alone
                meter = Meter()
            part.begin(known=not message.measured)
        elif isinstance(message, Frame):
            if meter is None:
                part.take(message)
            else:
                meter.work(part, message)
        send(sink, message)
    sink.flush()
    if meter is None:
        raise SystemExit(f"{name}: the frames ended before the drive began")
    return meter.told() | part.finish()


def main(arguments: list[str]) -> int:
    name, text = arguments
    told = json.loads(text)
    options = PartOptions(told["slam"], told["particles"], told["seed"], Path(told["out"]))
    result = run(name, options, sys.stdin.buffer, sys.stdout.buffer)
    partial = options.out / f"{name}.part"
    partial.write_text(json.dumps(result))
    partial.rename(options.out / f"{name}.json")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
