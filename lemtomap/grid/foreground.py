"""What stands alone in front of the rest of a scan: a person, a chair leg, a post.

In a bare corridor one such thing alone tells how far along the robot is, and a person who walks ahead at its
own pace says with a hundred beams that the robot stands. When a match contradicts the wheels, such things are
ignored.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lemtomap.grid.beams import Beams

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
    count = len(hits_base)
    if count == 0:
        return np.zeros(0, dtype=np.bool_)
    gaps_m = np.hypot(*np.diff(hits_base, axis=0).T)
    first = np.concatenate([[0], np.flatnonzero(gaps_m > GAP_M) + 1])
    last = np.concatenate([first[1:] - 1, [count - 1]])
    extent_m = np.hypot(*(hits_base[last] - hits_base[first]).T)
    range_m = np.hypot(*hits_base.T)
    before = np.where(first > 0, range_m[first - 1], 0.0)
    after = np.where(last < count - 1, range_m[(last + 1) % count], 0.0)
    in_front = (before > range_m[first]) & (after > range_m[last])
    return np.repeat((extent_m <= COMPACT_M) & in_front, last - first + 1)
