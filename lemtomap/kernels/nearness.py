"""Which points lie near others."""

from typing import Any

from numba import njit
from numpy.typing import NDArray

Array = NDArray[Any]


@njit(nogil=True, cache=True)
def share_near(points: Array, others: Array, reach: float, stride: int) -> float:
    """Return the share, 0 to 1, of every stride-th point that has one of the others nearer than `reach`.

    points, others: (N, 2) and (M, 2), one frame, the unit of `reach`; there must be at least one point.
    """
    near = count = 0
    last = 0  # the other that was near the point before: neighbours in a scan lie side by side
    for i in range(0, len(points), stride):
        count += 1
        for k in range(len(others)):
            j = (last + k) % len(others)
            dx, dy = others[j, 0] - points[i, 0], others[j, 1] - points[i, 1]
            if dx * dx + dy * dy < reach * reach:
                near += 1
                last = j
                break
    return near / count
