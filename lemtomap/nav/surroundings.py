"""What navigation believes stands around the robot: the costmap, the sensors' memories, touched hazards."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from lemtomap import se2
from lemtomap.nav.config import NavConfig
from lemtomap.nav.motion.collision import points_now
from lemtomap.nav.motion.costmap import Costmap, Costs, Felt
from lemtomap.nav.types import (
    Contact,
    ContactKind,
    ObstacleSighting,
    Points,
)
from lemtomap.se2 import Pose
from lemtomap.topo.events import Bumped
from lemtomap.topo.graph import Mark
from lemtomap.types import MapView, RouteGraph

SAME_M = 0.05  # a cell: two touches of one spot
ASIDE_M = (-0.25, 0.0, 0.25)
"""A Kobuki's bumper tells one of three directions and nothing of how wide the thing is. What is overlooked
is a bar or a chair's foot: this much to both sides of the touch, and the mark's own radius, covers it."""


@runtime_checkable
class RemembersMarks(Protocol):
    """A graph on file that keeps what was felt rather than seen."""

    def marks(self) -> Sequence[Mark]:
        """Return them all."""
        ...


@dataclass(frozen=True, slots=True)
class Hazard:
    """A place met by touch, kept in a node's frame so that it survives the window."""

    node_id: int
    p_node: tuple[float, float]
    kind: ContactKind
    stamp_s: float
    shut_s: float
    """How long no way leads there: stairs do not move, a chair may."""


class Surroundings:
    """Takes windows, sightings and contacts; gives costmaps and raw points."""

    def __init__(self, config: NavConfig) -> None:
        self._config = config
        self._costmap = Costmap(config.costmap, config.body)
        self._sightings: dict[str, ObstacleSighting] = {}
        self._hazards: list[Hazard] = []
        self._recalled = False

    def forget_window(self) -> None:
        """Forget what was seen in the grid frame, which begins anew; what was touched is kept by node."""
        self._costmap = Costmap(self._config.costmap, self._config.body)
        self._sightings.clear()

    def recall(self, graph: RouteGraph, now_s: float) -> None:
        """Take over, once, what earlier drives felt, if the graph keeps it."""
        if not self._recalled and isinstance(graph, RemembersMarks):
            for mark in graph.marks():
                kind = ContactKind.CLIFF if mark.kind == ContactKind.CLIFF else ContactKind.BUMPER
                shut_s = math.inf if kind is ContactKind.CLIFF else 0.0
                self._keep(Hazard(mark.node_id, (mark.x_m, mark.y_m), kind, now_s, shut_s))
        self._recalled = True

    def take(self, map_view: MapView, sightings: Sequence[ObstacleSighting]) -> None:
        """Take the newest window and what the sensors saw since the last call."""
        self._costmap.follow_window(map_view.grid)
        for sighting in sightings:
            last = self._sightings.get(sighting.source)
            if last is None or sighting.stamp_s > last.stamp_s:
                self._sightings[sighting.source] = sighting
                self._costmap.see(sighting, map_view.T_grid_odom)

    def touch(self, contact: Contact, map_view: MapView, T_grid_base: Pose) -> Bumped:
        """Remember a contact, in the frame of the associated node, and return what the map is told."""
        reach_m = self._config.body.radius_m + self._config.costmap.contact_radius_m
        aside = np.array(ASIDE_M if contact.kind == ContactKind.BUMPER else (0.0,))
        along, across = np.cos(contact.bearing_rad), np.sin(contact.bearing_rad)
        p_base = np.stack([reach_m * along - aside * across, reach_m * across + aside * along], axis=-1)
        T_grid_node = map_view.T_grid_node.get(map_view.associated_id)
        if T_grid_node is not None:
            shut_s = self._shut_s(contact, map_view, se2.transform(T_grid_base, p_base))
            for x, y in se2.transform(se2.between(T_grid_node, T_grid_base), p_base):
                p_node = float(x), float(y)
                self._keep(Hazard(map_view.associated_id, p_node, contact.kind, contact.stamp_s, shut_s))
        x, y = p_base[len(p_base) // 2]
        return Bumped(contact.kind.value, float(x), float(y), contact.stamp_s)

    def _shut_s(self, contact: Contact, map_view: MapView, p_grid: Points) -> float:
        """Return for how long what was felt now at points (N, 2) shuts its place."""
        if contact.kind is ContactKind.CLIFF:
            return math.inf
        config, longest_s = self._config.costmap, 0.0
        for hazard, place in self._placed(map_view):
            again = contact.stamp_s - hazard.stamp_s > config.contact_again_s
            if again and np.hypot(*(p_grid - place).T).min() < config.contact_radius_m:
                longest_s = max(longest_s, hazard.shut_s)
        return min(max(config.contact_hard_s, config.contact_growth * longest_s), config.contact_memory_s)

    def _placed(self, map_view: MapView) -> list[tuple[Hazard, Points]]:
        """Return the hazards in the window and where they are, float64 (2,), metres, grid frame."""
        places = map_view.T_grid_node
        return [
            (hazard, se2.transform(places[hazard.node_id], hazard.p_node))
            for hazard in self._hazards
            if hazard.node_id in places
        ]

    def _keep(self, hazard: Hazard) -> None:
        """Add a hazard, or renew the one it repeats."""
        self._hazards = [
            old
            for old in self._hazards
            if old.node_id != hazard.node_id or np.hypot(*np.subtract(old.p_node, hazard.p_node)) > SAME_M
        ]
        self._hazards.append(hazard)

    def costs(
        self,
        map_view: MapView,
        T_grid_base: Pose,
        now_s: float,
        *,
        tight: bool = False,
        half_m: float | None = None,
    ) -> Costs:
        """Return the costmap of this moment; `tight` without the body's margin.

        half_m: only so far around the robot; None: the whole window.
        """
        memory_s = self._config.costmap.contact_memory_s
        self._hazards = [
            hazard for hazard in self._hazards if now_s - hazard.stamp_s < max(memory_s, hazard.shut_s)
        ]
        placed = self._placed(map_view)
        shut = [place for hazard, place in placed if now_s - hazard.stamp_s < hazard.shut_s]
        dear = [place for hazard, place in placed if hazard.kind is ContactKind.BUMPER]
        felt = Felt(np.array(shut).reshape(-1, 2), np.array(dear).reshape(-1, 2))
        return self._costmap.build(now_s, T_grid_base[:2], felt, tight=tight, half_m=half_m)

    def points(self, T_odom_base: Pose, now_s: float) -> Points:
        """Return the raw range points near the body, present base frame, float64 (N, 2)."""
        collision = self._config.collision
        fresh = [s for s in self._sightings.values() if now_s - s.stamp_s < collision.fresh_s]
        return points_now(fresh, T_odom_base, collision.reach_m)

    def hits_grid(self, T_grid_odom: Pose) -> Points:
        """Return what each sensor hit last, float64 (N, 2), metres, grid frame."""
        parts = [
            se2.transform(se2.compose(T_grid_odom, sighting.T_odom_base), sighting.hits_base)
            for sighting in self._sightings.values()
        ]
        return np.concatenate([np.empty((0, 2)), *parts])

    def hold(self, p_grid: tuple[float, float], until_s: float) -> None:
        """Believe the live obstacles around a closed place until then, or until they are seen to be gone."""
        self._costmap.hold(p_grid, self._config.costmap.hold_m, until_s)

    def forget_live(self) -> None:
        """Drop live obstacles; walls and hazards stay."""
        self._costmap.forget_live()
