"""The metric baseline: AMCL keeps the pose, the whole-grid planner leads the same navigator to the goal."""

import numpy as np

from lemtomap import se2
from lemtomap.baseline.localiser import Amcl
from lemtomap.baseline.whole_grid import (
    GRID_ID,
    GridGraph,
    WholeGridLook,
    view_of,
)
from lemtomap.nav.config import NavConfig
from lemtomap.nav.navigator import Navigator
from lemtomap.nav.types import Goal, NavState
from tests.lemtomap.nav.test_navigator import two_rooms


def test_amcl_follows_a_drifting_robot_to_the_goal():
    world = two_rooms()
    grid = world.view().grid
    rng = np.random.default_rng(5)
    start = se2.compose(world.pose, [0.15, -0.1, 0.08])  # not quite where the robot is
    amcl = Amcl(grid, start, seed=1)
    navigator = Navigator(NavConfig(), lambda surroundings: WholeGridLook(surroundings, NavConfig()))
    navigator.set_goal(Goal(GRID_ID, (7.0, 4.8)), world.now_s)
    T_odom_base, errors, output = world.T_odom_base, [], None
    for _ in range(500):
        sighting = world.sighting()
        T_grid_odom = amcl.update(sighting.hits_base, T_odom_base)
        view = view_of(grid, T_grid_odom, amcl.T_grid_base, world.now_s)
        output = navigator.step(
            view, GridGraph(), T_odom_base, world.twist, sighting.hits_base, (), world.now_s
        )
        if navigator.goal is None:
            break
        before = world.pose.copy()
        world.drive(output.twist)
        step = se2.between(before, world.pose)
        noise = rng.standard_normal(3) * np.array([0.05, 0.02, 0.05]) * abs(step[[0, 0, 2]])
        T_odom_base = se2.compose(T_odom_base, step * 1.03 + noise)  # a wheel that is three percent too small
        errors.append(np.hypot(*(amcl.T_grid_base - world.pose)[:2]))
    assert output is not None
    assert output.state == NavState.ARRIVED
    assert np.hypot(*(world.pose[:2] - (7.0, 4.8))) < 0.3
    assert np.quantile(errors[50:], 0.9) < 0.2
    assert world.contacts == 0
    assert len(amcl.particles) < 500
