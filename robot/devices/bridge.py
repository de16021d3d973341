"""Driver samples -> what LEMTOMap takes. The one place that knows both."""

import math

import numpy as np
from numpy.typing import NDArray

from lemtomap import se2
from lemtomap.drivers.hokuyo.events import LaserScan
from lemtomap.drivers.kobuki.battery import PowerSource
from lemtomap.drivers.kobuki.events import BumperEvent, CliffEvent, KobukiSample
from lemtomap.drivers.kobuki.packets import Bumper, Cliff
from lemtomap.nav import types as nav
from lemtomap.robot.motion.safety import Sides
from lemtomap.se2 import Pose
from lemtomap.types import Odometry, Scan

# Kobuki's sensors on its rim (reference, section 14): cliffs at 57 degrees, side bumpers at 60.
BUMPER_BEARING_RAD = {Bumper.LEFT: math.radians(60), Bumper.CENTER: 0.0, Bumper.RIGHT: math.radians(-60)}
CLIFF_BEARING_RAD = {Cliff.LEFT: math.radians(57), Cliff.CENTER: 0.0, Cliff.RIGHT: math.radians(-58)}
URG_SILENT_FREE_M = 2.0  # walls of an office at a grazing angle return nothing from 2 to 3 m on
FAR_SENSOR_M = 20.0  # UTM-30LX and its kin do see walls, and say so when there is none


def sides_of_bumper(flags: Bumper) -> Sides:
    """Return the pressed bumpers as the safety gate takes them."""
    return Sides(bool(flags & Bumper.LEFT), bool(flags & Bumper.CENTER), bool(flags & Bumper.RIGHT))


def sides_of_cliff(flags: Cliff) -> Sides:
    """Return the cliff sensors without floor as the safety gate takes them."""
    return Sides(bool(flags & Cliff.LEFT), bool(flags & Cliff.CENTER), bool(flags & Cliff.RIGHT))


def on_adapter(sample: KobukiSample) -> bool:
    """Return True if the charging cable is in; driving would tear it out."""
    return sample.battery.source is PowerSource.ADAPTER


def contact_of(event: object) -> nav.Contact | None:
    """Return a bump or a cliff for navigation; None for any other event and for releases."""
    if isinstance(event, BumperEvent) and event.pressed:
        return nav.Contact(event.stamp_s, nav.ContactKind.BUMPER, BUMPER_BEARING_RAD[event.side])
    if isinstance(event, CliffEvent) and event.seen:
        return nav.Contact(event.stamp_s, nav.ContactKind.CLIFF, CLIFF_BEARING_RAD[event.side])
    return None


def scan_of(seen: LaserScan, T_base_laser: Pose, *, upside_down: bool = False) -> Scan:
    """Return a driver's scan as LEMTOMap takes it; the beams of a laser upside down turn clockwise."""
    way_round = -1.0 if upside_down else 1.0
    return Scan(
        stamp_s=seen.stamp_s,
        ranges_m=seen.ranges_m,
        angle_min_rad=way_round * seen.angle_min_rad,
        angle_step_rad=way_round * seen.angle_step_rad,
        time_step_s=seen.time_step_s,
        range_min_m=seen.range_min_m,
        range_max_m=seen.range_max_m,
        silent_free_m=URG_SILENT_FREE_M if seen.range_max_m < FAR_SENSOR_M else math.inf,
        T_base_laser=T_base_laser,
    )


def points_now(sighting: nav.ObstacleSighting, odometry: Odometry) -> NDArray[np.float64]:
    """Return the hits of a scan in the base frame of now, float64 (N, 2), metres."""
    T_now_then = se2.between(odometry.T_odom_base, sighting.T_odom_base)
    return se2.transform(T_now_then, sighting.hits_base)
