"""Where a log's beams point is what the log says, else what CARMEN takes for their number, else asked for."""

import math

import numpy as np
import pytest

from lemtomap.errors import BadLog, BadSetting
from robot.logs import open_log
from tests.robot.carmen_lines import flaser, robotlaser1, written

URG_DEG = 360.0 / 1024.0


def fan_deg(log):
    """Return the first and the last angle and the step of the first scan, degrees."""
    scan = next(scan for _, scan in log)
    step = math.degrees(scan.angle_step_rad)
    first = math.degrees(scan.angle_min_rad)
    return first, first + step * (len(scan.ranges_m) - 1), step


def settings(fov, resolution):
    named = {"fov": fov, "resolution": resolution}
    return [f"PARAM laser_front_laser_{name} {v} nohost 0" for name, v in named.items() if v is not None]


@pytest.mark.parametrize(
    ("beams", "first_deg", "last_deg", "step_deg"),
    [
        (180, -90.0, 89.0, 1.0),
        (181, -90.0, 90.0, 1.0),
        (360, -90.0, 89.5, 0.5),
        (361, -90.0, 90.0, 0.5),
        (400, -50.0, 49.75, 0.25),
        (401, -50.0, 50.0, 0.25),
        (541, -135.0, 135.0, 0.5),
        (682, -340.5 * URG_DEG, 340.5 * URG_DEG, URG_DEG),
        (683, -341 * URG_DEG, 341 * URG_DEG, URG_DEG),
        (769, -135.0, 135.0, URG_DEG),
        (1081, -135.0, 135.0, 0.25),
    ],
)
def test_the_number_of_beams_tells_the_field_of_view_when_the_log_does_not(
    tmp_path, beams, first_deg, last_deg, step_deg
):
    log = open_log(written(tmp_path, flaser([1.0] * beams)))
    assert fan_deg(log) == pytest.approx((first_deg, last_deg, step_deg))


@pytest.mark.parametrize(
    ("beams", "fov", "resolution", "expected_deg"),
    [
        (1081, "270", "0.2500", (-135.0, 135.0, 0.25)),
        (541, "180", None, (-90.0, 90.0, 1.0 / 3.0)),  # against what CARMEN would take
        (641, "3.14159", None, (-90.0, 90.0, 180.0 / 640)),
        (1440, "6.283185", "0.004363", (-180.0, 179.75, 0.25)),
        (541, "4.712389", "0.5", (-135.0, 135.0, 0.5)),
        (1080, "270", "0.25", (-135.0, 134.75, 0.25)),
        (180, "179", "1", (-89.5, 89.5 - 179 / 180, 179 / 180)),
        (721, None, "0.25", (-90.0, 90.0, 0.25)),
        (721, None, "0.0043633", (-90.0, 90.0, 0.25)),
        (682, "240", "0.36", (-340.5 * URG_DEG, 340.5 * URG_DEG, URG_DEG)),
        (361, "180", "1", (-90.0, 90.0, 0.5)),  # contradiction: the number of beams agrees with 180
        (1081, "180", "0.25", (-135.0, 135.0, 0.25)),  # and here with 0.25
        (181, "0", "0", (-90.0, 90.0, 1.0)),  # 0 says nothing
    ],
)
def test_what_the_log_says_of_its_laser_decides(tmp_path, beams, fov, resolution, expected_deg):
    log = open_log(written(tmp_path, *settings(fov, resolution), flaser([1.0] * beams)))
    assert fan_deg(log) == pytest.approx(expected_deg, abs=0.01)


@pytest.mark.parametrize(
    ("beams", "fov", "resolution"),
    [(179, None, None), (500, "180", "1"), (1081, None, "1"), (1081, "180", "1")],
)
def test_beams_that_nothing_explains_are_refused_in_a_line_that_asks(tmp_path, beams, fov, resolution):
    path = written(tmp_path, *settings(fov, resolution), flaser([1.0] * beams))
    place = 1 + len(settings(fov, resolution))
    with pytest.raises(BadLog, match=rf":{place}: a scan of {beams} beams.*--field-of-view") as caught:
        open_log(path)
    assert "\n" not in str(caught.value)
    assert fan_deg(open_log(path, math.radians(90.0)))[0] == pytest.approx(-45.0)


def test_a_field_of_view_given_by_hand_goes_before_all_the_log_says(tmp_path):
    lines = *settings("180", "0.5"), flaser([1.0] * 361), robotlaser1([1.0] * 181)
    for line in lines[2:]:
        log = open_log(written(tmp_path, *lines[:2], line), math.radians(240.0))
        assert fan_deg(log)[:2] == pytest.approx((-120.0, 120.0))


def test_the_laser_of_a_tinyslam_log_is_known(tmp_path):
    path = written(tmp_path, " ".join(["0"] * 707), name="a.dat")
    with pytest.raises(BadSetting, match="--field-of-view is for CARMEN"):
        open_log(path, math.radians(240.0))


@pytest.mark.parametrize(
    ("beams", "start_deg", "fov_deg", "step_deg", "expected_deg"),
    [
        (181, -90.0, 181.0, 1.0, (-90.0, 90.0, 1.0)),  # as fr-clinic writes it
        (180, -89.5, 180.0, 1.0, (-89.5, 89.5, 1.0)),
        (180, -89.0, 179.0, 1.0, (-89.0, 90.0, 1.0)),
        (361, -90.0, 180.0, 0.5, (-90.0, 90.0, 0.5)),
        (541, -135.0, 270.0, 0.0, (-135.0, 135.0, 0.5)),
        (541, -135.0, 0.0, 0.5, (-135.0, 135.0, 0.5)),
        (181, -90.0, 180.0, 0.5, (-90.0, 90.0, 1.0)),  # contradiction: the start agrees with 180
        (1081, -135.0, 180.0, 0.25, (-135.0, 135.0, 0.25)),  # and here with 0.25
    ],
)
def test_a_laser_line_with_angles_of_its_own_is_taken_at_its_word(
    tmp_path, beams, start_deg, fov_deg, step_deg, expected_deg
):
    line = robotlaser1([1.0] * beams, start_deg=start_deg, fov_deg=fov_deg, step_deg=step_deg)
    assert fan_deg(open_log(written(tmp_path, line))) == pytest.approx(expected_deg, abs=0.02)


def test_a_laser_line_that_contradicts_itself_is_skipped_and_refused_when_all_do(tmp_path):
    odd = robotlaser1([1.0] * 181, start_deg=-30.0, fov_deg=180.0, step_deg=0.25)
    log = open_log(written(tmp_path, robotlaser1([1.0] * 181), odd))
    assert len(log) == 1
    assert any(
        "broken lines are skipped (line 2: a scan of 181 beams is not 180 degrees" in r for r in log.remarks
    )
    with pytest.raises(BadLog, match=r":1: a scan of 181 beams .* --field-of-view"):
        open_log(written(tmp_path, odd))


def test_scans_of_180_and_181_beams_mix(tmp_path):
    lines = [
        robotlaser1([1.0] * 181, fov_deg=181.0),
        robotlaser1([2.0] * 180, start_deg=-89.75),
        robotlaser1([3.0] * 181, fov_deg=181.0),
    ]
    log = open_log(written(tmp_path, *lines))
    scans = [scan for _, scan in log]
    assert [len(scan.ranges_m) for scan in scans] == [181, 180, 181]
    assert np.degrees([scan.angle_min_rad for scan in scans]) == pytest.approx([-90, -89.75, -90], abs=1e-4)
    assert log.remarks[0] == "the number of beams changes (2 times, first in line 2: 180 after 181)"
