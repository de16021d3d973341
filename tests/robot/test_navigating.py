"""Mapping and navigation between their mailboxes: what one learns the other plans over, file or no file."""

from functools import partial

import numpy as np
import pytest

from lemtomap.grid import SlamConfig, WindowMatcher
from lemtomap.nav.config import NavConfig
from lemtomap.nav.navigator import Navigator
from lemtomap.nav.types import NavState
from lemtomap.pipeline import Mapper
from lemtomap.robot.exchange import Exchange, MissionState, TimedScan
from lemtomap.robot.mapping import MappingStep
from lemtomap.robot.missions.missions import parse_mission
from lemtomap.robot.navigating import NavigationStep
from lemtomap.topo.config import TopoConfig
from lemtomap.topo.file.reader import TopoReader
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.mapper import TopoMapper
from lemtomap.types import Odometry, Twist
from tests.lemtomap.nav.world import Graph, World

NEVER_S = 1e9


class Robot:
    """Mapping and navigation of a robot in a room of 8 m x 4 m, on a map file that is never committed."""

    def __init__(self, path):
        self.exchange = Exchange()
        self.world = World(8.0, 4.0, Graph({}))
        self.world.pose[:] = (1.5, 2.0, 0.0)
        store = TopoStore.create(path, durable=False, commit_every_s=NEVER_S)
        topo = TopoMapper(TopoConfig(), store)
        self.mapping = MappingStep(Mapper(lambda: WindowMatcher(SlamConfig()), topo), self.exchange)
        self.navigation = NavigationStep(
            Navigator(NavConfig()), self.exchange, partial(TopoReader, path, is_checked=True)
        )

    def map_ahead(self, way_m):
        for _ in range(round(way_m / 0.05)):
            self.world.drive(Twist(0.5, 0.0))
            self.map_here()

    def map_here(self):
        odometry = Odometry(self.world.now_s, self.world.T_odom_base.copy())
        scan, sighting = self.world.scan(), self.world.sighting()
        beams = int(np.isfinite(scan.ranges_m).sum())
        self.exchange.odometry.put(odometry)
        self.mapping.step(TimedScan(scan, odometry, sighting, scan.stamp_s, beams))

    def close(self):
        self.navigation.close()
        self.mapping.close()


@pytest.fixture
def robot(tmp_path):
    robot = Robot(tmp_path / "map.lemto")
    yield robot
    robot.close()


def test_navigation_plans_over_nodes_that_were_never_committed(robot, tmp_path):
    robot.map_ahead(4.5)
    view = robot.exchange.map_view.get()
    assert view.associated_id > 3
    robot.navigation.set_mission(parse_mission("goto:1"))
    robot.navigation.step(robot.world.now_s)
    output = robot.exchange.nav_output.get()
    for _ in range(5):
        robot.world.drive(output.twist)
        robot.map_here()
        robot.navigation.step(robot.world.now_s)
        output = robot.exchange.nav_output.get()
    assert robot.exchange.mission.get().state is MissionState.RUNNING
    assert output.state in {NavState.DRIVING, NavState.TURNING}
    assert (output.route[0], output.route[-1]) == (robot.exchange.map_view.get().associated_id, 1)
    with TopoReader(tmp_path / "map.lemto", is_checked=True) as reader:
        assert not reader.has_node(1)
        assert not reader.has_node(view.associated_id)
