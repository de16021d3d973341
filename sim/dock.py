"""The charging dock: infra-red sectors before it, contacts that charge (kobuki-protocol, 3.2 and 13)."""

import math

from lemtomap.sim.scene import BODY_RADIUS_M, Scene
from lemtomap.sim.world import Pose2

NEAR_LEFT, NEAR_CENTRE, NEAR_RIGHT, FAR_CENTRE, FAR_LEFT, FAR_RIGHT = 0x01, 0x02, 0x04, 0x08, 0x10, 0x20
NEAR_M, FAR_M = 0.6, 5.0  # working area about 2 m x 5 m
CENTRE_HALF_WIDTH_RAD = math.radians(6)
SIDE_WIDTH_RAD = math.radians(35)
RECEIVERS_RAD = (-math.radians(60), 0.0, math.radians(60))  # right, centre, left; positions are not published
RECEIVER_VIEW_RAD = math.radians(38)
CONTACT_M, CONTACT_YAW_RAD, CONTACT_OFF_M = 0.01, math.radians(12), 0.025
LAMP_HEIGHT_M = 0.08


def dock_ir(dock: Pose2, robot: Pose2, scene: Scene) -> tuple[int, int, int]:
    """Return what the right, centre and left receiver see of the dock."""
    dx, dy = robot[0] - dock[0], robot[1] - dock[1]
    distance = math.hypot(dx, dy)
    sector = _sector(distance, _wrap(math.atan2(dy, dx) - dock[2]))
    if not sector:
        return 0, 0, 0
    towards = _wrap(math.atan2(-dy, -dx) - robot[2])
    seen = [sector if abs(_wrap(towards - axis)) < RECEIVER_VIEW_RAD else 0 for axis in RECEIVERS_RAD]
    if not any(seen) or not _visible(dock, robot, scene):
        return 0, 0, 0
    return seen[0], seen[1], seen[2]


def _sector(distance: float, bearing: float) -> int:
    """Return the bit of the sector a robot stands in; left and right are the dock's own."""
    near = distance < NEAR_M
    if distance > FAR_M:
        return 0
    if abs(bearing) < CENTRE_HALF_WIDTH_RAD:
        return NEAR_CENTRE if near else FAR_CENTRE
    if abs(bearing) > SIDE_WIDTH_RAD:
        return 0
    if bearing > 0:
        return NEAR_LEFT if near else FAR_LEFT
    return NEAR_RIGHT if near else FAR_RIGHT


def _visible(dock: Pose2, robot: Pose2, scene: Scene) -> bool:
    start = (dock[0] + 0.05 * math.cos(dock[2]), dock[1] + 0.05 * math.sin(dock[2]), LAMP_HEIGHT_M)
    return scene.clear(start, (robot[0], robot[1], LAMP_HEIGHT_M))


def docked(dock: Pose2, robot: Pose2) -> bool:
    """Return True if the charging contacts touch."""
    dx, dy = robot[0] - dock[0], robot[1] - dock[1]
    ahead = dx * math.cos(dock[2]) + dy * math.sin(dock[2])
    off = -dx * math.sin(dock[2]) + dy * math.cos(dock[2])
    facing = abs(_wrap(robot[2] - dock[2] - math.pi)) < CONTACT_YAW_RAD
    return facing and abs(off) < CONTACT_OFF_M and ahead < BODY_RADIUS_M + CONTACT_M


def _wrap(angle: float) -> float:
    return (angle + math.pi) % (2 * math.pi) - math.pi
