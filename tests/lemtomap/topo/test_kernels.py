import numpy as np
import pytest

from lemtomap.se2 import between, compose
from lemtomap.topo.graph import Edge, chain_covariance
from lemtomap.topo.kernels import lines, poses, sight
from lemtomap.types import EdgeType
from tests.lemtomap.topo.drive import room


def spd(rng):
    root = rng.normal(0, 1, (3, 3))
    return root @ root.T


@pytest.mark.parametrize("backwards", [False, True])
def test_carrying_a_pose_along_an_edge_is_the_same_as_by_the_slow_way(backwards):
    rng = np.random.default_rng(4)
    for _ in range(20):
        pose, r, first = rng.normal(0, 2, 3), rng.normal(0, 2, 3), spd(rng)
        edge = Edge(1, 10, 11, r, spd(rng), EdgeType.ODOMETRY)
        start = 11 if backwards else 10
        T, covariance = poses.carried(pose, first, r, edge.covariance, backwards)
        step = edge.seen_from(start)
        np.testing.assert_allclose(between(T, compose(pose, step)), 0.0, atol=1e-12)
        np.testing.assert_allclose(
            covariance, chain_covariance(first, step, edge.covariance_from(start)), rtol=1e-9, atol=1e-12
        )


def test_drift_grows_by_a_step_as_by_the_slow_way():
    rng = np.random.default_rng(5)
    drift, step_covariance = spd(rng), spd(rng)
    before, after = rng.normal(0, 2, 3), rng.normal(0, 2, 3)
    step = between(before, after)
    c, s = np.cos(step[2]), np.sin(step[2])
    turn = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
    np.testing.assert_allclose(
        poses.drifted(drift, before, after, step_covariance),
        chain_covariance(drift, step, turn @ step_covariance @ turn.T),
        rtol=1e-9,
    )


def test_a_line_is_navigable_exactly_where_the_inflated_window_is_free_and_known():
    rng = np.random.default_rng(6)
    occupancy = np.zeros((60, 60), np.int8)
    occupancy[rng.integers(0, 60, 40), rng.integers(0, 60, 40)] = 100
    occupancy[rng.integers(0, 60, 60), rng.integers(0, 60, 60)] = -1
    rows, cols = np.nonzero(occupancy >= 50)
    at = np.arange(60)
    gap_sq = ((at[:, None, None] - rows) ** 2 + (at[None, :, None] - cols) ** 2).min(axis=2)
    open_cells = (gap_sq > (0.18 / 0.05) ** 2) & (occupancy >= 0)
    for _ in range(200):
        x0, y0, x1, y1 = rng.uniform(0.01, 2.99, 4)
        steps = max(1, int(np.ceil(2 * np.hypot(x1 - x0, y1 - y0) / 0.05)))
        share = np.arange(steps + 1) / steps
        c = np.floor((x0 + (x1 - x0) * share) / 0.05).astype(int)
        r = np.floor((y0 + (y1 - y0) * share) / 0.05).astype(int)
        assert sight.line_is_navigable(occupancy, 0.05, x0, y0, x1, y1, 0.18, 50) == open_cells[r, c].all()
        assert sight.line_is_clear(occupancy, 0.05, x0, y0, x1, y1, 50) == (occupancy[r, c] < 50).all()


def test_outside_the_window_nothing_is_navigable_but_sight_is_not_blocked():
    grid = room(4.0)
    assert not sight.line_is_navigable(grid.occupancy, 0.05, 1.0, 1.0, 5.0, 1.0, 0.18, 50)
    assert sight.line_is_clear(grid.occupancy, 0.05, 1.0, 1.0, 5.0, 1.0, 50)


def slow_normals(points, reach_m):
    """Return what line_normals should: the thin axis of each neighbourhood, and how thin it is."""
    out = np.zeros((len(points), 3))
    for k, point in enumerate(points):
        near = points[np.linalg.norm(points - point, axis=1) <= reach_m]
        if len(near) >= 3:
            values, axes = np.linalg.eigh(np.cov(near.T, bias=True))
            out[k] = *axes[:, 0], 1.0 - values[0] / values[1]
    return out


@pytest.mark.parametrize("seed", range(4))
def test_a_wall_s_direction_comes_from_all_hits_in_reach_and_no_others(seed):
    rng = np.random.default_rng(seed)
    along = np.linspace(0.0, 4.0, 60)
    walls = [
        np.stack([along, 0.0 * along], -1),
        np.stack([0.0 * along, along], -1),
        np.stack([along, along], -1),
    ]
    points = np.concatenate([rng.normal(wall - 2.0, 0.02) for wall in walls])
    normals, expected = lines.line_normals(points, 0.25), slow_normals(points, 0.25)
    np.testing.assert_allclose(normals[:, 2], expected[:, 2], atol=1e-9)
    aligned = np.abs(np.sum(normals[:, :2] * expected[:, :2], axis=1))
    thin = expected[:, 2] > 0.1
    np.testing.assert_allclose(aligned[thin], 1.0, atol=1e-9)


def test_no_hits_have_no_directions():
    assert lines.line_normals(np.zeros((0, 2)), 0.25).shape == (0, 3)
