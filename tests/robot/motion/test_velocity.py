"""One deterministic table for the mux, and the smoother's promises."""

import math

import pytest

from lemtomap.robot.motion.velocity import (
    NAVIGATION,
    SAFETY,
    TELEOP,
    SmootherConfig,
    VelocityMux,
    VelocitySmoother,
)
from lemtomap.types import Twist

TABLE = [  # (source, offered at) ..., asked at -> who wins
    ([], 1.0, None),
    ([(NAVIGATION, 1.0)], 1.0, "navigation"),
    ([(NAVIGATION, 1.0)], 1.2999, "navigation"),
    ([(NAVIGATION, 1.0)], 1.31, None),
    ([(NAVIGATION, 1.0), (TELEOP, 1.0)], 1.1, "teleop"),
    ([(TELEOP, 1.0), (NAVIGATION, 1.05)], 1.1, "teleop"),
    ([(TELEOP, 1.0), (NAVIGATION, 1.4)], 1.51, "navigation"),
    ([(TELEOP, 1.0), (NAVIGATION, 1.0)], 1.4, "teleop"),
    ([(SAFETY, 1.0), (TELEOP, 1.2)], 1.25, "safety"),
    ([(SAFETY, 1.0), (TELEOP, 1.2)], 1.31, "teleop"),
]


@pytest.mark.parametrize(("offers", "asked_s", "winner"), TABLE, ids=str)
def test_mux_table(offers, asked_s, winner):
    mux = VelocityMux()
    for source, at_s in offers:
        mux.offer(source, Twist(at_s, 0.0), at_s)
    wish = mux.select(asked_s)
    assert (wish and wish.source) == winner


def test_a_newer_wish_replaces_and_a_withdrawn_one_is_gone():
    mux = VelocityMux()
    mux.offer(NAVIGATION, Twist(0.1), 1.0)
    mux.offer(NAVIGATION, Twist(0.2), 1.1)
    assert mux.select(1.2).twist == Twist(0.2)
    mux.withdraw(NAVIGATION)
    mux.withdraw(NAVIGATION)
    assert mux.select(1.2) is None


def test_smoother_reaches_the_target_in_the_right_time_and_never_overshoots():
    smoother = VelocitySmoother(SmootherConfig(accel_mps2=0.5, brake_mps2=0.8))
    speeds = []
    for _ in range(100):
        out = smoother.step(Twist(0.5, -1.0), 0.02)
        smoother.note_sent(out.v_mps, out.w_radps)
        speeds.append(out.v_mps)
    assert max(speeds) == 0.5
    assert sum(v < 0.5 for v in speeds) == pytest.approx(50, abs=1)
    assert smoother.sent.w_radps == -1.0


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_braking_and_reversing_pass_through_zero(sign):
    smoother = VelocitySmoother(SmootherConfig(brake_mps2=1.0, accel_mps2=0.5))
    smoother.note_sent(0.025 * sign, 0.0)
    steps = []
    for _ in range(4):
        out = smoother.step(Twist(-0.02 * sign), 0.02)
        smoother.note_sent(out.v_mps, 0.0)
        steps.append(round(out.v_mps * sign, 6))
    assert steps == [0.005, 0.0, -0.01, -0.02]


def test_the_next_step_starts_from_what_the_gate_let_through():
    smoother = VelocitySmoother(SmootherConfig(accel_mps2=0.5))
    smoother.note_sent(0.4, 0.0)
    smoother.note_sent(0.0, 0.0)
    assert smoother.step(Twist(0.4), 0.02).v_mps == pytest.approx(0.01)


def test_nonsense_goes_on_to_the_gate_and_leaves_no_trace():
    smoother = VelocitySmoother()
    assert math.isnan(smoother.step(Twist(math.nan, 0.0), 0.02).v_mps)
    assert smoother.step(Twist(0.0, math.inf), 0.02).w_radps == math.inf
    assert smoother.sent == Twist()
