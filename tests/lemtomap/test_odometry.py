import math

import numpy as np
import pytest

from lemtomap.odometry import (
    NotCovered,
    OdometryBuffer,
    OdometryConfig,
    WheelGyroOdometry,
)
from lemtomap.types import Odometry

TICK_M = OdometryConfig().metres_per_tick


def drive_circle(odometry, *, radius_m=1.0, v_mps=0.3, turns=3.0, bias_radps=0.0, start_s=0.0):
    """Feed exact wheels and heading of a circle at 50 Hz; return the last answer."""
    w = v_mps / radius_m
    steps = round(turns * 2.0 * math.pi / w / 0.02)
    for i in range(steps + 1):
        t = i * 0.02
        left = (v_mps - w * 0.115) * t / TICK_M
        right = (v_mps + w * 0.115) * t / TICK_M
        yaw = math.remainder((w + bias_radps) * t + 3.0, 2.0 * math.pi)
        answer = odometry.update(start_s + t, round(left) % 65536, round(right) % 65536, yaw, w + bias_radps)
    return answer, steps * 0.02 * w


def test_circle_closes_though_encoders_and_heading_wrap():
    answer, turned = drive_circle(WheelGyroOdometry())
    end = (math.sin(turned), 1.0 - math.cos(turned), math.remainder(turned, 2 * math.pi))
    assert answer.T_odom_base == pytest.approx(end, abs=1e-3)
    assert (answer.v_mps, answer.w_radps) == (pytest.approx(0.3, abs=0.01), pytest.approx(0.3))


def test_wheels_alone_give_the_heading_when_there_is_no_gyro():
    odometry = WheelGyroOdometry()
    odometry.update(0.0, 0, 0, math.nan, math.nan)
    answer = odometry.update(1.0, 65536 - 1000, 1000, math.nan, math.nan)
    assert answer.T_odom_base == pytest.approx((0, 0, 2000 * TICK_M / 0.23))


def test_bias_is_learnt_standing_and_taken_off_while_driving():
    odometry, bias = WheelGyroOdometry(), math.radians(0.05)
    for i in range(1000):
        standing = odometry.update(i * 0.02 - 20.0, 0, 0, 3.0 + bias * (i - 1000) * 0.02, bias)
    assert standing.T_odom_base[2] == pytest.approx(0.0, abs=bias * 0.6)  # only until it was seen to stand
    assert odometry.gyro_bias_radps == pytest.approx(bias, rel=0.01)
    yaw_before = standing.T_odom_base[2]
    answer, turned = drive_circle(odometry, bias_radps=bias, turns=1.0)
    error_rad = math.remainder(answer.T_odom_base[2] - yaw_before - turned, 2 * math.pi)
    assert error_rad == pytest.approx(0.0, abs=1e-3)


def test_a_base_turned_by_hand_is_not_taken_for_standing():
    odometry = WheelGyroOdometry()
    for i in range(101):
        answer = odometry.update(i * 0.02, 7, 7, 0.5 * i * 0.02, 0.5)
    assert answer.T_odom_base[2] == pytest.approx(1.0)
    assert odometry.gyro_bias_radps == 0.0


def test_encoders_that_start_anew_move_nothing():
    odometry = WheelGyroOdometry()
    odometry.update(0.0, 30000, 30000, 0.0, 0.0)
    assert odometry.update(0.02, 12, 3, 0.0, 0.0).T_odom_base == pytest.approx((0, 0, 0))
    assert odometry.update(0.04, 112, 103, 0.0, 0.0).T_odom_base[0] == pytest.approx(100 * TICK_M)


def test_buffer_interpolates_through_the_wrap_and_stays_bounded():
    buffer = OdometryBuffer(capacity=50)
    for i in range(1000):
        yaw = math.remainder(0.1 * i, 2 * math.pi)
        buffer.add(Odometry(i * 0.02, np.array([0.01 * i, 0.0, yaw]), v_mps=0.5))
    assert len(buffer) == 50
    assert buffer.oldest_s == pytest.approx(950 * 0.02)
    for step in np.linspace(950, 999, 200):
        x, _, yaw = buffer.at(step * 0.02)
        assert x == pytest.approx(0.01 * step)
        assert math.remainder(yaw - 0.1 * step, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)
    assert buffer.at(np.full((2, 3), 19.5)).shape == (2, 3, 3)
    assert buffer.odometry_at(19.5).v_mps == 0.5


@pytest.mark.parametrize("stamp_s", [18.9, 20.0])
def test_buffer_says_what_it_does_not_cover(stamp_s):
    buffer = OdometryBuffer(capacity=50)
    for i in range(1000):
        buffer.add(Odometry(i * 0.02, np.zeros(3)))
    assert not buffer.covers(stamp_s)
    with pytest.raises(NotCovered, match=r"covers 19\.000 to 19\.980 s"):
        buffer.at([19.5, stamp_s])
