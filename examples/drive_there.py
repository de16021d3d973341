"""Map a room, then drive to a place by its name: scan and odometry in, a velocity out, ten times a second.

The robot here is a point that goes as it is told, in an empty room of 8 m by 5 m. It prints what the
navigator does, from turning round to `arrived`, and ends a few centimetres from where it began.
"""

import math
from pathlib import Path
from typing import Any

import numpy as np

import lemtomap
from lemtomap import se2

FILE = Path("room.lemto")
ANGLES = -2.09 + 0.0105 * np.arange(400)


def look(T_room_base: np.ndarray, stamp_s: float) -> lemtomap.Scan:
    """Return what a laser sees from there."""
    x, y, yaw = T_room_base
    ahead, left = np.cos(ANGLES + yaw), np.sin(ANGLES + yaw)
    ranges_m = np.minimum((np.sign(ahead) * 4.0 - x) / ahead, (np.where(left > 0, 3.0, -2.0) - y) / left)
    ranges_m = np.where(ranges_m > 5.6, math.inf, ranges_m)
    return lemtomap.Scan(stamp_s, ranges_m, ANGLES[0], ANGLES[1] - ANGLES[0])


FILE.unlink(missing_ok=True)
pose = np.array([-2.0, 0.0, 0.0])
with lemtomap.Mapper.open(FILE) as mapper, lemtomap.Navigator.open(FILE) as navigator:
    for k in range(40):  # by hand
        pose = np.array([-2.0 + 0.1 * k, 0.0, 0.0])
        mapper.update(look(pose, 0.1 * k), lemtomap.Odometry(0.1 * k, pose))
    navigator.go_to(1)  # or a name that `lemtomap edit room.lemto name 1 kitchen` gave
    twist, events, said = lemtomap.Twist(), list[Any](), ""
    for k in range(40, 400):
        odometry = lemtomap.Odometry(0.1 * k, pose, twist.v_mps, twist.w_radps)
        scan = look(pose, 0.1 * k)
        mapper.update(scan, odometry, events=events)
        output = navigator.drive(mapper.view(), odometry, scan)
        twist, events = output.twist, list(output.events)
        if output.text != said:
            said = output.text
            print(f"{0.1 * k:4.1f} s {output.state}: {said}")
        if output.state in {"arrived", "failed"}:
            break
        pose = se2.compose(pose, [0.1 * twist.v_mps, 0.0, 0.1 * twist.w_radps])
print(f"{math.hypot(pose[0] + 2.0, pose[1]):.2f} m from where it began")
