"""What navigation believes stands around the robot: the costmap, the sensors' memories, touched hazards."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from lemtomap import se2
from lemtomap.nav.config import NavConfig
from lemtomap.nav.costmap import Costmap, Costs
from lemtomap.nav.motion.collision import points_now
from lemtomap.nav.types import Contact, ContactKind, Points, Sighting
from lemtomap.se2 import Pose
from lemtomap.topo.events import Bumped
from lemtomap.topo.graph import Mark
from lemtomap.types import MapView, RouteGraph

FRESH_S = 0.6
"""Range points older than this say nothing about what is in front of the body now."""
HOLD_M = 0.9
SAME_M = 0.05
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
    stamp_s: float


class Surroundings:
    """Takes windows, sightings and contacts; gives costmaps and raw points."""

    def __init__(self, config: NavConfig) -> None:
        self._config = config
        self._costmap = Costmap(config.costmap, config.body)
        self._sightings: dict[str, Sighting] = {}
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
                self._keep(Hazard(mark.node_id, (mark.x_m, mark.y_m), now_s))
        self._recalled = True

    def take(self, map_view: MapView, sightings: Sequence[Sighting]) -> None:
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
            for x, y in se2.transform(se2.between(T_grid_node, T_grid_base), p_base):
                self._keep(Hazard(map_view.associated_id, (float(x), float(y)), contact.stamp_s))
        x, y = p_base[len(p_base) // 2]
        return Bumped(contact.kind.value, float(x), float(y), contact.stamp_s)

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
        self._hazards = [hazard for hazard in self._hazards if now_s - hazard.stamp_s < memory_s]
        placed = [
            se2.transform(map_view.T_grid_node[hazard.node_id], hazard.p_node)
            for hazard in self._hazards
            if hazard.node_id in map_view.T_grid_node
        ]
        hazards_grid: Points = np.array(placed).reshape(-1, 2)
        return self._costmap.build(now_s, hazards_grid, T_grid_base[:2], tight=tight, half_m=half_m)

    def points(self, T_odom_base: Pose, now_s: float) -> Points:
        """Return the raw range points near the body, present base frame, float64 (N, 2)."""
        fresh = [s for s in self._sightings.values() if now_s - s.stamp_s < FRESH_S]
        return points_now(fresh, T_odom_base)

    def hits_grid(self, T_grid_odom: Pose) -> Points:
        """Return what each sensor hit last, float64 (N, 2), metres, grid frame."""
        parts = [
            se2.transform(se2.compose(T_grid_odom, sighting.T_odom_base), sighting.hits_base)
            for sighting in self._sightings.values()
        ]
        return np.concatenate([np.empty((0, 2)), *parts])

    def hold(self, p_grid: tuple[float, float], until_s: float) -> None:
        """Believe the live obstacles around a closed place until then, or until they are seen to be gone."""
        self._costmap.hold(p_grid, HOLD_M, until_s)

    def forget_live(self) -> None:
        """Drop live obstacles; walls and hazards stay."""
        self._costmap.forget_live()
