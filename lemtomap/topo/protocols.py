"""What the mapper shows of itself to loop closing and to whoever asks how well it knows its place."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from lemtomap.errors import LemtomapError
from lemtomap.topo.graph import Covariance, Place

if TYPE_CHECKING:
    from lemtomap.topo.mapper import TopoMapper


class NotStarted(LemtomapError):
    """A snapshot was asked for before the first scan."""


@dataclass(frozen=True, slots=True)
class Transform:
    """How the local grid map transform of the associated node is known (thesis, section 3-3-2)."""

    measured: bool
    """False: the graph's prediction stands in."""
    covariance: Covariance
    """float64 (3, 3), axes of the node."""
    score: float = 1.0
    reason: str = ""
    """Why it is not measured."""


class Recogniser(Protocol):
    """Explicit loop closing, as the mapper sees it."""

    def describe(self, points_node: NDArray[np.float64]) -> bytes:
        """Return the rotation-invariant descriptor of boundary points, float64 (N, 2), node frame."""
        ...

    def place_taken(self, node_id: int, place: Place) -> None:
        """Take note of a node's localisation data, new or renewed."""
        ...

    def at_node(self, mapper: "TopoMapper", *, born: bool) -> None:
        """A node was made or became the associated one."""
        ...

    def lost(self, mapper: "TopoMapper") -> None:
        """The robot does not know where in the map it is: nodes from `mapper.part_id` on are a part apart."""
        ...

    def window_changed(self, mapper: "TopoMapper") -> None:
        """The window began anew, on another level: nothing found in the old one counts any more."""
        ...

    def update(self, mapper: "TopoMapper") -> None:
        """Work a slice after each scan; may call close_loop, revoke, relocate or found."""
        ...
