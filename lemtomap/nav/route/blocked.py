"""Which edges are closed for now: one state an edge, all of them in one table (T7-2).

    state       begins                                       the planner   ends
    open        at first                                     uses it       a barrier across it is believed
    closed      a barrier is believed, the 1st or 2nd time   avoids it     seen free; time up; retried
    held        the 3rd time or more of late                 avoids it     time up; retried
    ruled out   the window shows a closure that nobody has   avoids it     seen free; time up
                driven to lead through something: a wall

An edge is closed for `block_s`, each time of late `block_growth` times longer, at most for `block_longest_s`:
two ways that open again while the robot is at the other one would send it to and fro for ever. What proved
closed again and again though it had been seen free is not seen free any more: it is held. Of late: within
`block_longest_s`; driven from end to end, an edge begins anew. When a barrier is believed is decided by
`watching.BarrierWatch`.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum

from lemtomap.nav.config import RecoveryConfig
from lemtomap.nav.route.watching import Link
from lemtomap.topo.events import EdgeBlocked

SEEN_FREE_TIMES = 2
"""An edge closed more often than this of late stays so however free it looks."""


class EdgeState(StrEnum):
    """What the planner makes of an edge."""

    OPEN = "open"
    CLOSED = "closed"
    HELD = "held"
    RULED_OUT = "ruled out"


@dataclass(frozen=True, slots=True)
class EdgeBlockage:
    """What is remembered of an edge that was closed."""

    link: Link
    state: EdgeState
    count: int
    """How often it was closed of late."""
    since_s: float
    until_s: float


class BlockedEdges:
    """The states of all edges that were closed of late; they outlive the goal."""

    def __init__(self, config: RecoveryConfig) -> None:
        self._config = config
        self._known: dict[int, EdgeBlockage] = {}

    def state(self, edge_id: int) -> EdgeState:
        """Return the state of an edge; open if nothing is known of it."""
        known = self._known.get(edge_id)
        return EdgeState.OPEN if known is None else known.state

    def closed_until_s(self, now_s: float) -> Mapping[int, float]:
        """Return the edges to be avoided and until when; those whose time is up are open again."""
        for edge_id, known in self._known.items():
            if known.state is not EdgeState.OPEN and known.until_s <= now_s:
                self._known[edge_id] = replace(known, state=EdgeState.OPEN)
        return {e: known.until_s for e, known in self._known.items() if known.state is not EdgeState.OPEN}

    def close(self, links: Iterable[Link], now_s: float) -> list[EdgeBlocked]:
        """Close edges, as one barrier across them all is believed; returns what the map is to be told."""
        longest_s = self._config.block_longest_s
        self._known = {e: known for e, known in self._known.items() if now_s - known.since_s < longest_s}
        return [self._close(link, now_s) for link in {link[0]: link for link in links}.values()]

    def _close(self, link: Link, now_s: float) -> EdgeBlocked:
        known = self._known.get(link[0])
        before = 0 if known is None else known.count
        if before and known is not None and known.state is not EdgeState.OPEN and known.until_s > now_s:
            before -= 1  # one barrier met from several edges closes none of them twice
        config = self._config
        until_s = now_s + min(config.block_s * config.block_growth**before, config.block_longest_s)
        state = EdgeState.CLOSED if before < SEEN_FREE_TIMES else EdgeState.HELD
        self._known[link[0]] = EdgeBlockage(link, state, before + 1, now_s, until_s)
        return EdgeBlocked(link[1], link[2], until_s)

    def rule_out(self, link: Link, now_s: float) -> EdgeBlocked:
        """Close a closure that never was a way; returns what the map is to be told."""
        known, until_s = self._known.get(link[0]), now_s + self._config.block_longest_s
        count = 0 if known is None else known.count
        self._known[link[0]] = EdgeBlockage(link, EdgeState.RULED_OUT, count, now_s, until_s)
        return EdgeBlocked(link[1], link[2], until_s)

    def may_be_seen_free(self) -> set[int]:
        """Return the edges that open again when they are seen free."""
        return {
            edge_id
            for edge_id, known in self._known.items()
            if known.state in {EdgeState.CLOSED, EdgeState.RULED_OUT}
        }

    def worth_a_retry(self, now_s: float) -> list[Link]:
        """Return the edges closed longer ago than `block_s`: a second look is better than to refuse."""
        before_s = now_s - self._config.block_s
        shut = {EdgeState.CLOSED, EdgeState.HELD}
        return [
            known.link for known in self._known.values() if known.state in shut and known.since_s < before_s
        ]

    def open(self, links: Iterable[Link]) -> list[EdgeBlocked]:
        """Open edges; returns what the map is to be told. How often they were closed is remembered."""
        opened = []
        for edge_id, a, b in links:
            self._known[edge_id] = replace(self._known[edge_id], state=EdgeState.OPEN)
            opened.append(EdgeBlocked(a, b, 0.0))
        return opened

    def driven(self, edge_id: int) -> None:
        """Forget how often an edge was closed: it was open all along its length since."""
        if edge_id in self._known:
            self._known[edge_id] = replace(self._known[edge_id], count=0)
