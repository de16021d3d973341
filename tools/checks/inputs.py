"""Small sound files of every kind that a person may hand to the program, made here."""

import gzip
import io
import lzma
import math
from pathlib import Path

import numpy as np
from PIL import Image

from lemtomap.robot.cli.main import main
from lemtomap.robot.devices.recording import HOKUYO, KOBUKI, Recorder
from lemtomap.robot.devices.wire import RecordedHokuyoSession, RecordedKobukiSession, Wire

HALL_M = (8.0, 4.0)
SCANS = 24
STEP_M = 0.15
RECORDED_S = 2.0
WORLD = """\
name = "flat"
description = "two rooms"
spawn = [1.0, 1.0, 0.0]
dock = [0.3, 2.0, 0.0]
[[wall]]
points = [[0, 0], [8, 0], [8, 5], [0, 5], [0, 0]]
[[wall]]
points = [[4, 0], [4, 5]]
surface = "dark"
[[room]]
name = "kitchen"
low = [0, 0]
high = [4, 5]
[[room]]
name = "hall"
low = [4, 0]
high = [8, 5]
[[door]]
at = [4.0, 2.5]
rooms = ["kitchen", "hall"]
leaf = "swings"
[[furniture]]
kind = "table"
at = [2.0, 3.5, 0.3]
moved = [[1, 2.4, 3.1, 0.3]]
[[person]]
points = [[5, 4], [7, 4]]
[[barrier]]
from = [4.5, 2.0]
to = [4.5, 3.0]
during = [60.0, 120.0]
[[hole]]
low = [6, 1]
high = [7, 2]
"""
CONFIG = """\
[ports]
kobuki = "/dev/kobuki"
[laser]
x_m = 0.1
yaw_rad = -0.02
[slam]
window_m = 20.0
particles = 5
[topo]
new_node_distance_m = 1.0
[nav]
[safety]
[smoother]
"""
PLAN = """\
image: {image}
resolution: 0.05
origin: [-1.0, -2.0, 0.0]
negate: 0
mode: trinary
occupied_thresh: 0.65
free_thresh: 0.196
"""


def ranges_m(x_m: float, beams: int) -> list[float]:
    """Return what a laser at (x, half the hall's width) sees of the hall over 180 degrees, right to left."""
    seen = []
    for beam in range(beams):
        angle = -math.pi / 2 + math.pi * beam / (beams - 1)
        ahead, aside = math.cos(angle), abs(math.sin(angle))
        far = (HALL_M[0] - x_m) / ahead if ahead > 1e-9 else math.inf
        seen.append(min(far, HALL_M[1] / 2 / aside if aside > 1e-9 else math.inf))
    return seen


def carmen() -> bytes:
    """Return a drive down a hall as a CARMEN log."""
    lines = ["# a hall", "PARAM robot_front_laser_max 81.9"]
    for scan in range(SCANS):
        x_m, stamp = 1.0 + STEP_M * scan, 100.0 + 0.5 * scan
        ranges = " ".join(f"{value:.2f}" for value in ranges_m(x_m, 181))
        pose = f"{x_m:.3f} 2.0 0.0"
        lines += [f"ODOM {pose} 0.3 0 0 {stamp} host {stamp}"]
        lines += [f"FLASER 181 {ranges} {pose} {pose} {stamp} host {stamp}"]
    return ("\n".join(lines) + "\n").encode()


def tinyslam() -> bytes:
    """Return the same drive as a tinySLAM log."""
    lines = []
    for scan in range(SCANS):
        ticks = round(STEP_M * scan / (2 * math.pi * 0.077) * 2000)
        ranges = " ".join(str(round(1000 * value)) for value in ranges_m(1.0 + STEP_M * scan, 682))
        lines.append(f"{500_000 * scan} 0 {ticks} {ticks} " + "0 " * 20 + ranges)
    return ("\n".join(lines) + "\n").encode()


def gzipped(data: bytes) -> bytes:
    """Pack, the same bytes every time."""
    return gzip.compress(data, mtime=0)


def xz(data: bytes) -> bytes:
    """Pack, the same bytes every time."""
    return lzma.compress(data, preset=0)


def _plan_image() -> Image.Image:
    """Return a room of 5 x 4 m with a border of unknown."""
    grey = np.full((100, 120), 205, np.uint8)
    grey[8:92, 8:112] = 0
    grey[10:90, 10:110] = 254
    grey[40:44, 50:70] = 0
    return Image.fromarray(grey)


def plan_image(kind: str) -> bytes:
    """Return a plan's picture as "pgm" or "png"."""
    held = io.BytesIO()
    _plan_image().save(held, format={"pgm": "PPM", "png": "PNG"}[kind])
    return held.getvalue()


def plan_yaml(image: str) -> bytes:
    """Return the description of a plan with that picture."""
    return PLAN.format(image=image).encode()


def recording(folder: Path) -> bytes:
    """Return the recording of a simulated robot that turns in the office. Needs the simulator."""
    from lemtomap.sim import worlds  # noqa: PLC0415 - pybullet may be missing
    from lemtomap.sim.errors import Unplugged  # noqa: PLC0415
    from lemtomap.sim.simulator import Simulator  # noqa: PLC0415

    simulator, recorder = (
        Simulator(worlds.load("office"), seed=2),
        Recorder(folder / "run.mcap", {"title": "seed"}),
    )
    base_session = RecordedKobukiSession(recorder.raw)
    base = Wire(KOBUKI, simulator.kobuki, base_session, recorder.raw, Unplugged)
    laser = Wire(HOKUYO, simulator.hokuyo, RecordedHokuyoSession(recorder.raw), recorder.raw, Unplugged)
    for step in range(1, round(RECORDED_S * 50)):
        now_s = step * 20_000_000 * 1e-9
        simulator.advance(now_s)
        base.poll(now_s)
        laser.poll(now_s)
        base.write(base_session.drive(0.1, 0.2), now_s)
        recorder.derived("/pose", now_s, {"x_m": 0.1 * now_s, "y_m": 0.0})
    recorder.close()
    simulator.close()
    return (folder / "run.mcap").read_bytes()


def map_file(folder: Path) -> bytes:
    """Return the map of the drive down the hall, with a name in it."""
    log, out = folder / "hall.clf", folder / "out"
    log.write_bytes(carmen())
    path = out / "map.lemto"
    code = main(["map", str(log), "--out", str(out)]) or main(
        ["edit", str(path), "name", "1", "start_of_hall"]
    )
    if code:
        raise RuntimeError(f"the map of the hall could not be made: exit code {code}")
    return path.read_bytes()


def world() -> bytes:
    """Return a described world."""
    return WORLD.encode()


def config() -> bytes:
    """Return a settings file."""
    return CONFIG.encode()
