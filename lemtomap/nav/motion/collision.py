"""The last check before the command leaves navigation: on raw range points, independent of every map."""

from collections.abc import Iterable

import numpy as np

from lemtomap import se2
from lemtomap.nav.config import BodyLimits, CollisionConfig
from lemtomap.nav.kernels import motion as kernels
from lemtomap.nav.types import ObstacleSighting, Points
from lemtomap.se2 import Pose
from lemtomap.types import Twist


def points_now(sightings: Iterable[ObstacleSighting], T_odom_base: Pose, within_m: float) -> Points:
    """Return the hits of the sightings, float64 (N, 2), metres, in the present base frame, near ones only."""
    parts = [
        se2.transform(se2.between(T_odom_base, sighting.T_odom_base), sighting.hits_base)
        for sighting in sightings
    ]
    points = np.concatenate([np.empty((0, 2)), *parts])
    return np.ascontiguousarray(points[np.hypot(points[:, 0], points[:, 1]) < within_m])


def limit_twist(twist: Twist, points_base: Points, body: BodyLimits, collision: CollisionConfig) -> Twist:
    """Slow down, to a stop if need be, so that the robot can halt before touching any point on its arc.

    points_base: float64 (N, 2), metres, base frame. Curvature is kept while slowing; turning in place stays
    allowed at a standstill, as the body is round.
    """
    if twist.v_mps == 0.0 or points_base.size == 0:
        return twist
    keep_m, horizon_s, step_s = body.radius_m + collision.skin_m, collision.horizon_s, collision.step_s
    free_m = kernels.free_arc_length(points_base, twist.v_mps, twist.w_radps, keep_m, horizon_s, step_s)
    if np.isinf(free_m):
        return twist
    room = max(0.0, free_m - collision.stop_short_m)
    brake, react = body.braking_mps2, body.reaction_s
    v_safe = brake * (np.sqrt(react * react + 2.0 * room / brake) - react)
    if v_safe >= abs(twist.v_mps):
        return twist
    share = float(v_safe) / abs(twist.v_mps)
    if share > collision.standing_share:
        return Twist(twist.v_mps * share, twist.w_radps * share)
    return Twist(twist.v_mps * share, _turn_away(twist, points_base, collision.turn_away_radps))


def _turn_away(twist: Twist, points_base: Points, turn_radps: float) -> float:
    """Return the turn of a robot that something holds: the wanted one, or away from the nearest point.

    A door post beside the front holds a robot whose way lies clear ahead; a slight turn lets it slip past.
    """
    if abs(twist.w_radps) >= turn_radps:
        return twist.w_radps
    x, y = points_base[np.argmin(np.hypot(points_base[:, 0], points_base[:, 1]))]
    bearing = np.arctan2(y, x) if twist.v_mps > 0.0 else np.arctan2(-y, -x)
    return twist.w_radps if bearing == 0.0 else float(np.copysign(turn_radps, -bearing))
