"""How the base moved while the laser turned. Robot, logs and library de-skew a scan in this one way."""

import numpy as np

from lemtomap.errors import BadSample
from lemtomap.se2 import Pose, between
from lemtomap.types import Odometry, Scan

UNMOVED: Pose = np.zeros((0, 3))
UNMOVED.setflags(write=False)


def motion_during(scan: Scan, odometry: Odometry) -> Pose:
    """Return T_base_beam, where the base was at each beam as seen from where it was at the first one.

    float64 (N, 3), or (0, 3) when it did not move: as odometry says where it knows the base at each beam,
    else at constant velocity on a circle. Raises BadSample when there are not as many poses as beams.
    """
    count = len(scan.ranges_m)
    if odometry.T_odom_base_beams is not None:
        beams = np.asarray(odometry.T_odom_base_beams, dtype=np.float64)
        if beams.shape != (count, 3):
            raise BadSample(
                f"Odometry.T_odom_base_beams: must be a pose for each of the scan's {count} beams, "
                f"has shape {beams.shape}"
            )
        return between(odometry.T_odom_base, beams)
    if scan.time_step_s == 0.0 or (odometry.v_mps == 0.0 and odometry.w_radps == 0.0):
        return UNMOVED
    since_s = scan.time_step_s * np.arange(count)
    turn, way = odometry.w_radps * since_s, odometry.v_mps * since_s
    chord = way * np.sinc(0.5 * turn / np.pi)
    return np.stack([chord * np.cos(0.5 * turn), chord * np.sin(0.5 * turn), turn], axis=-1)
