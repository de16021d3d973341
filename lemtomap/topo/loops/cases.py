"""What closing loops works on: a place to search in the robot's situation."""

from dataclasses import dataclass

from lemtomap.se2 import Pose
from lemtomap.topo.loops.audit import Trial
from lemtomap.topo.loops.hypotheses import Hypothesis
from lemtomap.topo.loops.matcher import Reference, Search, SearchBox
from lemtomap.topo.recognition import Situation


@dataclass(slots=True)
class Task:
    """One place to search in one snapshot."""

    node_id: int
    situation: Situation
    reference: Reference
    box: SearchBox
    way_m: float
    """Way over edges from the node the robot was at."""
    hearing_for: Hypothesis | None = None
    follows: Hypothesis | None = None
    """The belief that says where the place should be found."""
    T_grid_followed: Pose | None = None
    on_trial: tuple[Trial, ...] = ()
    """Closures that say that the place must be here."""
    search: Search | None = None
