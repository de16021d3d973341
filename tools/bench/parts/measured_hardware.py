"""The fake robot with a stopwatch: serves both ports, presses the bumper, pulls plugs, and times it.

    python tools/bench/parts/measured_hardware.py bumps 100      press the front bumper 100 times on the way
    python tools/bench/parts/measured_hardware.py plugs 20       pull each plug 20 times while it drives
    python tools/bench/parts/measured_hardware.py still 0        only watch

First line: the two paths. Last line: what was measured, as JSON. Ends when done, or on SIGTERM.
"""

import json
import random
import re
import signal
import struct
import sys
import threading
import time
from dataclasses import replace
from typing import Any

from lemtomap.sim import worlds
from lemtomap.sim.body import BodyState
from lemtomap.sim.faults import Faults, LinkFaults
from lemtomap.sim.kobuki import BaseReadings
from lemtomap.sim.serve import PtyServer
from lemtomap.sim.simulator import Simulator

DRIVE = re.compile(rb"\xaa\x55\x06\x01\x04(..)(..).", re.DOTALL)
BUMPED = re.compile(rb"\xaa\x55.\x01\x0f..[^\0]", re.DOTALL)  # the first sub-payload's bumper byte
CENTRE = 0x02
HELD_S = 0.06  # a bump lasts three packets
FORWARD_S = 0.4  # of driving forward between two events
NEVER_S = 1e9
OUT_S = (0.3, 1.5)  # how long a plug stays out


class Stopwatch(PtyServer):
    """Serves as ever, and notes when bytes come and go."""

    def __init__(self, simulator: Simulator, what: str, count: int, seed: int = 1) -> None:
        super().__init__(simulator)
        self.measured: dict[str, list[float]] = {}
        self.done = threading.Event()
        self._what, self._left = what, count
        self._random = random.Random(seed)
        self._forward_since_s: float | None = None
        self._bumped_s: float | None = None
        self._bump_until_s = 0.0
        self._out: tuple[str, float, float] | None = None
        self._stopped_s: float | None = None
        self._back_s: tuple[str, float] | None = None
        self._awaited = False
        pty = self._pairs[0][1]
        send = pty.write

        def sent(frame: bytes, *, answer: bool = False) -> None:
            send(frame, answer=answer)
            if self._awaited and BUMPED.match(frame):
                self._awaited, self._bumped_s = False, time.monotonic()

        pty.write = sent  # type: ignore[method-assign]
        base = simulator.base
        original = base._readings  # noqa: SLF001

        def readings(state: BodyState) -> BaseReadings:
            told = original(state)
            if simulator.now_s < self._bump_until_s:
                return replace(told, bumper=told.bumper | CENTRE)
            return told

        base._readings = readings  # type: ignore[method-assign] # noqa: SLF001

    def _listen(self, until_s: float) -> None:
        port, _ = self._pairs[0]
        write = port.write

        def heard(data: bytes) -> None:
            now_s = time.monotonic()
            for speed, _ in DRIVE.findall(data):
                self._command(struct.unpack("<h", speed)[0], now_s)
            write(data)

        port.write = heard  # type: ignore[method-assign]
        try:
            super()._listen(until_s)
        finally:
            port.write = write  # type: ignore[method-assign]

    def _send(self) -> None:
        now_s = time.monotonic()
        self._follow_plug(now_s)
        pressed = self._simulator.now_s < self._bump_until_s
        super()._send()
        driving = self._forward_since_s is not None and now_s - self._forward_since_s > FORWARD_S
        if driving and self._left > 0 and self._out is None and self._back_s is None and not pressed:
            self._left -= 1
            self._begin(now_s)
        if (
            self._left <= 0
            and not self._awaited
            and self._bumped_s is None
            and self._out is None
            and self._back_s is None
        ):
            self.done.set()

    def _begin(self, now_s: float) -> None:
        if self._what == "bumps":
            self._forward_since_s = None
            self._bump_until_s = self._simulator.now_s + HELD_S
            self._bumped_s, self._awaited = None, True
        elif self._what == "plugs":
            name = ("kobuki", "hokuyo")[self._left % 2]
            getattr(self._simulator, name).unplug()
            self._out = (name, now_s, now_s + self._random.uniform(*OUT_S))
            self._stopped_s = None

    def _command(self, speed_mmps: int, now_s: float) -> None:
        if speed_mmps > 0:
            self._forward_since_s = self._forward_since_s or now_s
            if self._back_s is not None:
                self._note(f"{self._back_s[0]} replug to driving again", now_s - self._back_s[1])
                self._back_s = None
            return
        self._forward_since_s = None
        if self._bumped_s is not None:
            self._note("bump to stop", now_s - self._bumped_s)
            self._bumped_s = None
            if self._left <= 0:
                self.done.set()
        if self._out is not None and self._out[0] == "hokuyo" and self._stopped_s is None:
            self._stopped(now_s)

    def _follow_plug(self, now_s: float) -> None:
        if self._out is None:
            return
        name, out_s, back_s = self._out
        targets = self._simulator.base.firmware.wheel_targets_mps(self._simulator.now_s)
        if name == "kobuki" and self._stopped_s is None and max(abs(v) for v in targets) == 0.0:
            self._stopped(now_s)
        if now_s >= max(back_s, out_s) and self._stopped_s is not None:
            getattr(self._simulator, name).replug()
            self._forward_since_s, self._out, self._back_s = None, None, (name, now_s)

    def _stopped(self, now_s: float) -> None:
        assert self._out is not None  # noqa: S101
        self._stopped_s = now_s
        self._note(f"{self._out[0]} unplug to stop", now_s - self._out[1])

    def _note(self, name: str, seconds: float) -> None:
        self.measured.setdefault(name, []).append(seconds)


def main() -> None:
    """Serve until everything was measured or somebody ends it."""
    what, count = sys.argv[1], int(sys.argv[2])
    world = sys.argv[3] if len(sys.argv) > 3 else "office"
    stop = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: stop.set())
    later = LinkFaults(unplugged=((NEVER_S, NEVER_S + 1.0),))  # its port gets a name that stays
    faults = Faults(kobuki=later, hokuyo=later) if what == "plugs" else Faults()
    simulator = Simulator(worlds.load(world), seed=5, faults=faults)
    server = Stopwatch(simulator, what, count)
    print(json.dumps({"kobuki": server.kobuki_path, "hokuyo": server.hokuyo_path}), flush=True)

    def end_when_done() -> None:
        server.done.wait()
        time.sleep(0.5)
        stop.set()

    if what != "still":
        threading.Thread(target=end_when_done, daemon=True).start()
    server.serve(stop)
    truth = simulator.truth()
    told: dict[str, Any] = {
        "measured": server.measured,
        "contacts": truth.contact_count,
        "lost_s": server.lost_s,
    }
    speed = max(abs(v) for v in simulator.base.firmware.wheel_targets_mps(simulator.now_s))
    print(json.dumps({**told, "path_m": truth.path_m, "speed_at_end_mps": speed}), flush=True)
    server.close()


if __name__ == "__main__":
    main()
