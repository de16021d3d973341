"""Things that move: what they are made of, and where they are as time goes by."""

import math
from dataclasses import dataclass

import numpy as np

from lemtomap.sim.world import Box, Motion, Pose2, Surface

NOWHERE: Pose2 = (1e4, 1e4, 0.0)
"""Where a thing is that is not there."""


@dataclass(frozen=True, slots=True)
class SwingDoor:
    """A door leaf on a hinge, opening and closing by a timetable; it waits while the robot is in its way."""

    hinge: tuple[float, float]
    closed_yaw_rad: float
    """Direction of the leaf from the hinge when closed."""
    width_m: float
    period_s: float = 60.0
    """One opening and one closing."""
    open_share: float = 0.5
    phase_s: float | None = None
    """Time within the period at the start; None: by the run's seed."""
    swing_rad: float = math.radians(85)
    surface: Surface = Surface.WALL

    @property
    def parts(self) -> tuple[Box, ...]:
        """Return the leaf, hinge at the origin."""
        return (Box((self.width_m / 2, 0.0, 1.0), (self.width_m / 2, 0.02, 1.0), surface=self.surface),)

    def begin(self, seed: int) -> Motion:
        """Start with the timetable's phase."""
        phase = self.phase_s
        if phase is None:
            phase = float(np.random.default_rng(seed).uniform(0.0, self.period_s))
        return _SwingingDoor(self, phase)


class _SwingingDoor:
    ROBOT_M = 0.22  # its radius, half the leaf and two fingers
    TURN_RADPS = math.radians(45)  # two seconds for a door, as people open them

    def __init__(self, door: SwingDoor, phase_s: float) -> None:
        self._door = door
        self._phase_s = phase_s
        self._angle = self._wanted(0.0)

    def _wanted(self, now_s: float) -> float:
        share = ((now_s + self._phase_s) % self._door.period_s) / self._door.period_s
        return self._door.swing_rad if share < self._door.open_share else 0.0

    def step(self, now_s: float, dt_s: float, robot: Pose2) -> Pose2:
        door = self._door
        change = self._wanted(now_s) - self._angle
        turn = math.copysign(min(abs(change), self.TURN_RADPS * dt_s), change)
        if change and not self._would_hit(robot, turn):
            self._angle += turn
        return (*door.hinge, door.closed_yaw_rad + self._angle)

    def _would_hit(self, robot: Pose2, turn: float) -> bool:
        """Return True if the leaf, moving by turn, comes upon the robot."""
        dx, dy = robot[0] - self._door.hinge[0], robot[1] - self._door.hinge[1]
        distance = math.hypot(dx, dy)
        if distance > self._door.width_m + self.ROBOT_M or distance < 1e-6:
            return False
        bearing = math.atan2(dy, dx) - self._door.closed_yaw_rad - self._angle
        ahead = (bearing + math.pi) % (2 * math.pi) - math.pi
        half = math.asin(min(1.0, self.ROBOT_M / distance))
        return 0.0 < ahead * math.copysign(1.0, turn) < half + abs(turn)


@dataclass(frozen=True, slots=True)
class Person:
    """Someone who walks round a list of points and gives way to the robot at the last moment."""

    waypoints: tuple[tuple[float, float], ...]
    speed_mps: float = 1.1
    pause_s: float = 0.0
    """Standing time at each point."""

    @property
    def parts(self) -> tuple[Box, ...]:
        """Two legs, which the laser sees, and a body above it."""
        legs = tuple(
            Box((0.0, side * 0.12, 0.4), (0.06, 0.055, 0.4), surface=Surface.PERSON) for side in (-1, 1)
        )
        return (*legs, Box((0.0, 0.0, 1.25), (0.14, 0.22, 0.45), surface=Surface.PERSON))

    def begin(self, seed: int) -> Motion:
        """Start at one of the points."""
        return _Walker(self, seed % len(self.waypoints))


class _Walker:
    GIVE_WAY_M = 0.75  # centre to centre: 0.35 m of air, the last moment
    STEP_ASIDE_M = 0.5

    def __init__(self, person: Person, start: int) -> None:
        self._person = person
        self._x, self._y = person.waypoints[start]
        self._next = (start + 1) % len(person.waypoints)
        self._yaw = 0.0
        self._standing_s = 0.0

    def step(self, _now_s: float, dt_s: float, robot: Pose2) -> Pose2:
        goal = self._person.waypoints[self._next]
        left_m = math.dist((self._x, self._y), goal)
        if left_m < 0.05:
            self._next = (self._next + 1) % len(self._person.waypoints)
            self._standing_s = self._person.pause_s
        self._standing_s = max(0.0, self._standing_s - dt_s)
        if self._standing_s == 0.0 and left_m > 0.0:
            self._walk(goal, left_m, dt_s, robot)
        return self._x, self._y, self._yaw

    def _walk(self, goal: tuple[float, float], left_m: float, dt_s: float, robot: Pose2) -> None:
        ux, uy = (goal[0] - self._x) / left_m, (goal[1] - self._y) / left_m
        self._yaw = math.atan2(uy, ux)
        dx, dy = robot[0] - self._x, robot[1] - self._y
        distance = math.hypot(dx, dy)
        speed = self._person.speed_mps
        if distance < self.GIVE_WAY_M and dx * ux + dy * uy > 0.0:
            side = math.copysign(1.0, dx * uy - dy * ux)  # the robot to the right: step to the left
            ux, uy, speed = -uy * side, ux * side, 0.6 * speed
            if distance < self.STEP_ASIDE_M:
                ux, uy = -dx / max(distance, 1e-6), -dy / max(distance, 1e-6)
        move = min(speed * dt_s, left_m)
        self._x += ux * move
        self._y += uy * move


@dataclass(frozen=True, slots=True)
class Appearing:
    """A thing that stands in the way from one time to another: a closed corridor, a trolley, a chair."""

    boxes: tuple[Box, ...]
    """In world coordinates."""
    from_s: float
    to_s: float = math.inf

    @property
    def parts(self) -> tuple[Box, ...]:
        """Return the boxes as they stand."""
        return self.boxes

    def begin(self, _seed: int) -> Motion:
        """Start absent or present, by the clock."""
        return _Timed(self)


class _Timed:
    def __init__(self, thing: Appearing) -> None:
        self._thing = thing

    def step(self, now_s: float, _dt_s: float, _robot: Pose2) -> Pose2:
        return (0.0, 0.0, 0.0) if self._thing.from_s <= now_s < self._thing.to_s else NOWHERE
