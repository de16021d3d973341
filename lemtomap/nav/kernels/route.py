"""Jitted shortest ways over a compact graph, for maps of a million nodes; over smaller ones see dijkstra.

Arc 2e leads from an edge's source to its target, arc 2e + 1 back; a node's arcs form a chain:
first_arc[node], then next_arc[arc], until -1. Price is per edge, inf where closed.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]
I4 = NDArray[np.int32]


@njit(nogil=True, cache=True)
def chain_arcs(sources: I4, targets: I4, edge_ids: I4, first_arc: I4, next_arc: I4, arc_to: I4) -> None:
    """Add edges to the chains of their two ends."""
    for i in range(edge_ids.size):
        arc = 2 * edge_ids[i]
        arc_to[arc], arc_to[arc + 1] = targets[i], sources[i]
        next_arc[arc], first_arc[sources[i]] = first_arc[sources[i]], arc
        next_arc[arc + 1], first_arc[targets[i]] = first_arc[targets[i]], arc + 1


@njit(nogil=True, cache=True)
def way_to_goal(
    first_arc: I4,
    next_arc: I4,
    arc_to: I4,
    price: F4,
    goal: int,
    start: int,
    width: float,
    to_go: F4,
    via: I4,
) -> float:
    """Write for each node the price of its best way to the goal and the first arc of it; stop at start.

    Nodes wait in a ring of buckets `width` wide (Dial, 1969) and are corrected when a better way shows up.
    to_go comes filled with inf. Returns the price up to which all values are final.
    """
    top = np.float32(0.0)
    for e in range(price.size):
        if np.isfinite(price[e]) and price[e] > top:
            top = price[e]
    slots = int(top / width) + 2
    head = np.full(slots, -1, dtype=np.int32)
    capacity = 1024
    entry_node = np.empty(capacity, dtype=np.int32)
    entry_next = np.empty(capacity, dtype=np.int32)
    free = -1
    used = 1
    entry_node[0], entry_next[0] = goal, -1
    head[0] = 0
    to_go[goal] = 0.0
    via[goal] = -1
    waiting, level = 1, 0
    while waiting > 0:
        slot = level % slots
        if head[slot] < 0:
            if to_go[start] <= level * width:
                break
            level += 1
            continue
        entry = head[slot]
        head[slot] = entry_next[entry]
        node = entry_node[entry]
        entry_next[entry] = free
        free = entry
        waiting -= 1
        here = to_go[node]
        if int(here / width) < level:
            continue  # corrected meanwhile
        arc = first_arc[node]
        while arc >= 0:
            other = arc_to[arc]
            value = here + price[arc >> 1]
            if value < to_go[other]:
                to_go[other] = value
                via[other] = arc ^ 1
                if free >= 0:
                    entry = free
                    free = entry_next[entry]
                else:
                    if used == capacity:
                        more_node = np.empty(2 * capacity, dtype=np.int32)
                        more_next = np.empty(2 * capacity, dtype=np.int32)
                        more_node[:capacity] = entry_node
                        more_next[:capacity] = entry_next
                        entry_node, entry_next = more_node, more_next
                        capacity *= 2
                    entry = used
                    used += 1
                entry_node[entry] = other
                s = int(value / width) % slots
                entry_next[entry] = head[s]
                head[s] = entry
                waiting += 1
            arc = next_arc[arc]
    return level * width


@njit(nogil=True, cache=True)
def _push(keys: F8, nodes: I4, size: int, key: float, node: int) -> None:
    i = size
    while i > 0:
        p = (i - 1) >> 1
        if keys[p] <= key:
            break
        keys[i], nodes[i] = keys[p], nodes[p]
        i = p
    keys[i], nodes[i] = key, node


@njit(nogil=True, cache=True)
def _pop(keys: F8, nodes: I4, size: int) -> None:
    """Drop the least; size is the number of entries before."""
    key, node = keys[size - 1], nodes[size - 1]
    i = 0
    while True:
        k = 2 * i + 1
        if k >= size - 1:
            break
        if k + 1 < size - 1 and keys[k + 1] < keys[k]:
            k += 1
        if keys[k] >= key:
            break
        keys[i], nodes[i] = keys[k], nodes[k]
        i = k
    keys[i], nodes[i] = key, node


@njit(nogil=True, cache=True)
def guided_way(
    first_arc: I4, next_arc: I4, arc_to: I4, price: F4, start: int, goal: int, to_go: F4, beyond: float,
    reached: F4, came: I4, touched: I4,
) -> int:  # fmt: skip
    """Find the way from start to goal by A*, led by an older way_to_goal since which no price has fallen.

    beyond: what is known of nodes that were not reached then. reached comes filled with inf; the nodes
    written to are listed in touched. Returns how many were touched, negative if there is no way.
    """
    capacity = 1024
    keys = np.empty(capacity, dtype=np.float64)
    nodes = np.empty(capacity, dtype=np.int32)
    reached[start] = 0.0
    came[start] = -1
    touched[0] = start
    count = 1
    _push(keys, nodes, 0, 0.0, start)
    size = 1
    while size > 0:
        key, node = keys[0], nodes[0]
        _pop(keys, nodes, size)
        size -= 1
        if node == goal:
            return count
        guess = min(to_go[node], beyond)
        if key > reached[node] + guess + 1e-3:
            continue
        arc = first_arc[node]
        while arc >= 0:
            other = arc_to[arc]
            value = reached[node] + price[arc >> 1]
            if value < reached[other] - 1e-4:
                if np.isinf(reached[other]):
                    touched[count] = other
                    count += 1
                reached[other] = value
                came[other] = arc
                if size == capacity:
                    more_keys = np.empty(2 * capacity, dtype=np.float64)
                    more_nodes = np.empty(2 * capacity, dtype=np.int32)
                    more_keys[:capacity] = keys
                    more_nodes[:capacity] = nodes
                    keys, nodes = more_keys, more_nodes
                    capacity *= 2
                _push(keys, nodes, size, value + min(to_go[other], beyond), other)
                size += 1
            arc = next_arc[arc]
    return -count
