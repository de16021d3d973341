"""What exploration remembers of ground that the window forgot."""

import zlib
from dataclasses import replace

import numpy as np
import pytest

from lemtomap import se2
from lemtomap.nav.explore.aside import FOLLOWED_M, Aside
from lemtomap.nav.explore.memory import SeenMemory
from lemtomap.nav.kernels import fields as kernels
from lemtomap.nav.kernels.explore import remember
from lemtomap.nav.motion.costmap import Costs

RES, CELLS = 0.05, 200
NODES = {k: se2.pose(1.0 + k, 5.0, 0.3 * k) for k in range(5)}


def window(value: int) -> Costs:
    """A window of 10 x 10 m, all free or all unknown."""
    state = np.full((CELLS, CELLS), value, dtype=np.uint8)
    return Costs(0.0, RES, (0.0, 0.0), state, np.full(state.shape, 9.0), np.ones(state.shape))


def moved(nodes, by):
    return {node_id: se2.compose(by, node) for node_id, node in nodes.items()}


def test_knows_ground_again_whose_node_is_beyond_the_view():
    memory = SeenMemory()
    memory.take(window(kernels.FREE), NODES, NODES[0])
    memory.take(window(kernels.UNKNOWN), {k: NODES[k] for k in (2, 3, 4)}, NODES[4])
    memory.take(window(kernels.UNKNOWN), {4: NODES[4]}, NODES[4])
    row, col = (int(v) for v in window(kernels.FREE).cell(NODES[0]))
    assert memory.recall(window(kernels.UNKNOWN))[row, col] == 1


def test_nodes_out_of_view_move_with_those_they_lie_beside():
    aside, by = Aside(), se2.pose(3.0, -1.0, 0.7)
    aside.follow(NODES)
    aside.follow({k: NODES[k] for k in (2, 3, 4)})
    aside.follow(moved({4: NODES[4]}, by))
    expected = moved(NODES, by)
    for node_id, (place, _) in aside.places().items():
        np.testing.assert_allclose(place, expected[node_id], atol=1e-9)
    assert set(aside.places()) == set(NODES)


def test_a_node_in_view_again_is_where_the_view_has_it():
    aside = Aside()
    aside.follow(NODES)
    aside.follow({4: NODES[4]})
    again = {4: NODES[4], 0: se2.pose(9.0, 9.0, 0.0)}
    aside.follow(again)
    np.testing.assert_allclose(aside.places()[0][0], again[0])
    aside.follow({4: NODES[4]})
    np.testing.assert_allclose(aside.places()[0][0], again[0], atol=1e-9)


def test_no_chain_is_followed_too_far_nor_into_another_part_of_the_map():
    aside = Aside()
    for k in range(round(FOLLOWED_M) + 10):
        aside.follow({k: se2.pose(float(k), 0.0, 0.0), k + 1: se2.pose(k + 1.0, 0.0, 0.0)})
    newest = max(aside.places())
    assert min(aside.places()) == newest - 1 - round(FOLLOWED_M)
    aside.follow({900: se2.pose(0.0, 0.0, 0.0)})
    assert set(aside.places()) == {900}


def test_only_the_nodes_that_left_the_view_last_are_followed():
    aside = Aside(kept=6)
    for k in range(30):
        aside.follow({k: se2.pose(float(k), 0.0, 0.0), k + 1: se2.pose(k + 1.0, 0.0, 0.0)})
        assert len(aside) <= 6
    assert set(aside.places()) == set(range(23, 31))


def test_ground_at_the_end_of_a_long_chain_is_known_only_where_its_error_leaves_no_doubt():
    """Else the floor on one side of a thin wall would be taken for that on the other."""
    state = np.full((CELLS, CELLS), kernels.FREE, dtype=np.uint8)
    state[: round(4.0 / RES)] = kernels.UNKNOWN
    half = replace(window(kernels.FREE), state=state)
    memory, dark = SeenMemory(), window(kernels.UNKNOWN)
    memory.take(half, {1: NODES[0], 2: NODES[1]}, NODES[0])
    in_view = memory.recall(dark)
    memory.take(dark, {2: NODES[1]}, se2.pose(90.0, 0.0, 0.0))
    aside = memory.recall(dark)
    assert 0 < aside.sum() < in_view.sum()
    assert np.flatnonzero(in_view.any(axis=1))[0] * RES <= 4.0
    only = SeenMemory()
    only.take(half, {1: NODES[0], 2: NODES[1]}, NODES[0])
    only._pictures[2] = None
    only.take(dark, {2: NODES[1]}, se2.pose(90.0, 0.0, 0.0))
    assert np.flatnonzero(only.recall(dark).any(axis=1))[0] * RES > 4.1


@pytest.mark.parametrize(("row", "col"), [(20, 20), (21, 20), (18, 20), (20, 21), (20, 18)])
def test_ground_counts_as_seen_only_where_its_middle_and_all_four_sides_are_known(row, col):
    state = np.full((40, 40), kernels.FREE, dtype=np.uint8)
    state[row, col] = kernels.UNKNOWN
    seen = np.zeros((1, 1), dtype=np.uint8)
    remember(state, 20.0, 20.0, 0.0, 4.0, seen)
    assert seen[0, 0] == 0
    state[row, col] = kernels.FREE
    remember(state, 20.0, 20.0, 0.0, 4.0, seen)
    assert seen[0, 0] == 1


class File:
    """A map that holds one picture, whatever is asked for."""

    def __init__(self, picture):
        self._picture = picture

    def ground_seen(self, node_id):  # noqa: ARG002
        return self._picture


@pytest.mark.parametrize(
    "picture",
    [b"", b"picture", zlib.compress(bytes(287)), zlib.compress(b"\xff" * 289), zlib.compress(bytes(10**8))],
    ids=["empty", "foreign", "short", "long", "bomb"],
)
def test_a_picture_that_is_none_tells_nothing_of_the_ground(picture):
    dark = window(kernels.UNKNOWN)

    def seen(picture):
        memory = SeenMemory()
        memory.take(dark, {1: NODES[0]}, se2.pose(90.0, 0.0, 0.0))
        return memory.recall(dark, File(picture)).sum()

    assert seen(picture) == 0 < seen(zlib.compress(b"\xff" * 288))
