"""Scripted drives on ground truth: the thesis' continuous tours, and errands there and back twice (T5-2).

A tour is planned on the true raster and followed on the true pose; the robot only gets the commands.
"""

import math
import struct
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lemtomap.sim.route import FloorRoutePlanner, path_length_m
from lemtomap.sim.simulator import Simulator
from lemtomap.sim.world import World

SMALL_S, LARGE_S = 180.0, 660.0  # about 3 and 11 minutes (T5-2-1)
COMMAND_S = 0.02
ABOUT = 0.05  # share of an errand's length
SPACING_M = 3.0  # between places a tour visits: every room, both ends of corridors


@dataclass(frozen=True, slots=True)
class TourConfig:
    """How a tour is driven."""

    speed_mps: float = 0.40
    """Constant, as in the thesis; the TurtleBot's usual pace."""
    turn_radps: float = 1.0
    look_ahead_m: float = 0.40
    spacing_m: float = SPACING_M


class ScriptedTour:
    """Follows one path: `command(pose)` gives (v, w) until `done`."""

    def __init__(self, path: NDArray[np.float64], config: TourConfig | None = None) -> None:
        self.path = path
        """float64 (N, 2), metres."""
        self.config = config or TourConfig()
        self._at = 0

    @property
    def done(self) -> bool:
        """Whether the end of the path is reached."""
        return self._at >= len(self.path) - 1

    @property
    def length_m(self) -> float:
        """Length of the whole path."""
        return path_length_m(self.path)

    def command(self, pose: NDArray[np.float64]) -> tuple[float, float]:
        """Return (v m/s, w rad/s) that leads from a true pose along the path (pure pursuit)."""
        config = self.config
        x, y, yaw = pose
        self._at = self._nearest(x, y)
        if self.done:
            return 0.0, 0.0
        goal = self._ahead(x, y)
        bearing = (math.atan2(goal[1] - y, goal[0] - x) - yaw + math.pi) % (2 * math.pi) - math.pi
        if abs(bearing) > math.radians(60):
            return 0.0, math.copysign(config.turn_radps, bearing)
        distance = max(math.dist((x, y), goal), 0.1)
        w = max(-1.2, min(1.2, 2.0 * config.speed_mps * math.sin(bearing) / distance))
        return config.speed_mps * (1.0 if abs(bearing) < 0.6 else 0.5), w

    def _nearest(self, x: float, y: float) -> int:
        """Return the nearest path point among the next ones: a path may cross itself."""
        window = self.path[self._at : self._at + 12]
        return self._at + int(np.argmin((window[:, 0] - x) ** 2 + (window[:, 1] - y) ** 2))

    def _ahead(self, x: float, y: float) -> tuple[float, float]:
        for px, py in self.path[self._at :]:
            if math.hypot(px - x, py - y) >= self.config.look_ahead_m:
                return float(px), float(py)
        return float(self.path[-1, 0]), float(self.path[-1, 1])


def plan_tour(
    world: World, duration_s: float, config: TourConfig | None = None, seed: int = 0
) -> ScriptedTour:
    """Return a tour of about duration_s that visits place after place and passes known ones again.

    The next place is the nearest one not seen yet; when all are seen, a new round begins in another order.
    """
    config = config or TourConfig()
    planner = FloorRoutePlanner(world.raster)
    here = (world.spawn[0], world.spawn[1])
    places = planner.places(here, config.spacing_m)
    rng = np.random.default_rng(seed)
    left, legs, length_m = list(places), [], 0.0
    while length_m < duration_s * config.speed_mps * 0.93:  # turning on the spot takes the rest
        goal = min(left, key=lambda place: math.dist(place, here))
        left.remove(goal)
        if math.dist(goal, here) > 0.5:
            leg = planner.path(here, goal)
            legs.append(leg)
            length_m += path_length_m(leg)
            here = goal
        if not left:
            left = [places[index] for index in rng.permutation(len(places))[: max(2, len(places) // 2)]]
    return ScriptedTour(np.concatenate(legs), config)


def plan_errand(world: World, distance_m: float, config: TourConfig | None = None) -> ScriptedTour:
    """Return a drive to a place about distance_m away and back the same way, twice (the thesis' navigation
    tasks).

    Of the places that far away, give or take ABOUT, that to which keeping walls in sight costs least:
    a robot that drives as it was led cannot make good what its leader went round.
    """
    planner, direct = FloorRoutePlanner(world.raster), FloorRoutePlanner(world.raster, in_sight=False)
    home = (world.spawn[0], world.spawn[1])
    lengths = {
        place: path_length_m(planner.path(home, place)) for place in planner.places(home, SPACING_M * 2)
    }
    off_m = {place: abs(length_m - distance_m) for place, length_m in lengths.items()}
    near = [place for place in lengths if off_m[place] <= ABOUT * distance_m]
    detours = {place: lengths[place] / path_length_m(direct.path(home, place)) for place in near}
    nearest = min(off_m, key=off_m.__getitem__)
    goal = min(detours, key=lambda place: (round(detours[place], 2), off_m[place]), default=nearest)
    way = planner.path(home, goal)
    return ScriptedTour(np.concatenate([way, way[::-1]] * 2), config)


def base_command(v_mps: float, w_radps: float) -> bytes:
    """Return the Kobuki frame for a velocity (kobuki-protocol, section 4.1)."""
    if abs(w_radps) < 1e-4:
        speed, radius = 1000.0 * v_mps, 0.0
    elif abs(v_mps) < 1e-4:
        speed, radius = 115.0 * w_radps, 1.0
    else:
        radius = 1000.0 * v_mps / w_radps
        speed = (radius + math.copysign(115.0, radius)) * w_radps
        if abs(radius) <= 1.0:
            speed, radius = 115.0 * w_radps, 1.0
    body = bytes((6, 1, 4)) + struct.pack("<hh", _int16(speed), _int16(radius))
    checksum = 0
    for byte in body:
        checksum ^= byte
    return b"\xaa\x55" + body + bytes((checksum,))


def _int16(value: float) -> int:
    return max(-32768, min(32767, int(value)))


def drive(simulator: Simulator, tour: ScriptedTour, limit_s: float | None = None) -> Iterator[float]:
    """Drive a tour to its end in lock-step, yielding the time every 20 ms; commands go through the port.

    A drive that something holds up for good ends at the limit, by default four times the time it should take.
    """
    begin_s = simulator.now_s
    if limit_s is None:
        limit_s = 60.0 + 4.0 * tour.length_m / tour.config.speed_mps
    while not tour.done and simulator.now_s - begin_s < limit_s:
        v, w = tour.command(simulator.truth().T_world_base)
        simulator.kobuki.write(base_command(v, w))
        simulator.advance(simulator.now_s + COMMAND_S)
        yield simulator.now_s
    simulator.kobuki.write(base_command(0.0, 0.0))
