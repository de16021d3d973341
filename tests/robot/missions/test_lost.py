"""A robot switched on somewhere in a map it knows, and carried elsewhere: lost, and right again."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from lemtomap.grid import SlamConfig, WindowMatcher
from lemtomap.pipeline import Mapper
from lemtomap.robot.build import build_core
from lemtomap.robot.config import RobotConfig
from lemtomap.robot.exchange import Exchange, MissionState
from lemtomap.robot.mapping import MappingStep
from lemtomap.robot.missions.missions import parse_mission
from lemtomap.robot.motion.safety import Reason
from lemtomap.robot.runs.lockstep import run_lockstep
from lemtomap.se2 import between, compose
from lemtomap.sim import worlds
from lemtomap.sim.route import FloorRoutePlanner
from lemtomap.sim.simulator import Simulator
from lemtomap.sim.tours import ScriptedTour
from lemtomap.topo.config import TopoConfig
from lemtomap.topo.events import Bumped, NothingKnownHere
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.loops import LoopRecogniser
from lemtomap.topo.mapper import TopoMapper
from tools.bench.parts.sim_robot import SimRobot

ROUND = [(2.0, 5.0), (2.9, 2.2), (5.4, 5.0), (5.4, 2.4), (13.5, 5.0), (14.0, 7.5)]


class Mapping:
    """A mapping robot on one map file, judged by truth."""

    def __init__(self, robot, path, born):
        store = (TopoStore.open if path.exists() else TopoStore.create)(path, durable=False)
        topo = TopoMapper(TopoConfig(), store, recogniser=LoopRecogniser())
        self.exchange, self.robot, self.born = Exchange(), robot, born
        self.step = MappingStep(Mapper(lambda: WindowMatcher(SlamConfig()), topo), self.exchange)
        self.told = []

    def take(self, scans, *, until_found=False):
        for seen in scans:
            self.step.step(seen.timed)
            self.seen = seen
            self.told += [note.text for note in self.exchange.notes.drain()]
            view = self.view
            if view is not None:
                for node_id in view.T_grid_node:
                    self.born.setdefault(node_id, compose(seen.T_world_base, self.seen_from_base(node_id)))
            if until_found and not view.lost:
                return True
        return False

    @property
    def view(self):
        return self.exchange.map_view.get()

    def seen_from_base(self, node_id):
        return between(self.view.T_grid_base, self.view.T_grid_node[node_id])

    def off_m(self, node_id):
        off = between(compose(self.seen.T_world_base, self.seen_from_base(node_id)), self.born[node_id])
        return float(np.hypot(off[0], off[1]))


@pytest.fixture(scope="module")
def mapped(tmp_path_factory):
    """The office, mapped once, and where each node truly is."""
    path = tmp_path_factory.mktemp("lost") / "office.lemto"
    world = worlds.load("office")
    robot, born = SimRobot(world, seed=1), {}
    mapping = Mapping(robot, path, born)
    mapping.take(robot.stand(1.0))
    mapping.take(robot.drive(ScriptedTour(FloorRoutePlanner(world.raster).through(ROUND))))
    mapping.step.close()
    robot.close()
    return world, path, born


def test_a_carried_robot_says_so_and_finds_itself_again(mapped):
    world, path, born = mapped
    known = set(born)
    robot = SimRobot(world, seed=2)
    robot.put(np.array([5.4, 3.0, 2.0]))
    mapping = Mapping(robot, path, dict(born))
    mapping.take(robot.stand(1.0))
    assert mapping.view.lost
    assert mapping.view.quality == 0.0
    way = ScriptedTour(FloorRoutePlanner(world.raster).path((5.4, 3.0), (9.0, 5.0)))
    assert mapping.take(robot.drive(way), until_found=True)
    old = set(mapping.view.T_grid_node) & known
    anchored = [node_id for node_id in old if mapping.step.mapper.topo.standing(node_id).anchored]
    assert max(mapping.off_m(node_id) for node_id in anchored) < 0.1

    mapping.take(robot.carry(np.array([13.5, 5.2, -1.0])))
    mapping.take(robot.stand(0.3))
    assert mapping.view.lost
    assert any("lost" in text for text in mapping.told)
    way = ScriptedTour(FloorRoutePlanner(world.raster).path((13.5, 5.2), (10.0, 5.0)))
    assert mapping.take(robot.drive(way), until_found=True)
    assert mapping.off_m(mapping.view.associated_id) < 0.1
    joined = set(mapping.step.mapper.topo.graph.reach(mapping.view.associated_id, 1e9))
    assert len(joined) == mapping.step.mapper.topo.store.count("node")
    mapping.step.close()
    robot.close()


def test_a_robot_pushed_onto_ground_its_window_does_not_know_notices_with_the_first_scan(mapped, tmp_path):
    world, path, born = mapped
    own = tmp_path / "own.lemto"
    shutil.copy(path, own)
    robot = SimRobot(world, seed=2)
    robot.put(np.array([2.9, 2.2, 0.0]))
    mapping = Mapping(robot, own, dict(born))
    mapping.take(robot.stand(1.0))
    mapping.exchange.nav_events.put(NothingKnownHere())  # it maps on: no look-up helps it now
    mapping.take(robot.stand(1.0))
    assert mapping.view.quality > 0.9
    elsewhere = np.array([13.5, 5.0, 0.0])
    robot.put(elsewhere)
    qualities = []
    for seen in robot.stand(0.5):
        mapping.take([seen])
        if np.hypot(*(seen.T_world_base - elsewhere)[:2]) < 0.1:  # not of a scan taken before
            qualities.append(mapping.view.quality)
    assert max(qualities) == 0.0
    assert mapping.view.lost
    assert "nothing of what was in sight a moment ago is there any more" in mapping.told
    mapping.step.close()
    robot.close()


def test_a_part_that_nothing_joins_is_joined_when_the_robot_comes_by(mapped, tmp_path):
    world, path, born = mapped
    own = tmp_path / "own.lemto"
    shutil.copy(path, own)
    with TopoStore.open(own, durable=False) as store:
        west = {node_id for node_id, T_world_node in born.items() if T_world_node[0] < 8.0}
        for edge in list(store.edges()):
            if (edge.source_id in west) != (edge.target_id in west):
                store.delete_edge(edge.edge_id)
    robot = SimRobot(world, seed=2)
    robot.put(np.array([13.0, 5.0, 3.1]))
    mapping = Mapping(robot, own, dict(born))
    mapping.take(robot.stand(1.0))
    mapping.take(robot.drive(ScriptedTour(FloorRoutePlanner(world.raster).path((13.0, 5.0), (3.0, 5.0)))))
    mapper = mapping.step.mapper.topo
    assert not mapping.view.lost
    assert set(born) <= set(mapper.graph.reach(mapping.view.associated_id, 1e9))
    assert mapping.off_m(mapping.view.associated_id) < 0.1
    mapping.step.close()
    robot.close()


def test_a_robot_sent_to_a_place_looks_round_finds_itself_and_goes_there(mapped, tmp_path):
    world, path, born = mapped
    own = tmp_path / "own.lemto"
    shutil.copy(path, own)
    simulator = Simulator(replace(world, spawn=(5.4, 3.0, 2.0)), seed=4)
    core = build_core(RobotConfig(), own, durable=False)
    goal = min(born, key=lambda node_id: float(np.hypot(*(born[node_id][:2] - [7.5, 5.0]))))
    ended = run_lockstep(simulator, core, parse_mission(f"goto:{goal}"), 60.0)
    assert ended.state is MissionState.DONE, ended.text
    assert np.hypot(*(simulator.truth().T_world_base - born[goal])[:2]) < 0.5
    told = [note.text for note in core.exchange.notes.drain()]
    assert told.index("lost: looking for its place in the map") < told.index(f"going to {goal}")
    core.close()
    simulator.close()


def test_a_robot_that_knows_nothing_within_reach_maps_on(mapped, tmp_path):
    _, path, _ = mapped
    own = tmp_path / "own.lemto"
    shutil.copy(path, own)
    robot = SimRobot(worlds.load("home"), seed=3)
    mapping = Mapping(robot, own, {})
    mapping.take(robot.stand(0.5))
    assert mapping.view.lost
    mapping.exchange.nav_events.put(NothingKnownHere())
    mapping.take(robot.stand(0.3))
    assert not mapping.view.lost
    assert "relocalisation failed: starting a separate map component" in mapping.told
    mapping.step.close()
    robot.close()


def test_a_lifted_robot_remembers_no_cliffs(mapped, tmp_path):
    world, _, _ = mapped
    simulator = Simulator(world, seed=4)
    core = build_core(RobotConfig(), tmp_path / "own.lemto", durable=False)
    run_lockstep(simulator, core, parse_mission("idle"), 1.0)
    simulator.base.lifted = True
    run_lockstep(simulator, core, parse_mission("idle"), 1.0)
    assert core.exchange.base_status.get().sent.reason is Reason.WHEEL_DROP
    assert not any(isinstance(event, Bumped) for event in core.exchange.nav_events.drain())
    core.close()
    simulator.close()
