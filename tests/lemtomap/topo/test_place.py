import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lemtomap.errors import BadMap
from lemtomap.topo.place import decode_place, encode_place


def office(turn_rad=0.2, noise_m=0.005, seed=0) -> np.ndarray:
    """Boundary of a room with a door, a corridor end, a pillar and table legs."""
    rng = np.random.default_rng(seed)
    walls = [(-3, -2, 3, -2), (3, -2, 3, 1), (3, 2, 3, 2.5), (3, 2.5, -3, 2.5), (-3, 2.5, -3, -2)]
    walls += [(1, 1, 1.3, 1), (1.3, 1, 1.3, 1.3), (3, 1, 4.8, 1), (3, 2, 4.8, 2)]
    points = [np.linspace((a, b), (c, d), int(np.hypot(c - a, d - b) / 0.02)) for a, b, c, d in walls]
    points.append(np.repeat([[-1, 0], [-1.6, 0], [-1, 0.8], [-1.6, 0.8]], 3, axis=0))
    turn = np.array([[np.cos(turn_rad), -np.sin(turn_rad)], [np.sin(turn_rad), np.cos(turn_rad)]])
    every = np.concatenate(points) @ turn.T
    return every + rng.normal(0, noise_m, every.shape)


@pytest.mark.parametrize("turn_rad", [0.0, 0.2, 0.7853])
def test_a_boundary_comes_back_within_two_centimetres_across_the_walls(turn_rad):
    points = office(turn_rad, noise_m=0.0)
    boundary = decode_place(encode_place(points))
    across = []
    for point, normal, straight in zip(boundary.points, boundary.normals, boundary.straightness, strict=True):
        near = points[np.argsort(np.hypot(*(points - point).T))[:5]]
        if straight > 0.8:
            across.append(abs(np.mean((near - point) @ normal)))
    assert len(across) > 150
    assert np.mean(across) < 0.012
    assert np.percentile(across, 99) < 0.03


def test_an_office_takes_less_than_200_bytes():
    assert len(encode_place(office())) < 200


def test_a_byte_budget_is_kept_by_a_smaller_radius():
    clutter = np.random.default_rng(1).uniform(-5, 5, (3000, 2))
    code = encode_place(clutter, byte_budget=260)
    assert len(code) <= 260
    assert 0.5 < decode_place(code).radius_m < 5.0


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 400), st.integers(0, 2**32 - 1), st.floats(0.5, 6.0))
def test_coding_twice_gives_the_same_bytes_and_loses_nothing_more(count, seed, radius_m):
    points = np.random.default_rng(seed).normal(0, 2, (count, 2))
    code = encode_place(points, radius_m)
    boundary = decode_place(code)
    assert code == encode_place(points, radius_m)
    cells = {tuple(c) for c in np.floor(points[np.abs(points).max(axis=1) < boundary.radius_m - 1e-9] / 0.1)}
    assert len(boundary.points) == len(cells)
    assert np.isfinite(boundary.points).all()


@settings(max_examples=50, deadline=None)
@given(st.binary(max_size=300))
def test_any_bytes_decode_to_something_or_are_refused(data):
    try:
        boundary = decode_place(data)
    except BadMap:
        return
    assert np.isfinite(boundary.points).all()


def test_every_straight_stretch_remembers_from_which_side_it_was_seen():
    points = office(noise_m=0.0)
    eye = np.array([0.3, 0.2])
    whence = eye - points
    whence /= np.hypot(*whence.T)[:, None]
    boundary = decode_place(encode_place(np.c_[points, whence]))
    towards = eye - boundary.points
    facing = np.sum(boundary.fronts * towards, axis=1) / np.hypot(*towards.T)
    known = np.abs(boundary.fronts).max(axis=1) > 0.0
    assert known.mean() > 0.6
    assert (facing[known] > -0.3).all()
    assert not decode_place(encode_place(points)).fronts.any()
    assert len(encode_place(np.c_[points, whence])) < len(encode_place(points)) + 12
