"""Driving back over mapped places with a window that forgot them and an odometry that drifted meanwhile."""

from dataclasses import replace

import numpy as np
import pytest

from lemtomap.se2 import (
    IDENTITY,
    between,
    compose,
    inverse,
    pose,
    transform,
)
from lemtomap.topo.config import TopoConfig
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.mapper import TopoMapper
from lemtomap.types import GridView
from tests.lemtomap.topo.drive import along, said

FAR_M = 28.0
STEP = np.diag([2e-4, 2e-4, 2e-5])


def corridor_walls(seed=1):
    """A corridor with niches at irregular places, as points every 2 cm, world frame."""
    rng = np.random.default_rng(seed)
    points = []
    for side in (-1.0, 1.0):
        x = -6.0
        while x < FAR_M + 8.0:
            length, depth = rng.uniform(0.8, 3.0), rng.uniform(0.0, 0.8)
            y = side * (1.0 + depth)
            points.append(
                np.c_[np.arange(x, x + length, 0.02), np.full(len(np.arange(x, x + length, 0.02)), y)]
            )
            ends = np.arange(1.0, 1.8, 0.02)
            points += [np.c_[np.full_like(ends, x + length), side * ends]]
            x += length
    return np.concatenate(points)


class World:
    """The truth, and what a window SLAM with a drifted frame shows of it."""

    def __init__(self):
        self.walls = corridor_walls()
        self.T_grid_world = IDENTITY
        self.rng = np.random.default_rng(0)

    def see(self, T_world_base):
        near = self.walls[np.hypot(*(self.walls - T_world_base[:2]).T) < 5.0]
        points = transform(inverse(T_world_base), near[::3])
        return points + self.rng.normal(0, 0.01, points.shape)

    def window(self, T_world_base):
        """Free where the robot has been within 5 m, walls where they are, nothing known elsewhere."""
        x, y = np.round(compose(self.T_grid_world, T_world_base)[:2]) - 10.0
        occupancy = np.full((400, 400), -1, np.int8)
        at = np.stack(np.meshgrid(np.arange(400), np.arange(400)), axis=-1) * 0.05 + [x + 0.025, y + 0.025]
        world = transform(inverse(self.T_grid_world), at)
        occupancy[(np.abs(world[..., 0] - T_world_base[0]) < 8.0) & (np.abs(world[..., 1]) < 1.9)] = 0
        cells = np.floor((transform(self.T_grid_world, self.walls) - [x, y]) / 0.05).astype(int)
        inside = ((cells >= 0) & (cells < 400)).all(axis=1)
        occupancy[cells[inside, 1], cells[inside, 0]] = 100
        return GridView(0.0, occupancy, 0.05, (float(x), float(y)))


def drive(mapper, world, corners, stamp, visit=None):
    grid = None
    for k, (now, at) in enumerate(along(corners, 0.1, stamp)):
        if grid is None or k % 5 == 0:
            grid = world.window(at)
        slam = said(now, compose(world.T_grid_world, at), step_covariance=STEP)
        mapper.update(slam, grid, world.see(at))
        if visit is not None:
            visit(at)
    return now + 0.2


@pytest.fixture(scope="module")
def revisit(tmp_path_factory):
    """Errors of T_grid_node and the associated nodes on the way back, the frame having drifted by 20 cm."""
    world = World()
    mapper = TopoMapper(TopoConfig(), TopoStore.create(tmp_path_factory.mktemp("map") / "map.lemto"))
    stamp = drive(mapper, world, [(0, 0), (FAR_M, 0)], 0.0)
    # 5 scans a second, 0.1 m apart: the place of a node follows from when it was made
    truth = {node.node_id: pose(0.5 * node.created_s, 0, 0) for node in mapper.store.nodes()}
    world.T_grid_world = pose(0.2, -0.1, 0.03)
    for (
        node_id,
        standing,
    ) in list(mapper.local.standings.items()):  # it drifted little by little: all near came along
        moved = compose(world.T_grid_world, truth[node_id])
        mapper.local._put(node_id, replace(standing, T_grid_node=moved))
    errors, right, measured = [], [], []

    def visit(at):
        node_id = mapper.associated_id
        standing = mapper.local.standings[node_id]
        errors.append(between(compose(world.T_grid_world, truth[node_id]), standing.T_grid_node))
        nearest = min(abs(T[0] - at[0]) for T in truth.values())
        right.append(abs(truth[node_id][0] - at[0]) <= nearest + 0.3)
        measured.append(mapper.transform.measured)

    drive(mapper, world, [(FAR_M, 0), (0.5, 0)], stamp, visit)
    yield np.array(errors), np.array(right), np.array(measured), mapper, truth
    mapper.close()


def test_known_places_are_found_again_in_the_window_within_five_centimetres(revisit):
    errors, _, measured, _, _ = revisit
    assert measured.mean() > 0.95
    assert np.median(np.hypot(errors[:, 0], errors[:, 1])) < 0.03
    assert np.percentile(np.hypot(errors[:, 0], errors[:, 1]), 99) < 0.10
    assert np.rad2deg(np.percentile(np.abs(errors[:, 2]), 99)) < 2.0


def test_the_associated_node_is_the_nearest_and_no_node_is_made_twice(revisit):
    _, right, _, mapper, truth = revisit
    assert right.mean() >= 0.99
    assert mapper.store.count("node") == len(truth)


def test_localisation_data_takes_less_than_300_bytes_a_node(revisit):
    mapper = revisit[3]
    sizes = [len(place.boundary) for _, place in mapper.store.places()]
    assert len(sizes) > 20
    assert np.mean(sizes) < 240
