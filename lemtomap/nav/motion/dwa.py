"""Dynamic Window Approach: the velocity that gets furthest down the field without touching anything."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lemtomap.nav.config import BodyLimits, DwaConfig
from lemtomap.nav.kernels import motion as kernels
from lemtomap.nav.motion.metric import MetricPlan
from lemtomap.se2 import Pose
from lemtomap.types import Twist


@dataclass(frozen=True, slots=True)
class ArcEnd:
    """The plan's target is where to stop."""

    to_go_m: float

    def v_cap_mps(self, braking_mps2: float, creep_mps: float) -> float:
        """Return the speed from which half the braking limit still stops at the target."""
        return max(creep_mps, float(np.sqrt(braking_mps2 * max(0.0, self.to_go_m - 0.03))))


@dataclass(frozen=True, slots=True)
class Choice:
    """The chosen velocity; None when every trajectory collides."""

    twist: Twist | None
    tried: int


def choose_twist(
    plan: MetricPlan,
    T_grid_base: Pose,
    twist: Twist,
    ending: ArcEnd | None,
    body: BodyLimits,
    dwa: DwaConfig,
) -> Choice:
    """Return the best velocity reachable within the dynamic window.

    Tried with the margin the planner keeps; where that lets no arc forward, with the bare body.
    """
    if not plan.costs.holds(T_grid_base):
        return Choice(None, 0)
    choice = _choose(plan, T_grid_base, twist, ending, body, dwa, body.radius_m + dwa.margin_m)
    if choice.twist is None or choice.twist.v_mps < dwa.held_mps:
        bare = _choose(plan, T_grid_base, twist, ending, body, dwa, body.radius_m)
        return choice if bare.twist is None else bare
    return choice


def _choose(
    plan: MetricPlan,
    T_grid_base: Pose,
    twist: Twist,
    ending: ArcEnd | None,
    body: BodyLimits,
    dwa: DwaConfig,
    keep_m: float,
) -> Choice:
    costs = plan.costs
    row, col = costs.cell(T_grid_base)
    near = ending is not None and ending.to_go_m < dwa.near_m
    v_cap_mps = body.v_max_mps if ending is None else ending.v_cap_mps(body.braking_mps2, dwa.creep_mps)
    vs, ws = velocity_window(twist, v_cap_mps, body, dwa)
    here_m = float(costs.clearance[int(row), int(col)]) * costs.resolution_m
    body_m = min(keep_m, max(dwa.tightest_m, here_m - 0.1 * costs.resolution_m))
    scores = np.empty((vs.size, ws.size))
    best = kernels.score_trajectories(
        plan.field, costs.cost, costs.clearance, costs.resolution_m, row, col, float(T_grid_base[2]),
        twist.v_mps, twist.w_radps, vs, ws,
        body.acceleration_mps2, body.braking_mps2, body.turn_acceleration_radps2,
        dwa.horizon_s, dwa.step_s, 0.0 if near else dwa.forward_m, body_m,
        dwa.dearest, dwa.price_share, dwa.turn_weight, dwa.change_weight,
        int(near), scores,
    )  # fmt: skip
    if best < 0:
        return Choice(None, scores.size)
    return Choice(Twist(float(vs[best // ws.size]), float(ws[best % ws.size])), scores.size)


def velocity_window(
    twist: Twist, v_cap_mps: float, body: BodyLimits, dwa: DwaConfig
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the v (m/s) and w (rad/s) to try: what can be reached within window_s, never backwards."""
    v, w, reach_s = twist.v_mps, twist.w_radps, dwa.window_s
    v_high = min(body.v_max_mps, v_cap_mps, v + body.acceleration_mps2 * reach_s)
    v_low = max(0.0, v - body.braking_mps2 * reach_s)
    w_high = min(body.w_max_radps, w + body.turn_acceleration_radps2 * reach_s)
    w_low = max(-body.w_max_radps, w - body.turn_acceleration_radps2 * reach_s)
    vs = np.linspace(min(v_low, max(v_high, 0.0)), max(v_high, 0.0), dwa.v_samples)
    ws = np.linspace(min(w_low, w_high), max(w_low, w_high), dwa.w_samples)
    ws[np.argmin(np.abs(ws))] = 0.0 if w_low < 0.0 < w_high else ws[np.argmin(np.abs(ws))]
    return vs, ws


def approach(now: Twist, wanted: Twist, body: BodyLimits, period_s: float) -> Twist:
    """Return the velocity one control period later on the way to the wanted one, within the limits."""
    speeding = abs(wanted.v_mps) > abs(now.v_mps)
    v_step = (body.acceleration_mps2 if speeding else body.braking_mps2) * period_s
    w_step = body.turn_acceleration_radps2 * period_s
    v = min(max(wanted.v_mps, now.v_mps - v_step), now.v_mps + v_step)
    w = min(max(wanted.w_radps, now.w_radps - w_step), now.w_radps + w_step)
    return Twist(v, w)
