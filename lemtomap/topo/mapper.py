"""Topological SLAM, one scan at a time (thesis, Figure 3-6): associate, or be born and join."""

from dataclasses import replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from lemtomap.se2 import Pose, between, compose
from lemtomap.topo.config import TopoConfig
from lemtomap.topo.doubt import COVARIANCE_FLOOR, NOWHERE
from lemtomap.topo.events import NavEvent, NothingKnownHere
from lemtomap.topo.file.paging import PagedGraph
from lemtomap.topo.file.store import TopoStore
from lemtomap.topo.graph import (
    Covariance,
    Edge,
    chain_covariance,
    reversed_covariance,
    straight_s,
)
from lemtomap.topo.keeper import PlaceKeeper, Taken
from lemtomap.topo.learning import learn
from lemtomap.topo.levels import LevelDeparture, put_on_level
from lemtomap.topo.local import LocalMap, NodePoseEstimate
from lemtomap.topo.localisation import Localisation, Now, Transform
from lemtomap.topo.neighbours import NeighbourFinder, directly_navigable
from lemtomap.topo.recognition import (
    Closed,
    Confirmed,
    Found,
    Located,
    News,
    NotFound,
    Recogniser,
    Revoked,
    Situation,
)
from lemtomap.topo.repair import take_back
from lemtomap.topo.segmentation import UNASSIGNED, Neighbourhood, Segmenter
from lemtomap.topo.snapshots import Snapshots
from lemtomap.topo.whole.trail import ScanTrail
from lemtomap.types import (
    EdgeType,
    GridView,
    MapView,
    SlamUpdate,
)


class TopoMapper:
    """The topological map as it grows. Owned by the mapping thread; hands out immutable views.

    Holds: exactly one node is associated from the first scan on, and the next one is a new node or one of
    its neighbours (or the one a closure proves).
    """

    def __init__(
        self,
        config: TopoConfig,
        store: TopoStore,
        trail: ScanTrail | None = None,
        *,
        level: int = 0,
        recogniser: Recogniser | None = None,
        areas: Segmenter | None = None,
    ) -> None:
        """Go on with the store's map: in a new part of the graph, which a closure joins to the rest."""
        self.config = config
        self.store = store
        self.graph = PagedGraph(store, config.paged_nodes)
        self.local = LocalMap(self.graph, config)
        self.keeper = PlaceKeeper(config, self.graph, recogniser.describe if recogniser else None)
        self.trail = ScanTrail.temporary() if trail is None else trail
        self.level = level
        self.lost = False
        """The robot does not know where in the map it is; it maps on in a part of its own."""
        self.known_place = True
        """False: it gave up looking, and maps on as if this were new; a closure may still join the two."""
        self.part_id = 1
        """First node of the part of the graph made since the robot was lost or switched on."""
        self._recogniser = recogniser
        if recogniser is not None:
            recogniser.attach(self.graph)
        self._areas = areas
        if areas is not None:
            areas.attach(self.graph)
        self._news = News.NONE
        self._sure_m = 0.0
        self._neighbours = NeighbourFinder(config)
        self._at = Localisation(config, self.local, self.keeper)
        self._lift: LevelDeparture | None = None
        self._snapshots = Snapshots(self.graph, self.local)

    @property
    def associated_id(self) -> int:
        """The node the robot is at; 0 before the first scan."""
        return self._at.associated_id

    @property
    def travelled_m(self) -> float:
        """Way of the base since the start, metres."""
        return self._at.travelled_m

    @property
    def T_node_base(self) -> Pose:  # noqa: N802 - a frame's name
        """Where the robot is relative to the associated node."""
        return self._at.T_node_base

    @property
    def transform(self) -> Transform:
        """How the associated node's pose in the window is known."""
        return self._at.transform

    @property
    def now(self) -> tuple[SlamUpdate, GridView]:
        """What the last scan said, and the window."""
        return self._at.now.slam, self._at.now.grid

    @property
    def started(self) -> bool:
        """Whether the robot stands at a node: not before the first scan, nor between two windows."""
        return self._at.last is not None

    def update(
        self,
        slam: SlamUpdate,
        grid: GridView,
        points_base: NDArray[np.floating] | None = None,
        fit: float = 1.0,
    ) -> None:
        """Take in what one scan told the window SLAM.

        `grid` is the window after this scan (an older snapshot will do between integrations);
        `points_base` are the scan's hits, float (N, 2), metres, base frame. Without them the window's cells
        must do for localisation data. `fit`: how well the scan fits the window, as a share of what is usual.
        """
        before, self._at.last, self._news = self._at.last, Now(slam, grid, fit), News.NONE
        self.keeper.observe(slam.T_grid_base, points_base)
        if before is None:
            self._begin()
            slam = replace(slam, step_covariance=NOWHERE)
        else:
            self._at.move(before.slam)
            if grid is not before.grid:
                self.local.release_forgotten(grid)
            self._associate_or_create()
        self._recognise()
        if self._areas is not None:
            self._areas.update(self._neighbourhood())
        standing = self.local.standings[self._at.associated_id]
        seen = standing.seen if standing.anchored else None
        self.trail.append(slam, self._at.associated_id, self.T_node_base, seen, points_base)
        self.store.tick(slam.stamp_s)

    # -- the steps of Figure 3-6 ----------------------------------------------------------------------------

    def _begin(self) -> None:
        """Stand on a first node; in a map that knows places already, look for one of them."""
        if self._lift is not None:
            self._leave_lift(self._lift)
            return
        known = self._recogniser is not None and any(True for _ in self.store.places())
        self.part_id = self._birth()
        self.local.settle(self.part_id)
        if known:
            self.lost, self._news = True, News.LOST

    def _associate_or_create(self) -> None:
        """Only a neighbour or a new node can come next, and only one that no wall hides.

        The thesis assumes half a metre between robot and wall, so that no node beyond one is ever nearer than
        a metre; Kobuki goes closer, hence the look at the window.
        """
        near, far = self.config.association_margin_m, self.config.new_node_distance_m
        associated_m = self._at.distance_m(self._at.associated_id)
        nearest_id = self._nearest_neighbour(associated_m - near)
        if nearest_id:
            self._associate(nearest_id)
        elif associated_m > far or (associated_m > 0.5 * far and not self._at.sees(self._at.associated_id)):
            self._create()
        else:
            self._at.try_again()

    def _nearest_neighbour(self, within_m: float) -> int:
        """Return the nearest neighbour of the associated node in sight; 0 when none is so near."""
        nearest_id, nearest_m = 0, within_m
        for edge in self.graph.edges_of(self._at.associated_id):
            other_id = edge.other(self._at.associated_id)
            if other_id not in self.local.standings:
                continue
            other_m = self._at.distance_m(other_id)
            if other_m < nearest_m and self._at.sees(other_id):
                nearest_id, nearest_m = other_id, other_m
        return nearest_id

    def _associate(self, node_id: int) -> None:
        """Make an existing node the associated node; find where it stands if the window does not know."""
        node = self.graph.node(node_id)
        self.graph.put_node(replace(node, visits=node.visits + 1))
        self._take_places()
        self.keeper.review(node_id)
        self._at.stand_at(node_id)
        for seam in self._neighbours.seams_at(node_id, self.graph, self.local, self._at.now.grid):
            self.graph.add_edge(seam)
        self._news = News.NODE

    def _create(self) -> None:
        """Make a node here, with its odometry edge and all near-neighbour edges that help."""
        previous_id, T_previous_new = self._at.associated_id, self._at.T_node_base
        covariance = self._at.covariance + COVARIANCE_FLOOR
        node_id = self._birth()
        self.graph.add_edge(Edge(0, previous_id, node_id, T_previous_new, covariance, EdgeType.ODOMETRY))
        self._take_places()
        self.local.settle(node_id)
        self._at.anchor_beside()
        here = node_id, self.graph, self.local, self._at.now.grid
        for edge in chain(self._neighbours.edges_for(*here), self._neighbours.seams_at(*here)):
            self.graph.add_edge(edge)
        self._news = News.NODE

    def _birth(self) -> int:
        before_id, stamp_s = self._at.associated_id, self._at.now.slam.stamp_s
        if self._areas is not None:
            area_id = UNASSIGNED
        else:
            area_id = self.graph.node(before_id).area_id if before_id else 1
        node_id = self.graph.add_node(area_id=area_id, level=self.level, created_s=stamp_s).node_id
        self._at.begin_at(node_id)
        self.keeper.due(node_id)
        return node_id

    def _take_places(self) -> None:
        now = self._at.now
        self._tell(self.keeper.take_ripe(self.local, now.slam.T_grid_base, now.grid, now.slam.stamp_s))

    def _tell(self, taken: list[Taken]) -> None:
        if self._recogniser is not None:
            for each in taken:
                self._recogniser.place_taken(each.node_id, each.place)

    # -- what is recognised ---------------------------------------------------------------------------------

    def _recognise(self) -> None:
        """Let the recogniser of places work, and carry out what it decides."""
        if self._recogniser is None:
            return
        for decision in self._recogniser.update(self._situation()):
            match decision:
                case Closed():
                    self._close(decision, self._recogniser)
                case Revoked(edge_ids):
                    self.revoke(*edge_ids)
                case Located():
                    self._join(decision, self._recogniser)
                case Confirmed(found):
                    self._anchor_found(found)
                case NotFound():
                    self.found(known=False)

    def _neighbourhood(self) -> Neighbourhood:
        now = self._at.now
        return Neighbourhood(
            self._at.associated_id,
            now.slam.T_grid_base,
            self.travelled_m,
            now.slam.stamp_s,
            now.grid,
            self.local.standings,
            self.config.occupied_from,
            self.level,
        )

    def _situation(self) -> Situation:
        now, here_id, sure = self._at.now, self._at.associated_id, self.local.sure()
        if self._news is News.NODE and not self.lost and here_id in sure:
            self._sure_m = self.travelled_m
        here = self.local.standings[here_id]
        return Situation(
            here_id,
            here.T_grid_node,
            here.covariance,
            now.slam.T_grid_base,
            self.travelled_m,
            self._at.turned_rad,
            now.grid,
            self.travelled_m - self._sure_m,
            sure,
            self.keeper.hits,
            self.config.occupied_from,
            self._news,
            self.lost,
            self.part_id,
        )

    def _close(self, closed: Closed, recogniser: Recogniser) -> None:
        """Commit closures that belong together; who is unsure of his node stands at the nearest found."""
        edges = [
            self.close_loop(each.here_id, each.found.node_id, each.T_here_node, each.covariance)
            for each in closed.closures
            if each.informs
        ]
        recogniser.committed(closed, edges)
        found = [each.found for each in closed.closures]
        for each in found:
            self._anchor_found(each)
        if not self.local.standings[self._at.associated_id].sure:
            nearest = min(found, key=lambda each: self._at.gap_m(each.T_grid_node))
            self._stand_at(nearest)
            self._anchor_found(nearest)

    def _join(self, located: Located, recogniser: Recogniser) -> None:
        """Join the robot's part of the map to where it was found, and stand there if it is near."""
        found, here_id = located.found, self._at.associated_id
        here = self.local.standings[here_id]
        T_here_node = between(here.T_grid_node, found.T_grid_node)
        doubt = reversed_covariance(here.T_grid_node, here.covariance)
        covariance = chain_covariance(doubt, found.T_grid_node, found.covariance)
        edge = self.close_loop(here_id, found.node_id, T_here_node, covariance)
        recogniser.committed(located, [edge])
        if self.lost:
            self.adopt_level(self.graph.node(found.node_id).level)
            self._stand_at(found)
        self._anchor_found(found)
        self.found()

    def _stand_at(self, found: Found) -> None:
        """Make a node that was found the associated one if the robot is at it.

        From further off an odometry edge would begin there that nobody has driven.
        """
        if self._at.gap_m(found.T_grid_node) <= self.config.new_node_distance_m:
            self.relocate(found.node_id, found.T_grid_node, found.covariance)

    def _anchor_found(self, found: Found) -> None:
        self.local.anchor_found(found.node_id, found.T_grid_node, found.covariance)

    # -- closures and parts of the map ----------------------------------------------------------------------

    def standing(self, node_id: int) -> NodePoseEstimate | None:
        """Return where a node of the neighbourhood stands in the window, None beyond it."""
        return self.local.standings.get(node_id)

    def close_loop(
        self, source_id: int, target_id: int, T_source_target: Pose, covariance: Covariance
    ) -> Edge:
        """Commit a closure between two nodes, of one component or two; returns the edge, for revoke.

        A target of a source in this window now stands there too, and over a free line it can be driven to.
        """
        edge = Edge(0, source_id, target_id, np.array(T_source_target), covariance, EdgeType.LOOP_CLOSING)
        source = self.local.standings.get(source_id)
        if source is not None and source.anchored:
            T_grid_target = compose(source.T_grid_node, T_source_target)
            joined = chain_covariance(source.covariance, edge.T_source_target, covariance)
            self.local.anchor(target_id, T_grid_target, joined)
            if directly_navigable(self._at.now.grid, source.T_grid_node, T_grid_target, self.config):
                edge = replace(edge, time_s=straight_s(edge.length_m))
        edge = self.graph.add_edge(edge)
        self.local.settle(self._at.associated_id)
        return edge

    def revoke(self, *edge_ids: int) -> None:
        """Take back closures, with what they made the window believe and what grew from them since."""
        if not take_back(self.graph, self.local, edge_ids, COVARIANCE_FLOOR):
            return
        node_id = self._at.own_nearest() or self._at.associated_id
        self.local.settle(node_id)
        self._at.stand_at(node_id)

    def change_level(self, level: int) -> None:
        """Say that the robot is on another level now (a lift, the end of a ramp).

        What the window shows belongs to the level it left: the next scan, from a window of its own, begins
        with a node that an odometry edge, the lift or ramp, joins to the last one. Near-neighbour edges and
        closures join one level only.
        """
        if level != self.level and self._at.last is not None:
            at = self._at
            self._lift = LevelDeparture.left(at.associated_id, at.T_node_base, at.covariance, at.now.slam)
            self.lose()
        self.level = level

    def _leave_lift(self, lift: LevelDeparture) -> None:
        node_id, self._lift = self._birth(), None
        self.graph.add_edge(lift.edge_to(node_id, self._at.now.slam, COVARIANCE_FLOOR))
        self.local.settle(node_id)
        self._news = News.WINDOW

    def adopt_level(self, level: int) -> None:
        """Put what was mapped since the robot was lost on the level on which it proves to be."""
        if level != self.level:
            put_on_level(self.graph, self.part_id, level)
            self.level = level

    def lose(self) -> None:
        """Say that the robot is somewhere else now (carried, pushed away).

        The next scan, from a window of its own, begins a new part of the graph, joined to nothing until a
        closure joins it to the rest.
        """
        now = self._at.last
        if now is None:
            return
        self._tell(self.keeper.take_all(self.local.standings, now.grid, now.slam.stamp_s))
        self.keeper.forget_window()
        self.local.forget_all()
        self._at.last = None

    def found(self, *, known: bool = True) -> None:
        """Say that the robot knows its place again, or that this must be a place not mapped yet."""
        self.lost, self.known_place = False, known

    def relocate(self, node_id: int, T_grid_node: Pose, covariance: Covariance) -> None:
        """Make a known node the associated one because it was recognised in the window."""
        self.local.anchor(node_id, np.array(T_grid_node), covariance)
        self._at.stand_at(node_id)

    # -- what others say and see ----------------------------------------------------------------------------

    def apply(self, event: NavEvent) -> None:
        """Learn what navigation found out. Before the first scan there is nothing to learn it for."""
        if isinstance(event, NothingKnownHere):
            if self.lost:
                self.found(known=False)
        elif self._at.last is not None:
            learn(event, self.graph, self._at.associated_id, self.T_node_base)

    def view(self, particles: NDArray[np.float64] | None = None) -> MapView:
        """Return an immutable snapshot of the neighbourhood. Raises NotStarted before the first scan."""
        now, at_id = self.now, self._at.associated_id
        quality = 0.0 if self.lost else self._at.quality(self.config.watch)
        view = self._snapshots.take(now, at_id, quality, lost=self.lost, particles=particles)
        if self._areas is None:
            return view
        return replace(view, area_of=self._areas.area_of, doors=self._areas.doors_grid)

    def close(self) -> None:
        """Write everything and close the map file; the trail stays readable."""
        try:
            now = self._at.last
            if now is not None:
                self._tell(self.keeper.take_all(self.local.standings, now.grid, now.slam.stamp_s))
        finally:
            self.store.close()
