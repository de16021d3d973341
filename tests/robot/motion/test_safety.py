"""One table of cases: what happens in each situation, at each side of each limit."""

import dataclasses
import math
from dataclasses import replace

import numpy as np
import pytest

from lemtomap.errors import BadSetting
from lemtomap.robot.motion.proximity import free_travel_m
from lemtomap.robot.motion.safety import (
    Allowed,
    Evidence,
    Reason,
    SafetyGate,
    SafetyLimits,
    Sides,
)
from lemtomap.robot.motion.velocity import SmootherConfig
from lemtomap.settings import range_of

NOW = 100.0
LIM = SafetyLimits()
SIDES = [Sides(left=True), Sides(centre=True), Sides(right=True)]


def evidence(**changes):
    """Everything fresh and well, nothing near."""
    return replace(fresh(NOW), **changes)


def fresh(now_s):
    """All that has a stamp came just now."""
    stamps = dict.fromkeys(
        ("velocity_stamp_s", "base_stamp_s", "map_stamp_s", "cycle_stamp_s", "scan_stamp_s"), now_s
    )
    return Evidence(**stamps, valid_beams=600)


def gate():
    """Permitted and settled."""
    made = SafetyGate()
    made.permit()
    return made


def verdict(v, w, ev, now=NOW):
    return gate().check(v, w, ev, now)


STOPS = [
    ("nan speed", (math.nan, 0.0), {}, Reason.BAD_COMMAND),
    ("infinite turn", (0.1, math.inf), {}, Reason.BAD_COMMAND),
    ("base never heard", (0.3, 0.0), {"base_stamp_s": -math.inf}, Reason.BASE_TIMEOUT),
    ("base just too old", (0.3, 0.0), {"base_stamp_s": NOW - 0.2001}, Reason.BASE_TIMEOUT),
    ("base stamp from the future", (0.3, 0.0), {"base_stamp_s": NOW + 0.0501}, Reason.BASE_TIMEOUT),
    ("wheel drop", (0.0, 0.0), {"wheel_drop": True}, Reason.WHEEL_DROP),
    ("over-current", (0.0, 0.0), {"over_current": True}, Reason.OVER_CURRENT),
    ("charging cable", (-0.1, 0.0), {"adapter": True}, Reason.ADAPTER),
    ("map just too old", (0.3, 0.0), {"map_stamp_s": NOW - 0.2501}, Reason.MAPPING_HANGS),
    ("map too old while standing", (0.0, 0.0), {"map_stamp_s": NOW - 0.2501}, Reason.MAPPING_HANGS),
    ("cycle just too old", (0.3, 0.0), {"cycle_stamp_s": NOW - 0.2501}, Reason.NAVIGATION_HANGS),
    (
        "navigation hangs, so nobody wants anything",
        (0.0, 0.0),
        {"cycle_stamp_s": NOW - 0.2501, "velocity_stamp_s": -math.inf},
        Reason.NAVIGATION_HANGS,
    ),
    ("velocity just too old", (0.3, 0.0), {"velocity_stamp_s": NOW - 0.3001}, Reason.COMMAND_TIMEOUT),
    ("velocity never given", (0.0, 0.0), {"velocity_stamp_s": -math.inf}, Reason.COMMAND_TIMEOUT),
    ("scan just too old", (0.3, 0.0), {"scan_stamp_s": NOW - 0.5001}, Reason.SCAN_TIMEOUT),
    ("turning without scan", (0.0, 0.3), {"scan_stamp_s": -math.inf}, Reason.SCAN_TIMEOUT),
    ("laser covered", (0.3, 0.0), {"valid_beams": 9}, Reason.SCAN_BLIND),
]

PASSES = [
    ("all well", (0.3, 0.5), {}),
    ("base at its limit", (0.3, 0.0), {"base_stamp_s": NOW - 0.2 + 1e-9}),
    ("stamps a little early", (0.3, 0.0), {"base_stamp_s": NOW + 0.049, "scan_stamp_s": NOW + 0.049}),
    ("velocity at its limit", (0.3, 0.0), {"velocity_stamp_s": NOW - 0.3 + 1e-9}),
    ("map at its limit", (0.3, 0.0), {"map_stamp_s": NOW - 0.25 + 1e-9}),
    ("cycle at its limit", (0.3, 0.0), {"cycle_stamp_s": NOW - 0.25 + 1e-9}),
    ("scan at its limit", (0.3, 0.0), {"scan_stamp_s": NOW - 0.5 + 1e-9}),
    ("standing needs no scan", (0.0, 0.0), {"scan_stamp_s": -math.inf, "valid_beams": 0}),
    ("just enough beams", (0.3, 0.0), {"valid_beams": 10}),
    ("at the limits", (LIM.v_max_mps, LIM.w_max_radps), {}),
    ("at the other limits", (-LIM.reverse_max_mps, -LIM.w_max_radps), {}),
    ("battery at its limit", (0.3, 0.0), {"battery_v": 13.2}),
]

LESSENED = [
    ("too fast", (0.66, 0.0), {}, Allowed(0.65, 0.0, Reason.LIMIT)),
    ("too fast back", (-0.21, 0.0), {}, Allowed(-0.2, 0.0, Reason.LIMIT)),
    ("turning too fast", (0.0, 2.0), {}, Allowed(0.0, 1.9, Reason.LIMIT)),
    ("turning too fast right", (0.0, -2.0), {}, Allowed(0.0, -1.9, Reason.LIMIT)),
] + [
    case
    for side in SIDES
    for case in [
        ("cliff forward", (0.3, 0.2), {"cliff": side}, Allowed(0.0, 0.0, Reason.CLIFF)),
        ("cliff back", (-0.2, 0.2), {"cliff": side}, Allowed(-0.1, 0.0, Reason.CLIFF)),
        ("cliff straight back", (-0.05, 0.0), {"cliff": side}, Allowed(-0.05, 0.0, Reason.CLEAR)),
        ("bump forward", (0.3, 0.0), {"bumper": side}, Allowed(0.0, 0.0, Reason.BUMPER)),
        ("bump in an arc", (0.01, 0.4), {"bumper": side}, Allowed(0.0, 0.0, Reason.BUMPER)),
        ("cliff in an arc", (0.01, 0.4), {"cliff": side}, Allowed(0.0, 0.0, Reason.CLIFF)),
        ("bump turning", (0.0, 0.4), {"bumper": side}, Allowed(0.0, 0.4, Reason.CLEAR)),
        ("cliff turning", (0.0, 0.4), {"cliff": side}, Allowed(0.0, 0.0, Reason.CLIFF)),
        ("bump back", (-0.2, 0.9), {"bumper": side}, Allowed(-0.1, 0.5, Reason.BUMPER)),
        ("bump turn right", (0.0, -0.9), {"bumper": side}, Allowed(0.0, -0.5, Reason.BUMPER)),
        ("bump slow back", (-0.1, 0.5), {"bumper": side}, Allowed(-0.1, 0.5, Reason.CLEAR)),
        (
            "cliff and bumper",
            (-0.1, 0.3),
            {"cliff": side, "bumper": side},
            Allowed(-0.1, 0.0, Reason.CLIFF),
        ),
    ]
]


@pytest.mark.parametrize(("name", "wanted", "changes", "reason"), STOPS, ids=[c[0] for c in STOPS])
def test_stops(name, wanted, changes, reason):
    assert verdict(*wanted, evidence(**changes)) == Allowed(0.0, 0.0, reason)


@pytest.mark.parametrize(("name", "wanted", "changes"), PASSES, ids=[c[0] for c in PASSES])
def test_lets_pass(name, wanted, changes):
    assert verdict(*wanted, evidence(**changes)) == Allowed(*wanted, Reason.CLEAR)


@pytest.mark.parametrize(("name", "wanted", "changes", "expected"), LESSENED, ids=[c[0] for c in LESSENED])
def test_lessens(name, wanted, changes, expected):
    assert verdict(*wanted, evidence(**changes)) == expected


def test_permission_starts_false_and_can_be_taken_back():
    made = SafetyGate()
    assert made.check(0.3, 0.0, evidence(), NOW) == Allowed(0.0, 0.0, Reason.NOT_PERMITTED)
    made.permit()
    assert made.check(0.3, 0.0, evidence(), NOW).reason is Reason.CLEAR
    made.revoke()
    assert made.check(0.3, 0.0, evidence(), NOW) == Allowed(0.0, 0.0, Reason.NOT_PERMITTED)


@pytest.mark.parametrize(
    "fault", [{"base_stamp_s": NOW - 1.0}, {"wheel_drop": True}, {"over_current": True}], ids=str
)
def test_settles_after_a_serious_fault(fault):
    made = gate()
    made.check(0.3, 0.0, evidence(**fault), NOW)
    later = fresh(NOW + 0.49)
    assert made.check(0.3, 0.0, later, NOW + 0.499) == Allowed(0.0, 0.0, Reason.SETTLING)
    assert made.check(0.3, 0.0, later, NOW + 0.5) == Allowed(0.3, 0.0, Reason.CLEAR)


def test_a_serious_fault_counts_even_while_not_permitted():
    made = SafetyGate()
    made.check(0.0, 0.0, evidence(wheel_drop=True), NOW)
    made.permit()
    assert made.check(0.3, 0.0, evidence(), NOW + 0.01).reason is Reason.SETTLING


def test_battery_stops_only_after_its_hold_and_forgives_a_sag():
    made = gate()
    for since_s, volt, reason in [
        (0.0, 13.19, Reason.CLEAR),
        (4.9, 13.19, Reason.CLEAR),
        (5.0, 13.3, Reason.CLEAR),
        (5.1, 13.19, Reason.CLEAR),
        (10.0, 13.19, Reason.CLEAR),
        (10.1, 13.19, Reason.BATTERY_EMPTY),
        (10.2, 13.2, Reason.CLEAR),
        (20.0, 13.2, Reason.CLEAR),
    ]:
        now = NOW + since_s
        ev = replace(fresh(now), battery_v=volt)
        assert made.check(0.3, 0.0, ev, now).reason is reason, since_s


def wall(x_m):
    return np.stack([np.full(101, x_m), np.linspace(-1.0, 1.0, 101)], axis=1)


def test_slows_before_a_wall_so_that_delay_and_braking_fit():
    for gap_m in (0.05, 0.1, 0.2, 0.29):
        ev = evidence(points_base=wall(0.19 + 0.025 + gap_m))
        allowed = verdict(0.6, 0.3, ev)
        assert allowed.reason is Reason.NEAR_OBSTACLE
        assert allowed.w_radps / allowed.v_mps == pytest.approx(0.5)
        straight = verdict(0.6, 0.0, ev).v_mps
        assert straight * LIM.reaction_s + straight**2 / (2 * LIM.brake_mps2) == pytest.approx(gap_m)


def test_an_older_scan_means_a_slower_approach():
    young, old = evidence(points_base=wall(0.4)), evidence(points_base=wall(0.4), scan_stamp_s=NOW - 0.3)
    early = evidence(points_base=wall(0.4), scan_stamp_s=NOW + 0.04)
    v = verdict(0.6, 0.0, old).v_mps
    assert v * (LIM.reaction_s + 0.3) + v * v / (2 * LIM.brake_mps2) == pytest.approx(0.4 - 0.215)
    assert verdict(0.6, 0.0, young).v_mps == verdict(0.6, 0.0, early).v_mps


def test_stops_at_the_gap_and_does_not_reverse_for_it():
    for x_m in (0.16, 0.19, 0.2149):
        assert verdict(0.3, 0.0, evidence(points_base=wall(x_m))) == Allowed(0.0, 0.0, Reason.NEAR_OBSTACLE)


def test_turns_and_backs_away_from_a_wall_that_touches():
    ev = evidence(points_base=wall(0.18))
    assert verdict(0.0, 1.0, ev) == Allowed(0.0, 1.0, Reason.CLEAR)
    assert verdict(0.3, 1.0, ev) == Allowed(0.0, 1.0, Reason.NEAR_OBSTACLE)
    creeping = verdict(0.6, 0.5, evidence(points_base=wall(0.19 + 0.025 + 0.003)))
    assert 0.0 < creeping.v_mps < 0.03
    assert creeping.w_radps == 0.5
    assert verdict(-0.1, 0.0, ev) == Allowed(-0.1, 0.0, Reason.CLEAR)


def test_a_far_wall_or_the_robots_own_posts_change_nothing():
    posts = np.array([[0.1, 0.1], [0.1, -0.1], [0.149, 0.0]])
    assert verdict(0.6, 0.0, evidence(points_base=posts)).reason is Reason.CLEAR
    assert verdict(0.6, 0.0, evidence(points_base=wall(3.0))).reason is Reason.CLEAR
    near = np.array([[0.151, 0.0]])
    assert verdict(0.6, 0.0, evidence(points_base=near)).reason is Reason.NEAR_OBSTACLE


def slow_free_travel_m(points, v, w, radius_m, step_m=5e-4, reach_m=4.0):
    """Drive in small steps until a point is inside the disc."""
    x = y = yaw = 0.0
    dt = step_m / abs(v)
    for i in range(int(reach_m / step_m)):
        if np.any(np.hypot(points[:, 0] - x, points[:, 1] - y) < radius_m):
            return i * step_m
        x += v * math.cos(yaw + 0.5 * w * dt) * dt
        y += v * math.sin(yaw + 0.5 * w * dt) * dt
        yaw += w * dt
    return math.inf


@pytest.mark.parametrize("v", [0.4, -0.4])
@pytest.mark.parametrize("w", [0.0, 0.7, -0.7, 3.0])
def test_free_travel_agrees_with_small_steps(v, w):
    rng = np.random.default_rng(7)
    for _ in range(10):
        points = rng.uniform(-1.5, 1.5, (12, 2))
        points = points[np.hypot(points[:, 0], points[:, 1]) > 0.21]
        fast, slow = free_travel_m(points, v, w, 0.2), slow_free_travel_m(points, v, w, 0.2)
        turn_m = math.inf if w == 0.0 else 2 * math.pi * abs(v / w)
        if slow <= min(turn_m, 3.9):
            assert fast == pytest.approx(slow, abs=2e-3)
        else:
            assert fast >= min(turn_m, 3.9) - 2e-3


def test_free_travel_without_points_or_motion_is_endless():
    assert free_travel_m(np.zeros((0, 2)), 0.3, 0.1, 0.2) == math.inf
    assert free_travel_m(np.array([[0.1, 0.0]]), 0.0, 0.1, 0.2) == math.inf
    assert free_travel_m(np.array([[0.0, 3.0]]), 0.3, 0.0, 0.2) == math.inf


def test_flags_of_two_moments_join():
    assert (Sides(left=True) | Sides(right=True)) == Sides(left=True, right=True)
    assert (Sides() | Sides(centre=True)) == Sides(centre=True)


SAFE = {
    "v_max_mps": (0.05, 0.65),
    "reverse_max_mps": (0.02, 0.2),
    "w_max_radps": (0.1, 1.92),
    "back_off_mps": (0.02, 0.15),
    "bumped_w_max_radps": (0.05, 1.0),
    "velocity_age_s": (0.1, 0.5),
    "base_age_s": (0.04, 0.5),
    "scan_age_s": (0.15, 0.8),
    "map_age_s": (0.15, 0.5),
    "cycle_age_s": (0.15, 0.5),
    "settle_s": (0.2, 10.0),
    "battery_empty_v": (13.0, 15.0),
    "battery_hold_s": (0.5, 30.0),
    "scan_valid_beams": (5, 300),
    "body_radius_m": (0.178, 0.5),
    "side_margin_m": (0.005, 0.2),
    "stop_gap_m": (0.01, 0.5),
    "creep_share": (0.01, 0.2),
    "brake_mps2": (0.1, 1.2),
    "reaction_s": (0.1, 1.0),
    "own_parts_m": (0.0, 0.17),
}


def test_what_the_gate_can_be_told_is_bounded_with_a_reason():
    ranges = {field.name: range_of(field) for field in dataclasses.fields(SafetyLimits)}
    assert {name: (each.low, each.high) for name, each in ranges.items()} == SAFE
    assert all(each.why for each in ranges.values())


@pytest.mark.parametrize("cls", [SafetyLimits, SmootherConfig])
def test_the_bounds_of_safety_hold_for_programs_too(cls):
    for field in dataclasses.fields(cls):
        allowed = range_of(field)
        step = 1 if isinstance(field.default, int) else 1e-9
        for edge, beyond in ((allowed.low, allowed.low - step), (allowed.high, allowed.high + step)):
            assert getattr(cls(**{field.name: edge}), field.name) == edge
            with pytest.raises(BadSetting, match=f"{field.name} = .*must lie between"):
                cls(**{field.name: beyond})
