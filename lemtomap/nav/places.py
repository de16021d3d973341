"""The place that a program asks for: a node's number, a name or a goal, looked up in a map file."""

from lemtomap.errors import BadSample, NoRoute
from lemtomap.nav.types import Goal
from lemtomap.samples import as_whole, shown
from lemtomap.topo import naming
from lemtomap.topo.file.reader import TopoReader


def goal_at(place: Goal | int | str, graph: TopoReader) -> Goal:
    """Return the goal that a place means.

    Raises BadSample for what is no place, NoRoute for a place that this map does not have.
    """
    if isinstance(place, str):
        return Goal(_node_called(place, graph))
    if not isinstance(place, Goal):
        try:
            place = Goal(as_whole("place", place))
        except BadSample:
            what = f"must be a node's number, its name or a Goal, is {shown(place)}"
            raise BadSample(f"place: {what}") from None
    if not graph.has_node(place.node_id):
        raise NoRoute(f"{graph.path}: there is no node {place.node_id}")
    return place


def _node_called(text: str, graph: TopoReader) -> int:
    names = graph.names()
    node_id = naming.node_meant(text, names, graph.has_node)
    if node_id is None:
        told = naming.told_instead(text, names)
        raise NoRoute(f"{graph.path}: there is no place '{naming.shown(text)}' ({told})")
    return node_id
