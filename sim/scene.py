"""The world inside pybullet: ray casts, floor height and contacts. One client (DIRECT or GUI) per scene."""

import contextlib
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lemtomap.sim.errors import NoPhysics, SimError
from lemtomap.sim.world import (
    ALBEDO,
    Box,
    Pose2,
    Surface,
    World,
)


@contextlib.contextmanager
def _silent_stderr() -> Any:
    """Pybullet greets on stderr while it is imported."""
    try:
        saved, null = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    except OSError:
        yield
        return
    try:
        os.dup2(null, 2)
        yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)
        os.close(null)


try:
    with _silent_stderr():
        import pybullet
except ImportError as missing:
    raise NoPhysics from missing

SOLID_MASK = 1 | 2 | 4  # pybullet's default, static and kinematic groups
GLASS_GROUP = 64
EVERYTHING_MASK = SOLID_MASK | GLASS_GROUP
ROBOT_GROUP = 128  # no ray looks for it: the laser stands clear of its own body

BODY_RADIUS_M = 0.178  # collision cylinder of kobuki_description
BODY_LOW_M, BODY_HIGH_M = 0.03, 0.12  # bumper ring; lower things are driven over
TOWER_RADIUS_M, TOWER_HIGH_M = 0.16, 0.42  # plates and laptop above the base
FLOOR_FAR_M = 5.0  # how deep a ray looks for the floor


@dataclass(frozen=True, slots=True)
class Hits:
    """What N rays met."""

    share: NDArray[np.float64]
    """float64 (N,), 0 at the ray's start, 1 at its end or nothing met."""
    body: NDArray[np.int64]
    """int64 (N,), pybullet body, -1 nothing."""
    normal: NDArray[np.float64]
    """float64 (N, 3), surface normal in the world frame."""


@dataclass(frozen=True, slots=True)
class Touch:
    """Where the robot touches something."""

    bearing_rad: float
    """Direction of the contact in the base frame."""
    depth_m: float
    """How deep, negative when it only nearly touches."""
    normal: tuple[float, float]
    """Unit vector in the world frame, from the thing towards the robot."""
    low: bool
    """At the height of the bumper ring."""


class Scene:
    """The boxes of a world as pybullet bodies, and the robot among them."""

    def __init__(self, world: World, *, gui: bool = False) -> None:
        if gui and not os.environ.get("DISPLAY"):
            raise SimError("pybullet's window needs a display, and DISPLAY is not set")
        self.client: int = pybullet.connect(pybullet.GUI if gui else pybullet.DIRECT)
        self._shapes: dict[tuple[float, float, float], int] = {}
        self._parts: list[list[tuple[int, Box]]] = []
        self.flat = world.flat
        """The floor is the plane z = 0 and has no body."""
        self.alive = bool(world.movers)
        """Something may come and touch the robot even when it stands."""
        self._albedo: dict[int, float] = {}
        for box in world.boxes:
            self._add(box)
        for mover in world.movers:
            self._parts.append([(self._add(part), part) for part in mover.parts])
        self._base = self._cylinder(BODY_RADIUS_M, BODY_HIGH_M - BODY_LOW_M)
        self._tower = self._cylinder(TOWER_RADIUS_M, TOWER_HIGH_M - BODY_HIGH_M)
        self._robots = (self._base, self._tower)
        self._shells = ((self._base, BODY_LOW_M, BODY_HIGH_M), (self._tower, BODY_HIGH_M, TOWER_HIGH_M))
        table = np.zeros(max(self._albedo, default=0) + 2)
        for body, albedo in self._albedo.items():
            table[body] = albedo
        self.albedo: NDArray[np.float64] = table
        """float64, by body; the last entry (index -1: nothing) is 0."""

    def close(self) -> None:
        """Free pybullet's memory. Closing twice is fine."""
        if self.client >= 0:
            pybullet.disconnect(physicsClientId=self.client)
            self.client = -1

    def _add(self, box: Box) -> int:
        shape = self._shapes.get(box.half)
        if shape is None:
            shape = pybullet.createCollisionShape(
                pybullet.GEOM_BOX, halfExtents=box.half, physicsClientId=self.client
            )
            self._shapes[box.half] = shape
        body: int = pybullet.createMultiBody(
            0,
            shape,
            basePosition=box.centre,
            baseOrientation=_quaternion(box.yaw_rad, box.pitch_rad),
            physicsClientId=self.client,
        )
        if box.surface is Surface.GLASS:
            pybullet.setCollisionFilterGroupMask(
                body, -1, GLASS_GROUP, EVERYTHING_MASK, physicsClientId=self.client
            )
        self._albedo[body] = ALBEDO[box.surface]
        return body

    def _cylinder(self, radius_m: float, height_m: float) -> int:
        shape = pybullet.createCollisionShape(
            pybullet.GEOM_CYLINDER, radius=radius_m, height=height_m, physicsClientId=self.client
        )
        body: int = pybullet.createMultiBody(0, shape, basePosition=(0, 0, -10), physicsClientId=self.client)
        pybullet.setCollisionFilterGroupMask(body, -1, ROBOT_GROUP, 0, physicsClientId=self.client)
        return body

    def cast(self, starts: NDArray[np.float64], ends: NDArray[np.float64], *, glass: bool = False) -> Hits:
        """Cast N rays between float64 (N, 3) points; glass lets the light through unless asked for."""
        raw = pybullet.rayTestBatch(
            starts,
            ends,
            numThreads=1,
            collisionFilterMask=EVERYTHING_MASK if glass else SOLID_MASK,
            physicsClientId=self.client,
        )
        return Hits(
            share=np.array([hit[2] for hit in raw]),
            body=np.array([hit[0] for hit in raw], dtype=np.int64),
            normal=np.array([hit[4] for hit in raw]),
        )

    def floor_below(self, points: Sequence[tuple[float, float, float]]) -> list[float]:
        """Return the drop in metres from each point down to the floor, FLOOR_FAR_M where there is none."""
        raw = pybullet.rayTestBatch(
            points,
            [(x, y, z - FLOOR_FAR_M) for x, y, z in points],
            numThreads=1,
            collisionFilterMask=SOLID_MASK,
            physicsClientId=self.client,
        )
        return [hit[2] * FLOOR_FAR_M for hit in raw]

    def clear(self, start: tuple[float, float, float], end: tuple[float, float, float]) -> bool:
        """Return True if nothing stands between two points."""
        hit = pybullet.rayTest(start, end, collisionFilterMask=SOLID_MASK, physicsClientId=self.client)
        return bool(hit[0][0] < 0)

    def place_mover(self, index: int, pose: Pose2) -> None:
        """Put a moving thing where it is now."""
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        for body, part in self._parts[index]:
            x, y, z = part.centre
            pybullet.resetBasePositionAndOrientation(
                body,
                (pose[0] + cos * x - sin * y, pose[1] + sin * x + cos * y, z),
                _quaternion(part.yaw_rad + pose[2], part.pitch_rad),
                physicsClientId=self.client,
            )

    def show_robot(self, pose: Pose2, height_m: float) -> None:
        """Put the robot where a window shall show it."""
        for robot, low, high in self._shells:
            self._place(robot, pose, height_m + (low + high) / 2)

    def _place(self, robot: int, pose: Pose2, middle_m: float) -> None:
        pybullet.resetBasePositionAndOrientation(
            robot, (pose[0], pose[1], middle_m), (0, 0, 0, 1), physicsClientId=self.client
        )

    def contacts(self, pose: Pose2, height_m: float = 0.0, near_m: float = 0.002) -> list[Touch]:
        """Put the robot at a pose and return what it touches, or nearly touches, within near_m."""
        x, y, _ = pose
        reach = BODY_RADIUS_M + near_m
        around = pybullet.getOverlappingObjects(
            (x - reach, y - reach, height_m + BODY_LOW_M),
            (x + reach, y + reach, height_m + TOWER_HIGH_M),
            physicsClientId=self.client,
        )
        things = sorted({body for body, _ in around or ()} - set(self._robots))
        return [contact for thing in things for contact in self._touch(thing, pose, height_m, near_m)]

    def _touch(self, thing: int, pose: Pose2, height_m: float, near_m: float) -> list[Touch]:
        found = []
        for robot, low, high in self._shells:
            self._place(robot, pose, height_m + (low + high) / 2)
            for point in pybullet.getClosestPoints(robot, thing, near_m, physicsClientId=self.client):
                nx, ny, nz = point[7]
                level = math.hypot(nx, ny)
                if abs(nz) > 0.9 or level < 1e-9:
                    continue  # floor, ramp or ceiling
                bearing = math.atan2(-ny, -nx) - pose[2]
                found.append(
                    Touch(
                        (bearing + math.pi) % (2 * math.pi) - math.pi,
                        -point[8],
                        (nx / level, ny / level),
                        low=robot == self._base,
                    )
                )
        return found


def _quaternion(yaw: float, pitch: float) -> tuple[float, float, float, float]:
    """Return x, y, z, w of nose-up pitch, then yaw."""
    half_yaw, half_pitch = yaw / 2, -pitch / 2  # right-handed rotation about y is nose-down
    cy, sy, cp, sp = math.cos(half_yaw), math.sin(half_yaw), math.cos(half_pitch), math.sin(half_pitch)
    return -sy * sp, cy * sp, sy * cp, cy * cp
