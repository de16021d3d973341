"""Which nodes make an area: those that ways join which lead through no door (thesis, section 3-3-2).

The thesis gives every node born after a door a new area, and merges two areas that a closure joins. That
would fuse two rooms with two doors into one. Here an area is what stays joined when all ways through doors
are taken away, so that a closure merges two areas exactly if a way without a door joins both sides. An ID
stays with most of the nodes that had it; what is left over gets an ID that was never used.
"""

from collections import Counter, deque
from collections.abc import Collection, Iterable
from collections.abc import Set as AbstractSet
from dataclasses import replace

from lemtomap.areas.book import AreaBook
from lemtomap.areas.model import Area
from lemtomap.topo.file.paging import PagedGraph
from lemtomap.topo.segmentation import UNASSIGNED

MOST_FOLLOWED = 600
"""Nodes over which a way between two parts of an area is looked for; beyond, they are taken as joined."""


class Labeller:
    """Keeps the nodes' area IDs in line with doors and ways."""

    def __init__(self, graph: PagedGraph, book: AreaBook) -> None:
        self._graph = graph
        self._book = book

    def update(self, node_ids: Collection[int], cut: AbstractSet[int], level: int) -> None:
        """Give the nodes of a neighbourhood their areas.

        cut: IDs of the edges among them that lead through doors and narrow places.
        """
        parts = self._parts(node_ids, cut)
        claims = [self._claims(part) for part in parts]
        areas = self._book.some({area_id for claim in claims for area_id in claim})
        parts = self._joined_elsewhere(parts, claims, areas)
        claims = [self._claims(part) for part in parts]
        owners = self._owners(parts, claims)
        for part, claim in zip(parts, claims, strict=True):
            own = [area_id for area_id in claim if owners[area_id] is part or _is_held(areas, area_id)]
            self._settle(part, own, areas, level)

    # -- parts ----------------------------------------------------------------------------------------------

    def _parts(self, node_ids: Collection[int], cut: AbstractSet[int]) -> list[list[int]]:
        """Return the nodes in groups that ways without a door join, each by ID."""
        rest, parts = set(node_ids), []
        for start_id in sorted(node_ids):
            if start_id not in rest:
                continue
            rest.discard(start_id)
            part, waiting = [start_id], [start_id]
            while waiting:
                node_id = waiting.pop()
                for edge in self._graph.edges_of(node_id):
                    other_id = edge.other(node_id)
                    if other_id in rest and edge.is_proven and edge.edge_id not in cut:
                        rest.discard(other_id)
                        part.append(other_id)
                        waiting.append(other_id)
            parts.append(sorted(part))
        return parts

    def _claims(self, part: Iterable[int]) -> Counter[int]:
        claim = Counter(self._graph.node(node_id).area_id for node_id in part)
        claim.pop(UNASSIGNED, None)
        return claim

    def _joined_elsewhere(
        self, parts: list[list[int]], claims: list[Counter[int]], areas: dict[int, Area]
    ) -> list[list[int]]:
        """Return the parts, those of one area in one if a way beyond the neighbourhood joins them."""
        joined: list[list[int]] = []
        for part, claim in zip(parts, claims, strict=True):
            same = [
                k
                for k, other in enumerate(joined)
                if any(area_id in claim and not _is_held(areas, area_id) for area_id in self._claims(other))
            ]
            mate = next((k for k in same if self._is_joined(part, set(joined[k]))), None)
            if mate is None:
                joined.append(part)
            else:
                joined[mate] = joined[mate] + part
        return joined

    def _is_joined(self, part: Iterable[int], others: AbstractSet[int]) -> bool:
        """Return True if a way without a door leads from one part to another, or if that is far to tell."""
        met = set(part)
        waiting = deque(met)
        while waiting:
            for other_id in self._next_to(waiting.popleft()):
                if other_id in others:
                    return True
                if other_id not in met:
                    met.add(other_id)
                    waiting.append(other_id)
            if len(met) > MOST_FOLLOWED:
                return True
        return False

    def _next_to(self, node_id: int) -> list[int]:
        """Return the neighbours of a node to which a way without a door leads."""
        edges = [edge for edge in self._graph.edges_of(node_id) if edge.is_proven]
        crossed = self._book.crossed(edge.edge_id for edge in edges)
        return [edge.other(node_id) for edge in edges if edge.edge_id not in crossed]

    def _owners(self, parts: list[list[int]], claims: list[Counter[int]]) -> dict[int, list[int]]:
        """Return {area ID: the part that keeps it}: with most of the named nodes, then most of all."""
        named = set(self._graph.store.names().values())
        owners: dict[int, tuple[tuple[int, int, int], list[int]]] = {}
        for part, claim in zip(parts, claims, strict=True):
            for area_id, count in claim.items():
                names = sum(self._graph.node(k).area_id == area_id for k in named.intersection(part))
                rank = (names, count, -part[0])
                if area_id not in owners or rank > owners[area_id][0]:
                    owners[area_id] = rank, part
        return {area_id: part for area_id, (_, part) in owners.items()}

    # -- areas of one part ----------------------------------------------------------------------------------

    def _settle(self, part: list[int], own: list[int], areas: dict[int, Area], level: int) -> None:
        """Give all nodes of a part one area, unless persons have named or drawn more than one there."""
        fixed = [area_id for area_id in own if area_id in areas and _is_fixed(areas[area_id])]
        if len(fixed) > 1:
            self._adopt(part, set(fixed))
            return
        winner_id = min(fixed or own, default=0) or self._book.add_area(level).area_id
        if winner_id not in areas:
            areas[winner_id] = Area(winner_id, level=level)
            if not self._book.some([winner_id]):
                self._book.put_area(areas[winner_id])
        changed: dict[int, list[int]] = {}
        for node_id in part:
            before_id = self._graph.node(node_id).area_id
            if before_id != winner_id:
                self._label(node_id, winner_id)
                changed.setdefault(before_id, []).append(node_id)
        for before_id, node_ids in changed.items():
            if before_id != UNASSIGNED:
                self._follow(node_ids, before_id, winner_id)
                if before_id in own and not self._book.is_used(before_id):
                    self._absorb(winner_id, before_id)

    def _adopt(self, part: list[int], fixed: AbstractSet[int]) -> None:
        """Leave areas of persons as they are; every other node goes to that of the nearest of their nodes."""
        label = {k: self._graph.node(k).area_id for k in part}
        waiting = deque(node_id for node_id in part if label[node_id] in fixed)
        rest = {node_id for node_id in part if label[node_id] not in fixed}
        while waiting:
            node_id = waiting.popleft()
            for other_id in self._next_to(node_id):
                if other_id in rest:
                    rest.discard(other_id)
                    label[other_id] = label[node_id]
                    self._label(other_id, label[node_id])
                    waiting.append(other_id)

    def _label(self, node_id: int, area_id: int) -> None:
        self._graph.put_node(replace(self._graph.node(node_id), area_id=area_id))

    def _follow(self, node_ids: list[int], before_id: int, area_id: int) -> None:
        """Label what hangs together with relabelled nodes beyond the neighbourhood, too."""
        waiting = list(node_ids)
        while waiting:
            for other_id in self._next_to(waiting.pop()):
                if self._graph.node(other_id).area_id == before_id:
                    self._label(other_id, area_id)
                    waiting.append(other_id)

    def _absorb(self, winner_id: int, loser_id: int) -> None:
        """Let an area be an alias of the one that took it in, with all that it had taken in."""
        winner, loser = self._book.area(winner_id), self._book.area(loser_id)
        if winner is None or loser is None or winner == loser:
            return
        self._book.delete_area(loser_id)
        self._book.put_area(taken_in(winner, loser))


def taken_in(winner: Area, loser: Area) -> Area:
    """Return an area that has taken in another: IDs and names of both go on to mean it."""
    names = [name for name in (winner.name, loser.name) if name]
    return replace(
        winner,
        name=names[0] if names else "",
        kind=winner.kind or loser.kind,
        aliases=tuple(sorted({*winner.aliases, *loser.aliases, loser.area_id})),
        other_names=tuple(sorted({*winner.other_names, *loser.other_names, *names[1:]})),
    )


def _is_fixed(area: Area) -> bool:
    """Return True if a person has named an area or drawn it."""
    return bool(area.name) or area.is_held


def _is_held(areas: dict[int, Area], area_id: int) -> bool:
    return area_id in areas and areas[area_id].is_held
