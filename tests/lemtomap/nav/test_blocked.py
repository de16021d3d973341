"""The table of an edge's states, row by row."""

import pytest

from lemtomap.nav.config import RecoveryConfig
from lemtomap.nav.route.blocked import BlockedEdges, EdgeState
from lemtomap.topo.events import EdgeBlocked

CONFIG = RecoveryConfig()
LINK = (7, 1, 2)


def closed(times, blocked, now_s=0.0):
    """Close the edge so many times, each when the time of the one before is up; returns now."""
    for time in range(times):
        if time:
            now_s = blocked.closed_until_s(now_s)[7] + 0.1
            assert not blocked.closed_until_s(now_s)
        blocked.close([LINK], now_s)
    return now_s


def test_an_edge_of_which_nothing_is_known_is_open():
    blocked = BlockedEdges(CONFIG)
    assert blocked.state(7) is EdgeState.OPEN
    assert not blocked.closed_until_s(0.0)


def test_a_barrier_closes_each_edge_it_cuts_once_and_tells_the_map_until_when():
    blocked = BlockedEdges(CONFIG)
    told = blocked.close([LINK, (8, 2, 3), LINK], 10.0)
    until_s = 10.0 + CONFIG.block_s
    assert told == [EdgeBlocked(1, 2, until_s), EdgeBlocked(2, 3, until_s)]
    assert blocked.closed_until_s(10.0) == {7: until_s, 8: until_s}
    assert blocked.state(7) is EdgeState.CLOSED


def test_an_edge_opens_when_its_time_is_up():
    blocked = BlockedEdges(CONFIG)
    blocked.close([LINK], 0.0)
    assert 7 in blocked.closed_until_s(CONFIG.block_s - 0.1)
    assert 7 not in blocked.closed_until_s(CONFIG.block_s)
    assert blocked.state(7) is EdgeState.OPEN


def test_an_edge_opens_when_it_is_seen_free_and_the_map_is_told():
    blocked = BlockedEdges(CONFIG)
    blocked.close([LINK], 0.0)
    assert blocked.may_be_seen_free() == {7}
    assert blocked.open([LINK]) == [EdgeBlocked(1, 2, 0.0)]
    assert not blocked.closed_until_s(1.0)
    assert blocked.may_be_seen_free() == set()


def test_each_time_of_late_it_is_closed_longer_but_never_beyond_the_longest():
    blocked, now_s, spans = BlockedEdges(CONFIG), 0.0, []
    for _ in range(8):
        blocked.close([LINK], now_s)
        until_s = blocked.closed_until_s(now_s)[7]
        spans.append(round(until_s - now_s, 6))
        now_s += min(until_s - now_s + 0.1, CONFIG.block_longest_s - 0.1)
        blocked.closed_until_s(now_s)
    assert spans[1] == pytest.approx(CONFIG.block_s * CONFIG.block_growth)
    assert spans == sorted(spans)
    assert spans[-1] == pytest.approx(CONFIG.block_longest_s)


def test_the_third_time_however_free_it_looks_it_is_held():
    blocked = BlockedEdges(CONFIG)
    now_s = closed(2, blocked)
    assert blocked.state(7) is EdgeState.CLOSED
    assert blocked.may_be_seen_free() == {7}
    now_s = blocked.closed_until_s(now_s)[7] + 0.1
    blocked.closed_until_s(now_s)
    blocked.close([LINK], now_s)
    assert blocked.state(7) is EdgeState.HELD
    assert blocked.may_be_seen_free() == set()


def test_found_cut_while_it_is_closed_it_was_not_closed_again():
    blocked = BlockedEdges(CONFIG)
    for now_s in (0.0, 1.0, 2.0, 3.0):
        blocked.close([LINK], now_s)
    assert blocked.state(7) is EdgeState.CLOSED
    assert blocked.closed_until_s(3.0)[7] == pytest.approx(3.0 + CONFIG.block_s)


def test_driven_from_end_to_end_it_begins_anew():
    blocked = BlockedEdges(CONFIG)
    now_s = closed(2, blocked) + 2.0 * CONFIG.block_s * CONFIG.block_growth
    blocked.closed_until_s(now_s)
    blocked.driven(7)
    blocked.driven(8)
    blocked.close([LINK], now_s)
    assert blocked.closed_until_s(now_s)[7] == pytest.approx(now_s + CONFIG.block_s)


def test_what_was_closed_long_ago_counts_no_more():
    blocked = BlockedEdges(CONFIG)
    now_s = closed(2, blocked) + CONFIG.block_longest_s
    blocked.close([LINK], now_s)
    assert blocked.closed_until_s(now_s)[7] == pytest.approx(now_s + CONFIG.block_s)


@pytest.mark.parametrize("times", [1, 3])
def test_closed_and_held_edges_are_worth_a_retry_after_a_while(times):
    blocked = BlockedEdges(CONFIG)
    now_s = closed(times, blocked)
    assert blocked.worth_a_retry(now_s + CONFIG.block_s) == []
    assert blocked.worth_a_retry(now_s + CONFIG.block_s + 0.1) == [LINK]


def test_a_closure_through_a_wall_is_ruled_out_for_long_not_retried_and_open_again_when_seen_free():
    blocked = BlockedEdges(CONFIG)
    assert blocked.rule_out(LINK, 5.0) == EdgeBlocked(1, 2, 5.0 + CONFIG.block_longest_s)
    assert blocked.state(7) is EdgeState.RULED_OUT
    assert blocked.worth_a_retry(5.0 + 2.0 * CONFIG.block_s) == []
    assert blocked.may_be_seen_free() == {7}
    assert not blocked.closed_until_s(5.0 + CONFIG.block_longest_s)
