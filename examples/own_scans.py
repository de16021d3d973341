"""Map your own scans: a robot with a laser drives through a room of 8 m by 5 m, and ten lines map it.

Run it twice. It says at which node the robot is and how many are in sight; the second time it goes on with
`my.lemto`: what it maps until it recognises the room stays in the map beside what was there.
"""

import math
from collections.abc import Iterator
from typing import Any

import lemtomap


def my_robot() -> Iterator[tuple[float, Any, Any]]:
    """Yield time, pose by the wheels and ranges: replace this by what your robot tells."""
    for step in range(60):
        x_m = 0.1 * step - 3.0
        yield 0.1 * step, (x_m, 0.0, 0.0), [_range_m(x_m, -2.09 + 0.0061 * beam) for beam in range(686)]


def _range_m(x_m: float, angle_rad: float) -> float:
    """Return the way from (x, 0) to the nearest wall of the room, infinite beyond what the laser sees."""
    ahead, left = math.cos(angle_rad), math.sin(angle_rad)
    to_end_m = ((4.0 if ahead > 0.0 else -4.0) - x_m) / ahead if ahead else math.inf
    to_side_m = (3.0 if left > 0.0 else -2.0) / left if left else math.inf
    range_m = min(to_end_m, to_side_m)
    return range_m if range_m <= 5.6 else math.inf


with lemtomap.Mapper.open("my.lemto") as mapper:
    for stamp_s, pose, ranges_m in my_robot():  # pose: x m, y m, yaw rad by wheels and gyro; lists will do
        scan = lemtomap.Scan(stamp_s, ranges_m, angle_min_rad=-2.09, angle_step_rad=0.0061, range_max_m=5.6)
        mapper.update(scan, lemtomap.Odometry(stamp_s, pose))
    view = mapper.view()
print(f"at node {view.associated_id} of {len(view.T_grid_node)} in sight, quality {view.quality:.2f}")
