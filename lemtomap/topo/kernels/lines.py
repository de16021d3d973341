"""Jitted directions of point clouds."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Values = NDArray[np.float64]


@njit(nogil=True, cache=True)
def line_normals(
    points_m: Values,
    reach_m: float,
) -> Values:
    """Return float64 (N, 3): unit normal x, y of the line through each point's neighbourhood and how thin
    that
    neighbourhood is (1 a line, 0 round or alone).
    """
    n = points_m.shape[0]
    result = np.zeros((n, 3))
    if n == 0:
        return result
    # strips as wide as the reach, one after another in `along`: neighbours lie in three short stretches
    low_x, low_y = points_m[:, 0].min(), points_m[:, 1].min()
    strip = np.floor((points_m[:, 0] - low_x) / reach_m)
    length = points_m[:, 1].max() - low_y + 4.0 * reach_m  # no stretch reaches into the next strip
    along = strip * length + (points_m[:, 1] - low_y)
    order = np.argsort(along)
    xs, ys = points_m[order, 0], points_m[order, 1]  # side by side in memory, as they are visited
    along = along[order]
    reach2 = reach_m * reach_m
    for k in range(n):
        i = order[k]
        x, y = xs[k], ys[k]
        count, sx, sy, sxx, sxy, syy = 0, 0.0, 0.0, 0.0, 0.0, 0.0
        for aside in range(-1, 2):
            middle = along[k] + aside * length
            m = np.searchsorted(along, middle - 1.001 * reach_m)
            while m < n and along[m] <= middle + 1.001 * reach_m:
                dx, dy = xs[m] - x, ys[m] - y
                if dx * dx + dy * dy <= reach2:
                    count += 1
                    sx += dx
                    sy += dy
                    sxx += dx * dx
                    sxy += dx * dy
                    syy += dy * dy
                m += 1
        if count < 3:
            continue
        mx, my = sx / count, sy / count
        cxx, cxy, cyy = sxx / count - mx * mx, sxy / count - mx * my, syy / count - my * my
        half, root = 0.5 * (cxx + cyy), np.sqrt(0.25 * (cxx - cyy) ** 2 + cxy * cxy)
        large, small = half + root, half - root
        angle = 0.5 * np.arctan2(2.0 * cxy, cxx - cyy)
        result[i, 0] = -np.sin(angle)
        result[i, 1] = np.cos(angle)
        result[i, 2] = 1.0 - max(small, 0.0) / large if large > 1e-12 else 0.0
    return result
