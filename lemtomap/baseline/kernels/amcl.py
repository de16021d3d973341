"""Jitted functions of Monte Carlo localisation on plain arrays."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]
I8 = NDArray[np.int64]


@njit(nogil=True, cache=True)
def beam_log_likelihood(
    particles: F8, points_base: F8, away: F4, origin_x: float, origin_y: float, resolution: float,
    sigma_m: float, random_share: float, out: F8,
) -> None:  # fmt: skip
    """Write for each particle (x, y, yaw) the log likelihood of the points by the likelihood field model.

    away: cells to the nearest wall, capped (Thrun, Burgard and Fox, 2005, section 6.4).
    """
    rows, cols = away.shape
    worst = away.max()
    for i in range(particles.shape[0]):
        x, y, th = particles[i, 0], particles[i, 1], particles[i, 2]
        cos, sin = np.cos(th), np.sin(th)
        total = 0.0
        for j in range(points_base.shape[0]):
            px = x + cos * points_base[j, 0] - sin * points_base[j, 1]
            py = y + sin * points_base[j, 0] + cos * points_base[j, 1]
            r = int(np.floor((py - origin_y) / resolution))
            c = int(np.floor((px - origin_x) / resolution))
            d = worst
            if 0 <= r < rows and 0 <= c < cols:
                d = away[r, c]
            d *= resolution
            total += np.log((1.0 - random_share) * np.exp(-0.5 * d * d / (sigma_m * sigma_m)) + random_share)
        out[i] = total


@njit(nogil=True, cache=True)
def kld_resample(
    particles: F8, weights: F8, draws: F8, least: int, most: int, error: float, quantile: float, cells: I8
) -> int:
    """Write indices of drawn particles into cells[:n] and return n, chosen so that the error stays bounded.

    Draws until the bins filled so far (0.5 m, 10 degrees) say it is enough (Fox, 2003). draws: in [0, 1).
    """
    cumulative = np.cumsum(weights)
    cumulative /= cumulative[-1]
    filled = set()
    wanted = float(least)
    count = 0
    while count < most and count < max(wanted, float(least)):
        index = min(np.searchsorted(cumulative, draws[count]), particles.shape[0] - 1)
        cells[count] = index
        count += 1
        key = (
            int(np.floor(particles[index, 0] / 0.5)),
            int(np.floor(particles[index, 1] / 0.5)),
            int(np.floor(particles[index, 2] / 0.17453)),
        )
        if key not in filled:
            filled.add(key)
            k = len(filled)
            if k > 1:
                b = 2.0 / (9.0 * (k - 1))
                a = 1.0 - b + np.sqrt(b) * quantile
                wanted = (k - 1) / (2.0 * error) * a * a * a
    return count
