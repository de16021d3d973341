"""What it costs to go and look into an opening, in metres of way: through the window, or along the edges."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lemtomap import se2
from lemtomap.dijkstra import CheapestFirst
from lemtomap.nav.config import ExploreConfig
from lemtomap.nav.kernels import fields as kernels
from lemtomap.nav.motion.metric import Reach, top_cost
from lemtomap.se2 import Pose
from lemtomap.topo.graph import Placeholder
from lemtomap.types import MapView, RouteEdge, RouteGraph


@dataclass(frozen=True, slots=True)
class Here:
    """Where the robot is and what it can reach from there."""

    map_view: MapView
    graph: RouteGraph
    """With the view's newest nodes."""
    reach: Reach
    T_grid_base: Pose
    now_s: float


class Price(NamedTuple):
    """What an opening costs."""

    price_m: float
    direct: bool
    """It can be reached through the window; else its node is to be reached first."""


def price_openings(openings: Sequence[Placeholder], here: Here, config: ExploreConfig) -> dict[int, Price]:
    """Return the price of each opening within reach, by number.

    Of those that only the edges lead to just the nearest is priced, and only when none in the window is near.
    """
    costs = here.reach.costs
    row, col = costs.cell(here.T_grid_base)
    start = np.array([int(row) * costs.state.shape[1] + int(col)], dtype=np.int64)
    field_cells = kernels.march(costs.cost, start, np.zeros(1), -1, 0.0, top_cost(costs))
    prices: dict[int, Price] = {}
    away: list[Placeholder] = []
    for opening in openings:
        price_m = _in_window(opening, here, field_cells, config)
        if price_m is None:
            away.append(opening)
        else:
            prices[opening.placeholder_id] = Price(price_m, direct=True)
    if away and (not prices or min(prices.values()).price_m > config.window_first_m):
        prices |= {number: Price(way_m, direct=False) for number, way_m in _by_route(away, here).items()}
    return prices


def _in_window(
    opening: Placeholder, here: Here, field_cells: NDArray[np.float32], config: ExploreConfig
) -> float | None:
    T_grid_node = here.map_view.T_grid_node.get(opening.node_id)
    if T_grid_node is None:
        return None
    place = se2.transform(T_grid_node, [opening.x_m, opening.y_m])
    costs, T_grid_base = here.reach.costs, here.T_grid_base
    if not costs.holds(place):
        return None
    found = here.reach.nearest(place, config.goal_tolerance_m)
    if found is None:
        return None
    way_m = float(field_cells[found[0], found[1]]) * costs.resolution_m
    dx, dy = place - T_grid_base[:2]
    if np.hypot(dx, dy) <= config.goal_tolerance_m:
        way_m += config.here_price_m
    turn_rad = abs(float(se2.wrap_angle(np.arctan2(dy, dx) - T_grid_base[2])))
    return way_m + config.turn_price_m * turn_rad / np.pi if np.isfinite(way_m) else None


def _by_route(openings: Sequence[Placeholder], here: Here) -> dict[int, float]:
    """Return the price of the opening nearest along open edges; over closed ones only as a last way."""
    wanted: dict[int, list[Placeholder]] = {}
    for opening in openings:
        wanted.setdefault(opening.node_id, []).append(opening)
    for closed_too in (False, True):
        found = _nearest_along_edges(wanted, here, closed_too=closed_too)
        if found:
            return found
    return {}


def _nearest_along_edges(
    wanted: dict[int, list[Placeholder]], here: Here, *, closed_too: bool
) -> dict[int, float]:
    def steps_from(node_id: int) -> Iterator[tuple[int, float, RouteEdge]]:
        for edge in here.graph.edges_of(node_id):
            if closed_too or edge.blocked_until_s <= here.now_s:
                yield edge.other_id, edge.length_m, edge

    for found in CheapestFirst(here.map_view.associated_id, steps_from):
        if found.node_id in wanted:
            there = wanted[found.node_id]
            return {p.placeholder_id: found.cost + float(np.hypot(p.x_m, p.y_m)) for p in there}
    return {}
