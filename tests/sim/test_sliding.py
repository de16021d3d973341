"""Doors that slide: by a timetable or at random, and never onto the robot."""

import pytest

from lemtomap.sim import worlds
from lemtomap.sim.errors import BadWorld
from lemtomap.sim.simulator import Simulator
from lemtomap.sim.sliding import SlidingDoor

ENDS = ((0.0, 0.0), (1.0, 0.0))
AWAY = (9.0, 9.0, 0.0)
FLAT = """
name = "flat"
spawn = [1.0, 2.5, 0.0]
[[wall]]
points = [[0, 0], [8, 0], [8, 5], [0, 5], [0, 0]]
[[wall]]
points = [[2, 0], [2, 5]]
[[door]]
at = [2.0, 2.5]
rooms = ["a", "b"]
leaf = "slides"
open = [[4, 20]]
"""


def openings(door, robot, until_s, seed=0, step_s=0.1):
    motion = door.begin(seed)
    return [motion.step(k * step_s, step_s, robot)[0] for k in range(round(until_s / step_s))]


def test_a_sliding_door_is_open_during_its_hours_and_takes_time_to_move():
    at = openings(SlidingDoor(ENDS, ((5.0, 10.0),)), AWAY, 14.0)
    assert (at[49], at[75], at[139]) == (0.0, 1.0, 0.0)
    assert 0.0 < at[58] < 1.0


def test_a_sliding_door_opens_again_for_a_robot_in_the_doorway_from_either_side():
    for y in (-0.25, 0.25):
        at = openings(SlidingDoor(ENDS, ((0.0, 5.0),)), (0.5, y, 0.0), 14.0)
        assert at[-1] == 1.0
    assert openings(SlidingDoor(ENDS, ((0.0, 5.0),)), (0.5, 0.5, 0.0), 14.0)[-1] == 0.0


def test_a_door_without_hours_changes_at_random_the_same_way_for_the_same_seed():
    door = SlidingDoor(ENDS, mean_s=10.0)
    runs = [openings(door, AWAY, 100.0, seed) for seed in (1, 1, 2)]
    assert runs[0] == runs[1] != runs[2]
    assert {0.0, 1.0} <= set(runs[0])


def test_the_laser_sees_a_sliding_door_shut_and_then_open(tmp_path):
    path = tmp_path / "flat.toml"
    path.write_text(FLAT)
    simulator = Simulator(worlds.load(path), seed=1)

    def ahead_m():
        beams = simulator.last_scan.ranges_mm[370:399]
        return float(sorted(beams)[len(beams) // 2]) / 1000.0

    simulator.hokuyo.write(b"BM\n")
    simulator.hokuyo.write(b"MD0000076800000\n")
    for k in range(150):
        simulator.advance(0.02 * (k + 1))
    shut = ahead_m()
    for k in range(150, 450):
        simulator.advance(0.02 * (k + 1))
    opened = ahead_m()
    simulator.close()
    assert shut == pytest.approx(1.0, abs=0.2)
    assert opened > 2.0 or opened < 0.02  # a far wall, or no answer


@pytest.mark.parametrize(
    ("leaf", "hours", "says"),
    [
        ("slides", "[[20, 4]]", "from before to"),
        ("slides", "[[4]]", "open"),
        ("swings", "[[4, 20]]", "'open' is for a leaf that slides"),
    ],
)
def test_hours_that_mean_nothing_are_refused_in_one_line(tmp_path, leaf, hours, says):
    path = tmp_path / "flat.toml"
    path.write_text(FLAT.replace('"slides"', f'"{leaf}"').replace("[[4, 20]]", hours))
    with pytest.raises(BadWorld, match=says):
        worlds.load(path)
