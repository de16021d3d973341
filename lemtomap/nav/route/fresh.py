"""The map as navigation plans over it: what mapping told last, over what the map file holds.

What mapping changes comes in the map view, together with everything else it tells; of the file navigation
reads only what has not changed since it was written. So what can be planned never waits for the disk.
"""

from collections.abc import Mapping, Sequence

from lemtomap.types import MapView, RouteEdge, RouteGraph


class FreshGraph:
    """A RouteGraph of a graph on file and the edges that a view has newer."""

    def __init__(self, stored: RouteGraph, map_view: MapView) -> None:
        self.stored = stored
        self.changed: Mapping[int, Sequence[RouteEdge]] = map_view.changed
        self._told_version = map_view.graph_version

    @property
    def version(self) -> int:
        """Changes with every change, whether the file has it or the view; not when it goes into the file."""
        return max(self.stored.version, self._told_version)

    def has_node(self, node_id: int) -> bool:
        """Return True if the file or the view knows this node."""
        return node_id in self.changed or self.stored.has_node(node_id)

    def edges_of(self, node_id: int) -> Sequence[RouteEdge]:
        """Return the edges at a node as they are now, blocked ones too; empty for an unknown node."""
        changed = self.changed.get(node_id)
        return self.stored.edges_of(node_id) if changed is None else changed
