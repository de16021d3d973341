"""Jitted functions of local motion on plain arrays: trajectory roll-outs and arc collision checks."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]


@njit(nogil=True, cache=True)
def _read(field: F4, row: float, col: float) -> float:
    """Bilinear value of a field; inf neighbours are left out; inf when all are."""
    height, width = field.shape
    r, c = row - 0.5, col - 0.5
    r0, c0 = int(np.floor(r)), int(np.floor(c))
    fr, fc = r - r0, c - c0
    total, weight = 0.0, 0.0
    for i in range(2):
        for j in range(2):
            rr, cc = r0 + i, c0 + j
            if rr < 0 or cc < 0 or rr >= height or cc >= width:
                continue
            t = field[rr, cc]
            if np.isinf(t):
                continue
            w = (fr if i else 1.0 - fr) * (fc if j else 1.0 - fc)
            total += w * t
            weight += w
    return total / weight if weight > 0.2 else np.inf


@njit(nogil=True, cache=True)
def _read_ahead(
    field: F4, cost: F4, dearest: float, price_share: float, row: float, col: float, yaw: float, cells: float
) -> float:
    """Value of a field straight ahead and the price of the way to there, less its length, in cells.

    inf where something is in between: it is read round no corner.
    """
    height, width = field.shape
    dr, dc = np.sin(yaw), np.cos(yaw)
    excess = 0.0
    for step in range(int(cells)):
        r, c = int(np.floor(row + dr * (step + 1))), int(np.floor(col + dc * (step + 1)))
        if r < 0 or c < 0 or r >= height or c >= width or np.isinf(field[r, c]):
            return np.inf
        excess += price_share * (min(cost[r, c], dearest) - 1.0)
    return _read(field, row + dr * cells, col + dc * cells) + excess


@njit(nogil=True, cache=True)
def _approach(value: float, wanted: float, step: float) -> float:
    return min(max(wanted, value - step), value + step)


@njit(nogil=True, cache=True)
def score_trajectories(
    field: F4,
    cost: F4,
    clearance: F4,
    resolution: float,
    row: float,
    col: float,
    yaw: float,
    v_now: float,
    w_now: float,
    vs: F8,
    ws: F8,
    acceleration: float,
    braking: float,
    turn_acceleration: float,
    horizon_s: float,
    step_s: float,
    forward_m: float,
    body_m: float,
    dearest: float,
    price_share: float,
    turn_weight: float,
    change_weight: float,
    ending: int,
    scores: F8,
) -> int:
    """Write the score of each (v, w): metres of way to go, lower is better; inf where it would collide.

    Of the price of the way made (cost: of a cell of way, dearest at most) the part above its length counts
    by price_share: what is gained by cutting a corner is paid for along it. A trajectory ramps from the
    present velocity to its own within the limits of acceleration, then holds it. It may meet an obstacle
    only further off than its braking distance. `ending` 1: the field's target is where to stop, so that a
    trajectory is as good as its best point. Returns the index of the best, or -1.
    """
    steps = int(np.ceil(horizon_s / step_s))
    best, best_score = -1, np.inf
    height, width = clearance.shape
    for i in range(vs.size):
        for j in range(ws.size):
            v, w, r, c, th = v_now, w_now, row, col, yaw
            length, excess, crashed = 0.0, 0.0, False
            least = np.inf
            for _ in range(steps):
                rate = acceleration if vs[i] > v else braking
                v = _approach(v, vs[i], rate * step_s)
                w = _approach(w, ws[j], turn_acceleration * step_s)
                mid = th + 0.5 * w * step_s
                nr = r + np.sin(mid) * v * step_s / resolution
                nc = c + np.cos(mid) * v * step_s / resolution
                ri, ci = int(np.floor(nr)), int(np.floor(nc))
                d = 0.0
                if ri >= 0 and ci >= 0 and ri < height and ci < width:
                    d = clearance[ri, ci] * resolution
                if d < body_m:
                    crashed = True
                    break
                r, c, th = nr, nc, th + w * step_s
                length += v * step_s
                excess += price_share * (min(cost[ri, ci], dearest) - 1.0) * v * step_s
                if ending == 1:
                    least = min(least, _read(field, r, c))
            if crashed and length < vs[i] * vs[i] / (2.0 * braking) + 0.05 + vs[i] * step_s:
                scores[i, j] = np.inf
                continue
            here = _read(field, r, c)
            ahead = _read_ahead(field, cost, dearest, price_share, r, c, th, forward_m / resolution)
            if np.isinf(here):
                scores[i, j] = np.inf
                continue
            to_go = min(least, here + 2.0 * forward_m / resolution if np.isinf(ahead) else ahead) * resolution
            score = to_go + excess + turn_weight * abs(ws[j]) + change_weight * abs(ws[j] - w_now)
            if ending == 1:
                score -= 0.3 * vs[i]  # all that pass the target are as good: do not dawdle
            scores[i, j] = score
            if score < best_score:
                best, best_score = i * ws.size + j, score
    return best


@njit(nogil=True, cache=True)
def free_arc_length(points: F8, v: float, w: float, radius: float, horizon_s: float, step_s: float) -> float:
    """Return metres the body (a disc) can drive on the arc (v, w) until it touches a point; inf if never.

    points: float64 (N, 2), base frame. A point already inside counts only when the arc leads nearer to it.
    """
    steps = int(np.ceil(horizon_s / step_s))
    x, y, th = 0.0, 0.0, 0.0
    r2 = radius * radius
    length = 0.0
    for _ in range(steps):
        mid = th + 0.5 * w * step_s
        nx, ny = x + np.cos(mid) * v * step_s, y + np.sin(mid) * v * step_s
        th += w * step_s
        for i in range(points.shape[0]):
            dx, dy = points[i, 0] - nx, points[i, 1] - ny
            d2 = dx * dx + dy * dy
            if d2 < r2:
                ox, oy = points[i, 0] - x, points[i, 1] - y
                if d2 < ox * ox + oy * oy:
                    return length
        length += abs(v) * step_s
        x, y = nx, ny
    return np.inf
