"""Is what stands where stamps belong a clock?"""

import numpy as np
from numpy.typing import NDArray

BACK_S = 5.0  # loggers mix messages up by less than a second
GAP_S = 3600.0  # a clock that was set leaps by more
SLOWEST_S = 60.0  # from scan to scan
FASTEST_MPS = 10.0  # of a robot


def tells_time(stamps_s: NDArray[np.float64], steps_m: NDArray[np.float64]) -> bool:
    """Return True if the stamps tell how long the drive took.

    stamps_s: float64 (N,), in the order of the scans; steps_m: float64 (N - 1,), the way from scan to scan.
    They do not when they stand still, were set forward or back, or make a racing car of the robot.
    """
    if len(stamps_s) < 2:
        return False
    steps_s = np.diff(stamps_s)
    ahead_s, back_s = float(steps_s[steps_s > 0].sum()), float(-steps_s[steps_s < 0].sum())
    if ahead_s <= 2.0 * back_s or steps_s.min() < -BACK_S or steps_s.max() > GAP_S:
        return False
    usual_mps = float(np.median(steps_m)) / max(float(np.median(steps_s)), 1e-9)
    return 0.0 < float(np.median(steps_s)) <= SLOWEST_S and usual_mps <= FASTEST_MPS
