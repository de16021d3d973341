import pytest

from tools.bench.slam_parts.sparse import WHEELS, drive


@pytest.mark.parametrize("name", ["glass", "yard"])
def test_where_little_is_in_sight_the_window_spoils_no_good_odometry(name):
    done = drive(name, WHEELS["Kobuki"], 0)
    assert done.window_m <= 1.1 * done.wheels_m
    assert 0.2 < done.matched < 1.0
