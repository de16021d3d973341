"""The cheapest ways over a graph from one of its nodes, nearest first (Dijkstra, 1959).

Whoever searches a graph node by node searches with this: routes, openings, missions, the doubt of closures,
the thinning of a map. Two searches stand apart, each for its speed: PagedGraph.reach, which every scan asks
for, and nav/kernels/route over flat arrays, for maps of a million nodes.
"""

import heapq
import math
from collections.abc import Callable, Iterable, Iterator
from typing import Generic, NamedTuple, TypeVar

E = TypeVar("E")


class Settled(NamedTuple, Generic[E]):
    """A node to which the cheapest way is known."""

    node_id: int
    cost: float
    """Of the way from the start."""
    before_id: int
    """The node before it on that way; 0 at the start."""
    step: E | None
    """The edge from there; None at the start."""


class CheapestFirst(Generic[E]):
    """One search, as far as it is asked for: iterate for the next node, stop whenever enough is known.

    Holds: costs never fall from one node to the next; of ways that cost the same, the one found first counts.
    """

    def __init__(
        self,
        start_id: int,
        steps_from: Callable[[int], Iterable[tuple[int, float, E]]],
        most: float = math.inf,
    ) -> None:
        """Begin at a node. `steps_from`: what leads on from a node, as (other node, cost >= 0, edge).

        Nodes that cost more than `most` are left out.
        """
        self._steps_from = steps_from
        self._most = most
        self._best = {start_id: 0.0}
        self._settled: set[int] = set()
        self._waiting: list[tuple[float, int, Settled[E]]] = [(0.0, 0, Settled(start_id, 0.0, 0, None))]
        self._found = 0

    @property
    def is_over(self) -> bool:
        """Whether nothing waits any more."""
        return not self._waiting

    def __iter__(self) -> Iterator[Settled[E]]:
        return self

    def __next__(self) -> Settled[E]:
        while self._waiting:
            _, _, nearest = heapq.heappop(self._waiting)
            if nearest.node_id not in self._settled:
                self.settle(nearest.node_id, nearest.cost)
                return nearest
        raise StopIteration

    def settle(self, node_id: int, cost: float) -> None:
        """Take a node for reached at this cost and look on from it: one that joined the graph meanwhile."""
        self._settled.add(node_id)
        for other_id, price, step in self._steps_from(node_id):
            total = cost + price
            is_better = total < self._best.get(other_id, math.inf)
            if is_better and total <= self._most and other_id not in self._settled:
                self._best[other_id] = total
                self._found += 1
                heapq.heappush(self._waiting, (total, self._found, Settled(other_id, total, node_id, step)))


def way_back(settled: dict[int, Settled[E]], node_id: int) -> tuple[tuple[int, ...], tuple[E, ...]]:
    """Return the nodes from the start of a search to a node it settled, and the edges between them."""
    nodes, steps = [node_id], []
    while (step := settled[node_id].step) is not None:
        steps.append(step)
        node_id = settled[node_id].before_id
        nodes.append(node_id)
    return tuple(reversed(nodes)), tuple(reversed(steps))
