"""What a program gives that cannot be is told in its own words: the argument, and its shape or value."""

import math
import warnings
from dataclasses import replace

import numpy as np
import pytest

import lemtomap
from lemtomap import samples
from lemtomap.nav.types import Contact, ContactKind
from tests.lemtomap.grid.rooms import box, scan_at

WALLS = box(-4.0, -2.0, 4.0, 3.0)
SCAN = lemtomap.Scan(0.0, [1.0, 2.0], 0.0, 0.1)
ODOMETRY = lemtomap.Odometry(0.0, (0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ([[1.0, 2.0]], r"one row of numbers, has shape \(1, 2\)"),
        (np.ones((5, 1)), r"one row of numbers, has shape \(5, 1\)"),
        (1.0, r"one row of numbers, has shape \(\)"),
        ("far", "must be numbers, is 'far'"),
        (["1.0"], r"must be numbers, is \['1.0'\]"),
        ([True, False], r"must be numbers, is \[True, False\]"),
        ([1j], r"must be numbers, is \[1j\]"),
        ([1.0, None], r"must be numbers, is \[1.0, None\]"),
        ([1.0, [2.0]], r"must be numbers, is \[1.0, \[2.0\]\]"),
        ({1: 2}, "must be numbers"),
        (None, "must be numbers, is None"),
        ((each for each in (1.0, 2.0)), "must be numbers, is <generator"),
        (np.array([["a" * 50, None]] * 3, dtype=object), r"must be numbers, is array\(\[\['a+ \.\.\.$"),
        (["x"] * 10_000, r" \.\.\.$"),
    ],
)
def test_ranges_that_are_no_row_of_numbers_are_refused_on_one_short_line(values, told):
    with pytest.raises(lemtomap.BadSample, match="^Scan.ranges_m: .*" + told) as refused:
        lemtomap.Scan(0.0, values, 0.0, 0.1)
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 100


@pytest.mark.parametrize(
    "values", [[1, 2], (1.0, 2.0), np.array([1.0, 2.0]), np.array([1, 2], np.uint8), range(1, 3)]
)
def test_lists_tuples_and_arrays_of_any_number_become_ranges(values):
    ranges = lemtomap.Scan(0.0, values, 0.0, 0.1).ranges_m
    assert ranges.dtype == np.float32
    assert ranges.tolist() == [1.0, 2.0]


def test_a_range_beyond_what_can_be_held_is_nothing_seen_and_no_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert lemtomap.Scan(0.0, [1e40], 0.0, 0.1).ranges_m[0] == math.inf


@pytest.mark.parametrize(
    "name", ["stamp_s", "angle_min_rad", "angle_step_rad", "time_step_s", "range_min_m", "range_max_m"]
)
@pytest.mark.parametrize("value", ["near", None, True, [1.0], math.nan, math.inf, -math.inf])
def test_each_number_of_a_scan_must_be_a_finite_one(name, value):
    with pytest.raises(lemtomap.BadSample, match=rf"^Scan\.{name}: must be a (finite )?number of \w+, is "):
        replace(SCAN, **{name: value})


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"range_max_m": 0.01}, "Scan.range_max_m: must be at least 0.02 metres, is 0.01"),
        ({"range_max_m": -5.0}, "Scan.range_max_m: must be at least 0.02 metres, is -5"),
        ({"range_min_m": -0.1}, "Scan.range_min_m: must be at least 0 metres, is -0.1"),
        ({"time_step_s": -1.0}, "Scan.time_step_s: must be at least 0 seconds, is -1"),
        ({"silent_free_m": math.nan}, "Scan.silent_free_m: must be a finite number"),
        ({"silent_free_m": -math.inf}, "Scan.silent_free_m: must be a finite number"),
        (
            {"T_base_laser": (0.1, 0.0)},
            r"Scan.T_base_laser \(x m, y m, yaw rad\): must be 3 numbers, .*\(2,\)",
        ),
    ],
)
def test_a_scan_that_cannot_be_says_which_of_its_numbers_is_wrong(wrong, told):
    with pytest.raises(lemtomap.BadSample, match=told):
        replace(SCAN, **wrong)


def test_a_scan_may_turn_clockwise_take_no_time_and_trust_its_silence():
    scan = replace(SCAN, angle_step_rad=-0.1, time_step_s=0.0, silent_free_m=math.inf, range_min_m=0.0)
    assert scan.angle_step_rad == -0.1


@pytest.mark.parametrize("name", ["stamp_s", "v_mps", "w_radps"])
@pytest.mark.parametrize("value", ["fast", None, math.nan, math.inf])
def test_each_number_of_an_odometry_must_be_a_finite_one(name, value):
    with pytest.raises(lemtomap.BadSample, match=rf"^Odometry\.{name}: must be a "):
        replace(ODOMETRY, **{name: value})


@pytest.mark.parametrize("number", [1, 1.5, np.float32(1.5), np.float64(1.5), np.int32(1), -2])
def test_numbers_of_numpy_are_numbers(number):
    assert lemtomap.Odometry(number, (0, 0, 0)).stamp_s == number


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ((1.0,), r"Goal.p_node \(x m, y m\): must be 2 numbers, has shape \(1,\)"),
        ("there", "Goal.p_node .* must be numbers, is 'there'"),
        ((math.nan, 0.0), "Goal.p_node: x: must be a finite number of metres, is nan"),
        ((0.0, math.inf), "Goal.p_node: y: must be a finite number of metres, is inf"),
    ],
)
def test_a_goal_that_is_no_point_is_refused(values, told):
    with pytest.raises(lemtomap.BadSample, match=told):
        lemtomap.Goal(1, values)


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"node_id": 1.5}, "Goal.node_id: must be a whole number, is 1.5"),
        ({"node_id": "kitchen"}, "Goal.node_id: must be a whole number, is 'kitchen'"),
        ({"node_id": True}, "Goal.node_id: must be a whole number, is True"),
        ({"node_id": -1}, "Goal.node_id: must be at least 0, is -1"),
        ({"node_id": 1, "yaw_node_rad": math.nan}, "Goal.yaw_node_rad: must be a finite number of radians"),
        ({"node_id": 1, "tolerance_m": -0.1}, "Goal.tolerance_m: must be at least 0 metres, is -0.1"),
    ],
)
def test_a_goal_that_cannot_be_says_why(wrong, told):
    with pytest.raises(lemtomap.BadSample, match=told):
        lemtomap.Goal(**wrong)


def test_a_goal_takes_lists_and_arrays_and_stays_a_value():
    assert {lemtomap.Goal(np.int64(3), [1, 2]), lemtomap.Goal(3, np.array([1.0, 2.0]))} == {
        lemtomap.Goal(3, (1.0, 2.0))
    }


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"path": None}, "Mapper.open: path: must be of kind str or Path, is None"),
        ({"path": b"my.lemto"}, "Mapper.open: path: must be of kind str or Path, is b'my.lemto'"),
        ({"seed": "x"}, "Mapper.open: seed: must be a whole number, is 'x'"),
        ({"seed": -1}, "Mapper.open: seed: must be at least 0, is -1"),
        ({"slam": 5}, "Mapper.open: slam: must be of kind SlamConfig or None, is 5"),
        ({"topo": {}}, "Mapper.open: topo: must be of kind TopoConfig or None, is {}"),
        ({"loops": "no"}, "Mapper.open: loops: must be of kind LoopConfig or None, is 'no'"),
    ],
)
def test_a_mapper_that_cannot_be_opened_says_why_and_leaves_no_file(tmp_path, given, told):
    with pytest.raises(lemtomap.BadSample, match=told):
        lemtomap.Mapper.open(**{"path": tmp_path / "my.lemto", **given})
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def mapper(tmp_path):
    with lemtomap.Mapper.open(tmp_path / "my.lemto") as opened:
        yield opened


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (([1.0, 2.0], ODOMETRY), r"Mapper.update: scan: must be of kind Scan, is \[1.0, 2.0\]"),
        ((ODOMETRY, SCAN), "Mapper.update: scan: must be of kind Scan, is Odometry"),
        ((SCAN, (0.0, 0.0, 0.0)), r"Mapper.update: odometry: must be of kind Odometry, is \(0.0"),
    ],
)
def test_what_is_no_scan_no_odometry_or_no_points_does_not_reach_the_map(mapper, arguments, told):
    with pytest.raises(lemtomap.BadSample, match=told):
        mapper.update(*arguments)
    with pytest.raises(lemtomap.NotStarted):
        mapper.view()


def test_points_that_fit_are_not_copied():
    for dtype in (np.float32, np.float64):
        points = np.ones((3, 2), dtype)
        assert samples.as_points("points", points) is points
    assert samples.as_points("points", []).shape == (0, 2)
    assert samples.as_points("points", [[1, 2]]).dtype == np.float64


def test_a_scan_without_beams_and_one_of_nonsense_distances_map_nothing(mapper):
    for ranges in ([], [1.0], [-1.0] * 90, [math.nan] * 90):
        mapper.update(replace(SCAN, ranges_m=ranges), ODOMETRY)
    assert not (mapper.view().grid.occupancy > 50).any()


@pytest.fixture
def taught(mapper):
    """A mapper that has driven three metres, a navigator on its file, and where the robot is."""
    for step in range(31):
        pose = (0.1 * step - 2.0, 0.0, 0.0)
        mapper.update(scan_at(pose, WALLS, 0.1 * step), lemtomap.Odometry(0.1 * step, pose))
    mapper.topo.store.set_name("window seat", 2)
    mapper.topo.store.commit()
    with lemtomap.Navigator.open(mapper.topo.store.path) as navigator:
        yield mapper, navigator, lemtomap.Odometry(3.0, pose)


@pytest.mark.parametrize("place", [2, np.int64(2), "2", "window seat", lemtomap.Goal(2)])
def test_a_place_is_a_node_by_number_or_name_or_a_goal(taught, place):
    mapper, navigator, here = taught
    navigator.go_to(place)
    output = navigator.drive(mapper.view(), here)
    assert output.goal == lemtomap.Goal(2)
    assert output.state == "turning"
    assert output.twist.w_radps != 0.0


@pytest.mark.parametrize(
    ("place", "error", "told"),
    [
        (99, lemtomap.NoRoute, "my.lemto: there is no node 99"),
        (lemtomap.Goal(99), lemtomap.NoRoute, "my.lemto: there is no node 99"),
        ("window set", lemtomap.NoRoute, "there is no place 'window set' .did you mean 'window seat'?"),
        ("99", lemtomap.NoRoute, "there is no place '99'"),
        (3.5, lemtomap.BadSample, "place: must be a node's number, its name or a Goal, is 3.5"),
        (-1, lemtomap.BadSample, "place: must be a node's number"),
        (True, lemtomap.BadSample, "place: must be a node's number"),
        (None, lemtomap.BadSample, "place: must be a node's number"),
    ],
)
def test_a_place_that_is_not_there_is_refused_and_the_goal_before_stays(taught, place, error, told):
    mapper, navigator, here = taught
    navigator.go_to(1)
    with pytest.raises(error, match=told):
        navigator.go_to(place)
    assert navigator.drive(mapper.view(), here).goal == lemtomap.Goal(1)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"view": None}, "Navigator.drive: view: must be of kind MapView, is None"),
        ({"odometry": (0, 0, 0)}, r"Navigator.drive: odometry: must be of kind Odometry, is \(0, 0, 0\)"),
        ({"odometry": lemtomap.Odometry(0.0, (0.0, math.nan, 0.0))}, "Odometry.T_odom_base: must be finite"),
        ({"seen": [1.0, 2.0, 3.0]}, r"Navigator.drive: seen: must be points \(N, 2\), has shape \(3,\)"),
        ({"seen": "wall"}, "Navigator.drive: seen: must be numbers, is 'wall'"),
        ({"bumps": ["left"]}, "Navigator.drive: bumps: must be of kind Contact, is 'left'"),
    ],
)
def test_a_cycle_with_a_wrong_argument_says_which(taught, change, told):
    mapper, navigator, here = taught
    given = {"view": mapper.view(), "odometry": here, **change}
    with pytest.raises(lemtomap.BadSample, match=told):
        navigator.drive(**given)


SCREEN = [[0.35, y / 20.0] for y in range(-20, 21)]


@pytest.mark.parametrize("kind", ["scan", "list", "array"])
def test_what_is_seen_in_the_way_keeps_the_robot_from_driving_into_it(taught, kind):
    mapper, navigator, here = taught
    navigator.go_to(lemtomap.Goal(3, (2.0, 0.0)))
    ahead, kept = [], []
    for k in range(20):
        now_s = 3.0 + 0.1 * k
        scan = scan_at((1.0, 0.0, 0.0), box(-4.0, -2.0, 1.35, 3.0), now_s)
        seen = {"scan": scan, "list": SCREEN, "array": np.array(SCREEN)}[kind] if k >= 10 else None
        twist = navigator.drive(mapper.view(), replace(here, stamp_s=now_s), seen).twist
        (ahead if seen is None else kept).append(twist.v_mps)
    assert max(ahead) > 0.1
    assert max(kept[5:]) < 0.02


def test_a_bump_drives_the_robot_back_and_goes_into_the_map_with_the_next_scan(taught):
    mapper, navigator, here = taught
    navigator.go_to(lemtomap.Goal(3, (2.0, 0.0)))
    navigator.drive(mapper.view(), here)
    bump = Contact(3.1, ContactKind.BUMPER, 0.0)
    output = navigator.drive(mapper.view(), replace(here, stamp_s=3.1), bumps=[bump])
    assert output.state == "recovering"
    assert output.twist.v_mps <= 0.0
    mapper.update(scan_at((1.0, 0.0, 0.0), WALLS, 3.1), here, events=output.events)
    assert mapper.topo.store.count("mark") == 1


def test_a_navigator_without_a_map_file_says_how_to_get_one():
    navigator = lemtomap.Navigator()
    with pytest.raises(lemtomap.NotStarted, match="make it with"):
        navigator.go_to(1)


@pytest.mark.parametrize("given", [{"path": None}, {"path": "x", "config": {}}])
def test_a_navigator_is_not_opened_with_what_is_no_argument(given):
    with pytest.raises(lemtomap.BadSample, match=r"^Navigator.open: \w+: must be of kind"):
        lemtomap.Navigator.open(**given)


def test_a_navigator_needs_a_map_that_is_there(tmp_path):
    with pytest.raises(lemtomap.BadMap, match=r"none\.lemto"):
        lemtomap.Navigator.open(tmp_path / "none.lemto")


@pytest.mark.parametrize(
    ("beams", "said"),
    [
        ([1.0, 2.0, 3.0], r"must be poses \(N, 3\), has shape \(3,\)"),
        (np.ones((4, 2)), r"must be poses \(N, 3\), has shape \(4, 2\)"),
        ([[0.0, 0.0, math.nan]], "must be finite"),
        ("walls", "must be numbers, is 'walls'"),
    ],
)
def test_the_odometry_of_each_beam_is_a_pose_each(beams, said):
    with pytest.raises(lemtomap.BadSample, match=rf"Odometry\.T_odom_base_beams: {said}"):
        lemtomap.Odometry(0.0, (0.0, 0.0, 0.0), T_odom_base_beams=beams)
