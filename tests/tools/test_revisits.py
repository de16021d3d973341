"""When a drive counts as having come back."""

import numpy as np

from tools.truth.revisits import CLOSED_WITHIN_M, Revisits


def drive(ages_m, known_from_m=np.inf, begun_m=0.0):
    """Look every half metre at ground of these ages."""
    revisits = Revisits()
    for k, age_m in enumerate(ages_m):
        way_m = begun_m + 0.5 * k
        revisits.look(way_m, age_m, known=way_m >= known_from_m)
    return revisits


def test_round_that_joins_old_ground_counts_once_whether_known_or_not():
    new, old = [0.5] * 80, [40.0] * 30
    closed, missed = drive(new + old, known_from_m=42.0), drive(new + old)
    assert (closed.closed, closed.missed, closed.brief) == (1, 0, 0)
    assert closed.closed_after_m == 2.0
    assert (missed.closed, missed.missed, missed.brief) == (0, 1, 0)


def test_known_at_the_first_look_counts_too():
    assert drive([0.5] * 80 + [40.0] * 30, known_from_m=0.0).closed == 1


def test_way_back_through_a_dead_end_is_no_revisit():
    back = list(np.arange(0.5, 90.0, 1.0))
    revisits = drive([0.5] * 90 + back)
    assert (revisits.closed, revisits.missed, revisits.brief) == (0, 0, 0)


def test_crossing_an_old_way_is_neither_closed_nor_missed():
    few = int(CLOSED_WITHIN_M / 0.5) - 4
    revisits = drive([0.5] * 80 + [60.0] * few + [0.5] * 40)
    assert (revisits.closed, revisits.missed, revisits.brief) == (0, 0, 1)


def test_ground_without_nodes_changes_nothing():
    assert drive([0.5] * 80 + [None] * 4 + [40.0] * 30).missed == 1
    assert drive([0.5] * 80 + [None] * 40 + [40.0] * 30).missed == 0
