"""One system on one drive: its subsystems in a chain of processes, fed with the recorded scans."""

import json
import math
import os
import subprocess
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from itertools import takewhile
from pathlib import Path
from typing import Any

from lemtomap.nav.types import ObstacleSighting
from lemtomap.robot.child import python
from lemtomap.robot.devices.bridge import URG_SILENT_FREE_M
from lemtomap.robot.logs import open_log
from lemtomap.types import Odometry, Scan
from tools.bench.thesis_parts.frames import (
    Begin,
    End,
    Frame,
    send,
)
from tools.bench.thesis_parts.parts import PartOptions

WARM_S = 40.0  # of the drive, driven before to compile and to load


@dataclass(frozen=True, slots=True)
class System:
    """What maps."""

    key: str
    title: str
    slam: str
    particles: int
    parts: tuple[str, ...]


_OURS = ("metric mapping", "topological mapping", "metric navigation", "topological navigation")
OURS = System("lemtomap", "LEMTOMap", "window", 1, _OURS)
OURS_5 = System("lemtomap5", "LEMTOMap, 5 particles", "rolling", 5, _OURS)
BASELINE = System("baseline", "baseline", "gmapping", 80, ("metric mapping", "metric navigation"))
SYSTEMS = (OURS, OURS_5, BASELINE)
"""Section 5-2-1: 5 particles in the window against 80 on the growing grid; ours also as it is by default."""


def map_drive(log: Path, system: System, seed: int, out: Path, until_s: float = math.inf) -> dict[str, Any]:
    """Let a system map a recorded drive; return each subsystem's readings and the map's figures."""
    out.mkdir(parents=True, exist_ok=True)
    for old in out.glob("*.json"):
        old.unlink()
    options = PartOptions(system.slam, system.particles, seed, out)
    text = json.dumps(asdict(options), default=str)
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    chain: list[subprocess.Popen[bytes]] = []
    try:
        for name in system.parts:
            process = subprocess.Popen(  # noqa: S603 - our own interpreter and module
                python("-m", "tools.bench.thesis_parts.part", name, text),
                stdin=chain[-1].stdout if chain else subprocess.PIPE,
                stdout=subprocess.DEVNULL if name == system.parts[-1] else subprocess.PIPE,
                env=environment,
            )
            if chain and chain[-1].stdout is not None:
                chain[-1].stdout.close()  # the next process has it now
            chain.append(process)
        _feed(log, chain[0], until_s)
        codes = [process.wait() for process in chain]
    finally:
        for process in chain:
            if process.poll() is None:
                process.terminate()
                process.wait()
    if any(codes):
        raise SystemExit(f"{out}: {system.title} ended with {dict(zip(system.parts, codes, strict=True))}")
    return {name: json.loads((out / f"{name}.json").read_text()) for name in system.parts}


def _feed(log: Path, first: subprocess.Popen[bytes], until_s: float) -> None:
    pipe = first.stdin
    if pipe is None:
        raise ValueError("the first process of a chain needs a pipe")
    try:
        for message in _messages(log, until_s):
            send(pipe, message)
        pipe.close()
    except BrokenPipeError:
        pass  # its exit code tells more


def _messages(log: Path, until_s: float) -> Iterator[Frame | Begin | End]:
    """Yield the warm-up, then the drive."""
    scans = open_log(log)
    yield from takewhile(lambda frame: frame.drive_s < WARM_S, _frames(scans))
    yield Begin(measured=False)  # the robot starts anywhere in a known map: look-up and proof are loaded too
    yield from takewhile(lambda frame: frame.drive_s < WARM_S, _frames(scans))
    yield Begin()
    yield from takewhile(lambda frame: frame.drive_s < until_s, _frames(scans))
    yield End()


def _frames(scans: Any) -> Iterator[Frame]:
    start_s: float | None = None
    odometry: Odometry
    scan: Scan
    for odometry, scan in scans:
        start_s = scan.stamp_s if start_s is None else start_s
        seen = replace(scan, silent_free_m=URG_SILENT_FREE_M)  # as on the robot
        sighting = ObstacleSighting.from_scan(seen, odometry.T_odom_base)
        yield Frame(scan.stamp_s - start_s, odometry, seen, sighting)
