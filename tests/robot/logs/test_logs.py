import gc
import gzip
import lzma
import math
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from lemtomap.errors import BadLog
from lemtomap.robot.logs import open_log
from tests.robot.logs.carmen_lines import flaser, odom, rawlaser1, robotlaser1, written

DATA = Path(__file__).resolve().parents[3].parent / "shared" / "data"


def test_stamps_survive_to_the_microsecond(tmp_path):
    stamps = ["976052857.337530", "1031745824.000001", "70.289900"]
    log = open_log(written(tmp_path, *(flaser([1.0] * 180, stamp=s) for s in stamps)))
    assert [f"{scan.stamp_s:.6f}" for _, scan in log] == stamps


def test_a_log_in_memory_is_not_searched_for_garbage_while_it_is_mapped(tmp_path):
    log = open_log(written(tmp_path, flaser([1.0] * 180)))
    assert all(each is not log for each in gc.get_objects())


def test_odometry_is_the_robot_pose_inside_the_laser_line(tmp_path):
    log = open_log(written(tmp_path, "ODOM 9 9 9 0 0 0 1 host 1", flaser([1.0] * 180, x=2.0)))
    ((odometry, scan),) = log
    assert odometry.T_odom_base.tolist() == [2.0, 0.0, 0.0]
    assert scan.T_base_laser.tolist() == [-2.0, 0.0, 0.0]


@pytest.mark.parametrize("code", [81.83, 50.0, 5.6])
def test_the_largest_reading_from_many_directions_means_nothing_seen(tmp_path, code):
    rng = np.random.default_rng(1)
    scans = []
    for _ in range(20):
        ranges = rng.uniform(0.5, 0.9 * code, 180)
        ranges[rng.integers(0, 180, 12)] = code
        scans.append(flaser(ranges))
    for _, scan in open_log(written(tmp_path, *scans)):
        nothing = np.isinf(scan.ranges_m)
        assert 5 < nothing.sum() <= 12
        assert np.nanmax(scan.ranges_m[~nothing]) < 0.95 * code


def test_a_log_without_the_code_loses_no_beam(tmp_path):
    ranges = np.linspace(1.0, 9.0, 180)
    log = open_log(written(tmp_path, *[flaser(ranges)] * 30))
    assert all(np.isfinite(scan.ranges_m).all() for _, scan in log)


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        (flaser([1.0] * 180)[:300], "cut in the middle? FLASER promises 191 fields"),
        (flaser([1.0] * 180) + " " + flaser([1.0] * 180), "FLASER promises 191 fields, the line has 382"),
        (flaser([1.0] * 180, x=math.nan), "'nan' is not a finite number"),
        (flaser([1.0] * 180).replace("1.00", "abc", 1), "'abc' stands where a number belongs"),
        (flaser([1.0] * 180).replace("180", "99999999999", 1), "'99999999999' is out of range"),
        (flaser([1.0] * 180).replace("180", "-3", 1), "'-3' is no number of readings"),
        (flaser([1.0] * 180, x=1e308), "is out of range"),
        (flaser([1.0] * 180, x=1e12), "'1000000000000.000000' is out of range"),
        (flaser([1.0] * 180, stamp="1e12"), "'1e12' is out of range"),
        (flaser([1.0] * 180, stamp="1e308"), "'1e308' is out of range"),
        ("FLASER", "cut in the middle?"),
        (robotlaser1([1.0] * 181)[:200], "cut in the middle? ROBOTLASER1 promises"),
        ("PARAM laser_front_laser_fov wide nohost 0", "'wide' stands where a number belongs"),
    ],
)
def test_a_broken_line_is_skipped_counted_and_told_and_refused_when_no_other_is_left(tmp_path, line, reason):
    good = flaser([1.0] * 180)
    log = open_log(written(tmp_path, good, line, good, line))
    assert len(log) == 2
    (remark,) = (remark for remark in log.remarks if "broken" in remark)
    assert remark.startswith("broken lines are skipped (2 times, first in line 2: ")
    assert reason in remark
    path = written(tmp_path, line)
    with pytest.raises(BadLog) as caught:
        open_log(path)
    assert f"{path}:1: " in str(caught.value)
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_log_cut_at_its_end_is_read_up_to_there_and_told(tmp_path):
    good = flaser([1.0] * 180)
    for cut in ("FLA", "FLASER 180 1.0", "ODOM 0.1 0."):
        log = open_log(written(tmp_path, good, cut, end=""))
        assert len(log) == 1
        assert any(remark.startswith("broken lines are skipped (line 2: ") for remark in log.remarks)
    whole = written(tmp_path, good, "# the end", end="")
    assert open_log(whole).remarks == []


@pytest.mark.parametrize("text", ["nan", "inf", "1e308", "1e12"])
def test_a_range_that_no_laser_measures_is_told_and_counts_as_no_answer(tmp_path, text):
    log = open_log(written(tmp_path, flaser([1.0] * 180), flaser([1.0] * 180).replace("1.00", text, 2)))
    assert log.remarks[0] == "ranges that are no numbers count as no answer (line 2: 2 of them)"
    assert [int(np.isnan(scan.ranges_m).sum()) for _, scan in log] == [0, 2]


def test_remarks_come_one_for_each_kind_with_count_and_first_place(tmp_path):
    stamps = [100.0, 101.0, 102.0, 57.0, 58.0, 56.0]
    lines = [flaser([1.0] * 180, x=2.0 * k, stamp=f"{stamp:.6f}") for k, stamp in enumerate(stamps)]
    assert open_log(written(tmp_path, *lines)).remarks == [
        "the odometry leaps (5 times, first in line 2: by 2.00 m, 0 degrees)",
        "the clock goes back, scans are used in file order (2 times, first in line 4: by 45.000 s)",
        "the stamps are no clock: times and rates are left out",
    ]


@pytest.mark.parametrize(
    ("stamps", "clock"),
    [
        (np.arange(20) * 0.2, True),
        (np.arange(20) * 0.2 - 0.5 * (np.arange(20) % 5 == 4), True),  # a logger mixed some up
        (np.zeros(20), False),
        (np.arange(20, 0, -1) * 0.2, False),
        (np.arange(20) * 0.2 + 1e9 * (np.arange(20) > 9), False),  # set on the way
        (np.arange(200) * 0.2 - 15.0 * (np.arange(200) > 99), False),
        (np.arange(20) * 0.02 + 0.4 * (np.arange(20) % 2), False),  # to and fro
        (np.arange(20) * 1e-3, False),  # 60 m/s
        (np.arange(20) * 200.0, False),  # milliseconds
    ],
)
def test_stamps_that_stand_still_leap_or_race_are_no_clock(tmp_path, stamps, clock):
    lines = [flaser([1.0] * 180, x=0.06 * k, stamp=f"{stamp:.6f}") for k, stamp in enumerate(stamps)]
    log = open_log(written(tmp_path, *lines))
    assert log.has_clock is clock
    assert any("no clock" in remark for remark in log.remarks) is not clock


MOUNTED = (0.22, -0.05, 0.1)


def test_a_laser_line_of_the_newer_kind_brings_range_and_mounting(tmp_path):
    ranges = np.linspace(1.0, 30.0, 181)
    line = robotlaser1(
        ranges, max_range_m=20.0, remissions=[7] * 181, pose=(3.0, 4.0, 2.0), T_base_laser=MOUNTED
    )
    ((odometry, scan),) = open_log(written(tmp_path, line))
    assert odometry.stamp_s == 976052857.33753
    assert odometry.T_odom_base == pytest.approx((3.0, 4.0, 2.0))
    assert scan.T_base_laser == pytest.approx(MOUNTED, abs=1e-5)
    assert np.isinf(scan.ranges_m).tolist() == (ranges >= 20.0).tolist()
    assert scan.range_max_m == pytest.approx(20.0, abs=0.01)


def drive(kind):
    """Return the same small drive as lines of another kind, and where its scans were made."""
    lines = [f"PARAM robot_frontlaser_{n} {v} nohost 0" for n, v in zip(OFFSETS, MOUNTED, strict=True)]
    poses = [(0.1 * k, 0.02 * k, 0.05 * k) for k in range(8)]
    for k, pose in enumerate(poses):
        stamp, ranges = f"{100 + 0.2 * k:.6f}", 1.0 + 0.01 * np.arange(180) + 0.1 * k
        if kind == "FLASER":
            lines.append(flaser(ranges, pose=pose, T_base_laser=MOUNTED, stamp=stamp))
        elif kind == "ROBOTLASER1":
            lines.append(robotlaser1(ranges, pose=pose, T_base_laser=MOUNTED, stamp=stamp))
        else:
            lines += [odom(pose, stamp), rawlaser1(ranges, stamp=stamp)]
    return lines


OFFSETS = ("offset", "side_offset", "angular_offset")


@pytest.mark.parametrize("kind", ["ROBOTLASER1", "RAWLASER1"])
def test_the_same_drive_in_other_messages_is_the_same_drive(tmp_path, kind):
    old = list(open_log(written(tmp_path, *drive("FLASER"), name="old.clf")))
    new = list(open_log(written(tmp_path, *drive(kind), name="new.log")))
    assert len(new) == len(old) == 8
    for (odometry, scan), (old_odometry, old_scan) in zip(new, old, strict=True):
        assert odometry.stamp_s == old_odometry.stamp_s
        assert odometry.T_odom_base == pytest.approx(old_odometry.T_odom_base)
        assert scan.T_base_laser == pytest.approx(old_scan.T_base_laser, abs=1e-5)
        assert scan.ranges_m.tolist() == old_scan.ranges_m.tolist()
        assert scan.angle_min_rad == pytest.approx(old_scan.angle_min_rad, abs=1e-6)
        assert scan.angle_step_rad == pytest.approx(old_scan.angle_step_rad, abs=1e-6)


def test_a_raw_scan_lies_between_the_odometry_before_and_after_it(tmp_path):
    raw = [rawlaser1([1.0] * 180, stamp=stamp) for stamp in ("9.5", "10.25", "13.5")]
    lines = [odom((0.0, 0.0, 0.0), "10.0"), *raw, odom((1.0, 0.0, 0.4), "11.0")]
    log = open_log(written(tmp_path, *lines))
    first, between, last = (odometry.T_odom_base for odometry, _ in log)
    assert first.tolist() == [0.0, 0.0, 0.0]
    assert between == pytest.approx((0.25, 0.0, 0.1))
    assert last.tolist() == [1.0, 0.0, 0.4]
    assert log.remarks[0] == "scans without odometry near them (line 4: 2.5 s off)"


def test_raw_scans_without_odometry_are_refused(tmp_path):
    with pytest.raises(BadLog, match="RAWLASER1 lines without ODOM lines"):
        open_log(written(tmp_path, rawlaser1([1.0] * 180)))


def test_a_scan_that_was_logged_raw_and_with_its_pose_counts_once(tmp_path):
    lines = [odom((0.0, 0.0, 0.0), "1.0"), rawlaser1([1.0] * 180), robotlaser1([1.0] * 180)]
    assert len(open_log(written(tmp_path, *lines))) == 1


def test_lines_of_the_rarer_kind_are_left_out_and_told(tmp_path):
    log = open_log(written(tmp_path, robotlaser1([1.0] * 180), *[flaser([1.0] * 180)] * 3))
    assert len(log) == 3
    assert "ROBOTLASER1 lines are left out (line 1: beside FLASER)" in log.remarks


def test_unusable_files_say_why(tmp_path):
    whole = lzma.compress(flaser([1.0] * 180).encode())
    (tmp_path / "cut.clf.xz").write_bytes(whole[:-40])
    (tmp_path / "junk.clf.gz").write_bytes(b"not packed at all")
    folder = tmp_path / "folder.clf"
    folder.mkdir()
    cases = {
        tmp_path / "absent.clf": "no such file",
        written(tmp_path, "", name="empty.log", end=""): "empty",
        written(tmp_path, "hello", name="foreign.log"): "no FLASER, ROBOTLASER1 or RAWLASER1 line in 1 lines",
        written(tmp_path, "x", name="what.txt"): "unknown kind",
        tmp_path / "cut.clf.xz": "not a whole .xz",
        tmp_path / "junk.clf.gz": "not a whole .gz",
        tmp_path: "unknown kind",
        folder: "is no file",
    }
    for path, reason in cases.items():
        with pytest.raises(BadLog, match=reason):
            open_log(path)


def test_packed_logs_read_the_same(tmp_path):
    text = (flaser([1.0] * 180) + "\n").encode()
    (tmp_path / "a.clf.gz").write_bytes(gzip.compress(text))
    (tmp_path / "a.log.xz").write_bytes(lzma.compress(text))
    assert len(open_log(tmp_path / "a.clf.gz")) == len(open_log(tmp_path / "a.log.xz")) == 1


TURN_TICKS = 2000
TURN_M = 2.0 * math.pi * 0.077


def rover_line(stamp_us, left, right, millimetres):
    """A line of exp1.dat."""
    return " ".join(str(v) for v in [stamp_us, 0, left, right, *[0] * 20, *millimetres, 0])


def lab_line(stamp_us, left, right, millimetres):
    """A line of the narrower kind, whose right wheel counts down on the way ahead."""
    return " ".join(str(v) for v in [stamp_us, 0, left, -right, *[0] * 8, *millimetres])


@pytest.mark.parametrize("line", [rover_line, lab_line])
def test_a_turn_of_the_rovers_wheels_is_their_circumference(tmp_path, line):
    ranges = [6] * 341 + [1000] * 341
    lines = [line(1_000_000, 500, 500, ranges), line(1_100_000, 500 + TURN_TICKS, 500 + TURN_TICKS, ranges)]
    (first, _), (second, scan) = open_log(written(tmp_path, *lines, name="a.dat"))
    assert first.T_odom_base.tolist() == [0.0, 0.0, 0.0]
    assert second.T_odom_base == pytest.approx([TURN_M, 0.0, 0.0])
    assert second.v_mps == pytest.approx(TURN_M / 0.1)
    assert second.stamp_s == pytest.approx(1.1)
    assert np.isnan(scan.ranges_m[:341]).all()  # the laser's error codes
    assert (scan.ranges_m[341:] == 1.0).all()
    assert scan.angle_min_rad == pytest.approx(-scan.angle_step_rad * 681 / 2)


@pytest.mark.parametrize("line", [rover_line, lab_line])
def test_rover_turns_left_when_the_right_wheel_is_faster(tmp_path, line):
    quarter = round(0.5 * math.pi * 0.165 / TURN_M * TURN_TICKS)
    lines = [line(0, 0, 0, [0] * 682), line(1, -quarter, quarter, [0] * 682)]
    *_, (odometry, _) = open_log(written(tmp_path, *lines, name="a.dat"))
    assert odometry.T_odom_base == pytest.approx([0.0, 0.0, 0.5 * math.pi], abs=2e-3)


def test_a_cut_line_of_the_rover_is_skipped_even_where_it_is_as_wide_as_the_narrower_kind(tmp_path):
    whole = [rover_line(100_000 * k, 40 * k, 40 * k, [1000] * 682) for k in range(4)]
    cut = [
        " ".join(whole[1].split()[:700]),
        whole[1].replace("1000", "x", 1),
        whole[1].replace(" 40 ", " 1e12 ", 1),
    ]
    for broken in cut:
        log = open_log(written(tmp_path, whole[0], broken, "", *whole[2:], name="a.dat"))
        assert [round(odometry.T_odom_base[0] / TURN_M * TURN_TICKS) for odometry, _ in log] == [0, 80, 120]
        assert log.remarks[0].startswith("broken lines are skipped (line 2: ")
    with pytest.raises(BadLog, match=":1: cut in the middle"):
        open_log(written(tmp_path, "1 2 3", name="b.dat"))


@pytest.mark.skipif(not DATA.exists(), reason="needs the real logs in ../shared/data")
@pytest.mark.parametrize(
    ("name", "scans", "code_m"),
    [
        ("carmen/intel.clf.xz", 13631, 81.83),
        ("carmen/aces.clf.xz", 7374, 50.0),
        ("carmen/fr-clinic.clf.xz", 6917, 81.91),
        ("urg04lx/exp1.dat.xz", 756, None),
    ],
)
def test_real_logs_are_read_whole(name, scans, code_m):
    log = open_log(DATA / name)
    assert len(log) == scans
    if code_m is not None:
        usable_m = [float(np.max(s.ranges_m[np.isfinite(s.ranges_m)], initial=0.0)) for _, s in log]
        assert max(usable_m) < code_m
        assert any(np.isinf(scan.ranges_m).any() for _, scan in log)


@pytest.mark.skipif(not DATA.exists(), reason="needs the small logs in ../shared/data")
def test_a_scanner_of_270_degrees_sees_the_same_hall_as_one_of_180():
    wide, narrow = (
        open_log(DATA / "cases" / "logs" / f"hall_{name}.clf.xz")
        for name in ("1081_beams_270deg", "361_beams_180deg_good")
    )
    for (_, seen), (_, twin) in islice(zip(wide, narrow, strict=True), 0, None, 20):
        ahead = slice(180, 901, 2)  # the middle 180 degrees, every half degree
        assert float(np.nanmedian(np.abs(seen.ranges_m[ahead] - twin.ranges_m))) < 0.03
