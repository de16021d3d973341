import gc
import gzip
import lzma
import math
from pathlib import Path

import numpy as np
import pytest

from lemtomap.errors import BadLog
from lemtomap.robot.logs import open_log

DATA = Path(__file__).resolve().parents[3].parent / "shared" / "data"
TAIL = "0.0 0.0 0.0 {x} 0.0 0.0 {stamp} host 0.1"


def flaser(ranges, x=0.0, stamp="976052857.337530"):
    return (
        f"FLASER {len(ranges)} " + " ".join(f"{r:.2f}" for r in ranges) + " " + TAIL.format(x=x, stamp=stamp)
    )


def written(tmp_path, *lines, name="a.clf", end="\n"):
    path = tmp_path / name
    path.write_text("\n".join(lines) + end)
    return path


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


def test_beams_cover_half_a_turn_in_equal_steps(tmp_path):
    log = open_log(written(tmp_path, flaser([1.0] * 180), flaser([1.0] * 361)))
    (_, even), (_, odd) = log
    assert even.angle_step_rad == pytest.approx(math.radians(1.0))
    assert odd.angle_step_rad == pytest.approx(math.radians(0.5))
    assert even.angle_min_rad == odd.angle_min_rad == pytest.approx(-math.pi / 2)


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
        (flaser([1.0] * 180)[:300], "line 2: cut"),
        (
            " ".join([*flaser([1.0] * 180).split()[:-6], "nan", *flaser([1.0] * 180).split()[-5:]]),
            "line 2: 'nan' is not",
        ),
        (flaser([1.0] * 180).replace("1.00", "abc", 1), "line 2: 'abc' stands where a number"),
        ("FLASER", "line 2: cut"),
    ],
)
def test_a_broken_line_is_left_out_and_told_with_its_number(tmp_path, line, reason):
    log = open_log(written(tmp_path, flaser([1.0] * 180), line, flaser([1.0] * 180, stamp="976052858.0")))
    assert len(log) == 2
    (told,) = (remark for remark in log.remarks if "broken" in remark)
    assert reason in told
    assert "\n" not in told


def test_a_range_that_is_no_number_is_told_and_counts_as_no_answer(tmp_path):
    later = flaser([1.0] * 180, stamp="976052857.5").replace("1.00", "nan", 2)
    log = open_log(written(tmp_path, flaser([1.0] * 180), later))
    assert log.remarks == ["ranges that are no numbers count as no answer (line 2: 2 of them)"]
    assert [int(np.isnan(scan.ranges_m).sum()) for _, scan in log] == [0, 2]


def test_unusable_files_say_why(tmp_path):
    whole = lzma.compress(flaser([1.0] * 180).encode())
    (tmp_path / "cut.clf.xz").write_bytes(whole[:-40])
    (tmp_path / "junk.clf.gz").write_bytes(b"not packed at all")
    cases = {
        tmp_path / "absent.clf": "no such file",
        written(tmp_path, "", name="empty.log", end=""): "empty",
        written(tmp_path, "hello", name="foreign.log"): "no FLASER",
        written(tmp_path, "x", name="what.txt"): "unknown kind",
        tmp_path / "cut.clf.xz": "not a whole .xz",
        tmp_path / "junk.clf.gz": "not a whole .gz",
        tmp_path: "unknown kind",
    }
    for path, reason in cases.items():
        with pytest.raises(BadLog, match=reason):
            open_log(path)


def test_packed_logs_read_the_same(tmp_path):
    text = (flaser([1.0] * 180) + "\n").encode()
    (tmp_path / "a.clf.gz").write_bytes(gzip.compress(text))
    (tmp_path / "a.log.xz").write_bytes(lzma.compress(text))
    assert len(open_log(tmp_path / "a.clf.gz")) == len(open_log(tmp_path / "a.log.xz")) == 1


def rover_line(stamp_us, left, right, millimetres):
    return " ".join(str(v) for v in [stamp_us, 0, left, right, *[0] * 20, *millimetres, 0])


def test_rover_ticks_become_odometry_and_error_codes_become_nan(tmp_path):
    ranges = [6] * 341 + [1000] * 341
    lines = [rover_line(1_000_000, 500, 500, ranges), rover_line(1_100_000, 2500, 2500, ranges)]
    (first, _), (second, scan) = open_log(written(tmp_path, *lines, name="a.dat"))
    assert first.T_odom_base.tolist() == [0.0, 0.0, 0.0]
    assert second.T_odom_base[0] == pytest.approx(2 * 0.077 * math.pi)
    assert second.stamp_s == pytest.approx(1.1)
    assert np.isnan(scan.ranges_m[:341]).all()
    assert (scan.ranges_m[341:] == 1.0).all()
    assert scan.angle_min_rad == pytest.approx(-scan.angle_step_rad * 681 / 2)


def test_rover_turns_left_when_the_right_wheel_is_faster(tmp_path):
    quarter = 0.5 * math.pi * 0.165 / (2 * 0.077 * math.pi / 2000.0)
    lines = [rover_line(0, 0, 0, [0] * 682), rover_line(1, round(-quarter), round(quarter), [0] * 682)]
    *_, (odometry, _) = open_log(written(tmp_path, *lines, name="a.dat"))
    assert odometry.T_odom_base == pytest.approx([0.0, 0.0, 0.5 * math.pi], abs=1e-3)


@pytest.mark.skipif(not DATA.exists(), reason="needs the real logs in ../shared/data")
@pytest.mark.parametrize(
    ("name", "scans", "code_m"),
    [
        ("carmen/intel.clf.xz", 13631, 81.83),
        ("carmen/aces.clf.xz", 7374, 50.0),
        ("urg04lx/exp1.dat.xz", 756, None),
    ],
)
def test_real_logs_are_read_whole(name, scans, code_m):
    log = open_log(DATA / name)
    assert len(log) == scans
    if code_m is not None:
        assert code_m - 0.1 < log.no_return_m <= code_m
