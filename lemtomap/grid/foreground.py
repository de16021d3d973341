"""What stands alone in front of the rest of a scan: a person, a chair leg, a post.

In a bare corridor one such thing alone tells how far along the robot is, and a person who walks ahead at its
own pace says with a hundred beams that the robot stands. When a match contradicts the wheels, such things are
ignored.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lemtomap.grid.beams import Beams
from lemtomap.grid.kernels import scan as kernels

GAP_M = 0.3  # between neighbouring hits, at which one thing ends and another begins
COMPACT_M = 0.8  # a person with arms and stride; a wall's end that looks so small is rare and soon grows


def without_foreground(beams: Beams) -> Beams:
    """Return a scan without the small things that stand in front of what is seen beside them."""
    kept = ~is_foreground(beams.hits)
    return replace(beams, hits=beams.hits[kept], normals_rad=beams.normals_rad[kept])


def is_foreground(hits_base: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Tell which hits, float (N, 2), metres, in the order of their beams, belong to small things in front.

    At either end of the scan nothing tells what stands beside: that is kept.
    """
    return kernels.in_front(hits_base, GAP_M, COMPACT_M)
