"""How far a round robot can drive along an arc before it touches a point of the raw scan.

No map, no costmap: this is the geometry of the last collision check. Closed form, so it costs some tens of
microseconds for a whole scan and can run at every control step.
"""

import math

import numpy as np
from numpy.typing import NDArray

STRAIGHT_W_RADPS = 1e-4  # below this turn rate an arc of any allowed speed is straight to under a millimetre


def free_travel_m(points_base: NDArray[np.float64], v_mps: float, w_radps: float, radius_m: float) -> float:
    """Return the path length that the robot's centre can cover before a disc of `radius_m` meets a point.

    `points_base`: float64 (N, 2), metres, base frame. +inf when nothing is met within one turn of the
    arc, or when v is 0 (a disc that turns in place sweeps nothing). Points already inside the disc count as
    contact at 0 m when the motion leads towards them and are ignored when it leads away from them.
    """
    if v_mps == 0.0 or len(points_base) == 0:
        return math.inf
    x = points_base[:, 0] * math.copysign(1.0, v_mps)
    y = points_base[:, 1]
    inside = x * x + y * y < radius_m * radius_m
    if bool(np.any(inside & (x > 0.0))):
        return 0.0
    x, y = x[~inside], y[~inside]
    if abs(w_radps) < STRAIGHT_W_RADPS:
        return _straight_m(x, y, radius_m)
    mirror = math.copysign(1.0, v_mps * w_radps)  # the centre of the turn lies at y = v / w
    return _arc_m(x, y * mirror, abs(v_mps / w_radps), radius_m)


def _straight_m(x: NDArray[np.float64], y: NDArray[np.float64], radius_m: float) -> float:
    ahead = (np.abs(y) < radius_m) & (x > 0.0)
    if not bool(ahead.any()):
        return math.inf
    return float(np.min(x[ahead] - np.sqrt(radius_m**2 - y[ahead] ** 2)))


def _arc_m(x: NDArray[np.float64], y: NDArray[np.float64], turn_radius_m: float, radius_m: float) -> float:
    """Turn about (0, turn_radius); cosine law in the triangle of turning centre, robot and point."""
    reach_m = np.hypot(x, y - turn_radius_m)
    with np.errstate(divide="ignore", invalid="ignore"):
        cos_contact = (turn_radius_m**2 + reach_m**2 - radius_m**2) / (2.0 * turn_radius_m * reach_m)
    met = np.abs(cos_contact) < 1.0
    if not bool(met.any()):
        return math.inf
    bearing_rad = np.arctan2(x[met], turn_radius_m - y[met]) % (2.0 * math.pi)
    turned_rad = (bearing_rad - np.arccos(cos_contact[met])) % (2.0 * math.pi)
    return float(turned_rad.min()) * turn_radius_m
