"""Passes by one place laid over one another."""

import numpy as np
import pytest

from lemtomap.se2 import (
    between,
    compose,
    inverse,
    pose,
    transform,
)
from lemtomap.topo.whole.overlays import Passes
from lemtomap.topo.whole.trail import TrailScan

ROOM = np.concatenate(
    [np.column_stack([np.linspace(-6, 6, 241), np.full(241, y)]) for y in (-3.0, 3.0)]
    + [np.column_stack([np.full(121, x), np.linspace(-3, 3, 121)]) for x in (-6.0, 1.5, 6.0)]
)
SLIP = pose(0.25, 0.15, 0.03)


def twice_along(noise):
    """To and fro through a room: true poses, a track that slipped at the turn, what was seen."""
    there = [pose(x, 0.2, 0.0) for x in np.arange(-4.0, 4.0, 0.25)]
    back = [pose(x, -0.2, np.pi) for x in np.arange(4.0, -4.0, -0.25)]
    truth = np.array(there + back)
    track = np.array(there + [compose(SLIP, each) for each in back])
    looks = [
        TrailScan(k, (transform(inverse(at), ROOM) + noise.normal(0.0, 0.01, ROOM.shape)).astype(np.float32))
        for k, at in enumerate(truth)
    ]
    return truth, track, looks


def test_the_second_pass_is_found_on_the_first_to_the_centimetre():
    truth, track, looks = twice_along(np.random.default_rng(0))
    found = Passes(track, looks, lambda *_: True).overlays(track)
    assert len(found) >= 5
    for overlay in found:
        off = between(between(truth[overlay.earlier], truth[overlay.later]), overlay.T_earlier_later)
        assert np.hypot(off[0], off[1]) < 0.015
        assert abs(off[2]) < 0.004
        assert overlay.later - overlay.earlier > 20


@pytest.mark.parametrize("far_m", [0.0, 1.6])
def test_passes_are_not_overlaid_that_the_map_keeps_apart_or_that_are_too_far_off(far_m):
    _, track, looks = twice_along(np.random.default_rng(0))
    off = np.array(track)
    off[len(off) // 2 :, 1] += far_m
    passes = Passes(track, looks, lambda *_: far_m > 0.0)
    assert passes.overlays(off) == []
