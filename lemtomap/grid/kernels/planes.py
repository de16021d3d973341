"""Kernels of the planes: averaged hits around a cell in, that cell's surface normal out. Plain arrays, no
classes.

Arrays as in lemtomap.grid.kernels.window. A thin wall has two faces within reach of one fit, and together
they are no plane; so only hits seen from the same side of the surface count.
"""

import math
from typing import Any

from numba import njit
from numpy.typing import NDArray

Array = NDArray[Any]

NONE = 255
WHOLE = 65535.0
LIFTS = 254.0
MIN_PLANE_POINTS = 4
PLANE_RADIUS = 3
PLANE_RATIO = 0.1
FAR = 127.0
GLANCE = 0.1  # cosine: a look along a surface does not tell which of its sides was seen


@njit(nogil=True, cache=True)
def is_other_face(nx: float, ny: float, whence: Array, to_x: float, to_y: float) -> bool:
    """Return True if a cell was seen from the other side of its surface, normal (nx, ny), than a hit is now,
    whose laser lies at (to_x, to_y) from it.
    """
    now = nx * to_x + ny * to_y
    then = nx * whence[0] + ny * whence[1]
    if now * then >= 0.0 or abs(then) < GLANCE * FAR:
        return False
    return bool(now * now >= GLANCE * GLANCE * (to_x * to_x + to_y * to_y))


@njit(nogil=True, cache=True)
def _spread(
    window: Any, gx: int, gy: int, nx: float, ny: float
) -> tuple[int, float, float, float, float, float]:
    """Return (cells, mean x, mean y, variance xx, xy, yy) of the averaged hits around a cell, in cells from
    its corner.

    Only hits seen from the side of the normal (nx, ny) that this cell was seen from count; (0, 0) lets in
    all.
    """
    evidence, mean, whence, origin = window.evidence, window.mean, window.whence, window.origin
    n = evidence.shape[0]
    row, col = gy % n, gx % n
    front = nx * whence[row, col, 0] + ny * whence[row, col, 1]
    if front < 0.0:
        nx, ny = -nx, -ny
    if abs(front) < GLANCE * FAR:
        nx = ny = 0.0
    cells = 0
    k = 0.0
    sx = sy = sxx = sxy = syy = 0.0
    for dy in range(-PLANE_RADIUS, PLANE_RADIUS + 1):
        cy = gy + dy
        if cy < origin[1] or cy >= origin[1] + n:
            continue
        row = cy % n
        for dx in range(-PLANE_RADIUS, PLANE_RADIUS + 1):
            cx = gx + dx
            if cx < origin[0] or cx >= origin[0] + n:
                continue
            col = cx % n
            if evidence[row, col] > 0 and nx * whence[row, col, 0] + ny * whence[row, col, 1] > -GLANCE * FAR:
                x = dx + mean[row, col, 0] / WHOLE
                y = dy + mean[row, col, 1] / WHOLE
                w = float(window.averaged[row, col])
                cells += 1
                k += w
                sx += w * x
                sy += w * y
                sxx += w * x * x
                sxy += w * x * y
                syy += w * y * y
    sx, sy = sx / k, sy / k
    return cells, sx, sy, sxx / k - sx * sx, sxy / k - sx * sy, syy / k - sy * sy


@njit(nogil=True, cache=True)
def renew_normal(window: Any, gx: int, gy: int, seen_rad: float) -> None:
    """Fit a plane through the averaged hit points around an occupied cell; where these are too few, the
    plane is what the scan saw there, seen_rad in grid or NaN.
    """
    mean, normal = window.mean, window.normal
    n = normal.shape[0]
    row, col = gy % n, gx % n
    normal[row, col] = NONE
    seen = not math.isnan(seen_rad)
    nx = ny = 0.0
    if seen:
        nx, ny = math.cos(seen_rad), math.sin(seen_rad)
    for _ in range(1 if seen else 2):
        cells, x, y, sxx, sxy, syy = _spread(window, gx, gy, nx, ny)
        if cells < MIN_PLANE_POINTS:
            break
        half = 0.5 * (sxx - syy)
        root = math.sqrt(half * half + sxy * sxy)
        middle = 0.5 * (sxx + syy)
        angle = (0.5 * math.atan2(sxy, half) + 0.5 * math.pi) % math.pi
        nx, ny = math.cos(angle), math.sin(angle)
        if middle - root <= PLANE_RATIO * (middle + root):
            normal[row, col] = int(angle * 255.0 / math.pi + 0.5) % 255
            off = (x - mean[row, col, 0] / WHOLE) * nx + (y - mean[row, col, 1] / WHOLE) * ny
            window.lift[row, col] = int(min(max(round(off * LIFTS), -127), 127))
            return
    if seen and cells < MIN_PLANE_POINTS:
        normal[row, col] = int(seen_rad % math.pi * 255.0 / math.pi + 0.5) % 255
        window.lift[row, col] = 0
