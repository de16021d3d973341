"""A window SLAM of one's own making: a robot led along a line through a room, without rays or noise."""

import itertools
from collections.abc import Iterator

import numpy as np

from lemtomap.se2 import between, compose, pose
from lemtomap.types import GridView, SlamUpdate

STEP_COVARIANCE = np.diag([1e-5, 1e-5, 1e-5])
MATCH_COVARIANCE = np.diag([1e-4, 1e-4, 1e-5])


def room(size_m=20.0, resolution_m=0.05, walls=(), origin_m=None) -> GridView:
    """A free window; walls are (x0, y0, x1, y1) boxes in metres, grid frame."""
    cells = round(size_m / resolution_m)
    origin = (-size_m / 2, -size_m / 2) if origin_m is None else origin_m
    occupancy = np.zeros((cells, cells), np.int8)
    for x0, y0, x1, y1 in walls:
        c0, c1 = (round((x - origin[0]) / resolution_m) for x in (x0, x1))
        r0, r1 = (round((y - origin[1]) / resolution_m) for y in (y0, y1))
        occupancy[max(r0, 0) : r1, max(c0, 0) : c1] = 100
    occupancy.setflags(write=False)
    return GridView(0.0, occupancy, resolution_m, origin)


def along(corners, step_m=0.1, start_s=0.0, rate_hz=5.0) -> Iterator[tuple[float, np.ndarray]]:
    """Poses along straight legs, facing ahead."""
    stamp = start_s
    for a, b in itertools.pairwise(np.asarray(corners, float)):
        heading = np.arctan2(*(b - a)[::-1])
        for k in range(max(1, round(np.linalg.norm(b - a) / step_m))):
            at = a + (b - a) * k * step_m / np.linalg.norm(b - a)
            yield stamp, pose(at[0], at[1], heading)
            stamp += 1.0 / rate_hz


def said(stamp_s, T_grid_base, **changes) -> SlamUpdate:
    """What a perfect window SLAM says at a pose."""
    values = {
        "stamp_s": stamp_s,
        "T_grid_base": T_grid_base,
        "T_grid_odom": np.zeros(3),
        "covariance": MATCH_COVARIANCE,
        "step_covariance": STEP_COVARIANCE,
        "quality": 1.0,
        "diversity": 1.0,
        "matched": True,
        "integrated": True,
    }
    return SlamUpdate(**(values | changes))


def lead(mapper, corners, grid, *, shift=None, start_s=0.0, step_m=0.1) -> float:
    """Drive the mapper along corners; `shift` moves the grid frame. Returns the stamp after the last scan."""
    stamp = start_s
    for stamp, at in along(corners, step_m, start_s):
        mapper.update(said(stamp, at if shift is None else compose(shift, at)), grid)
    return stamp + 0.2


def relative(poses, of_id) -> dict:
    return {node_id: between(poses[of_id], T) for node_id, T in poses.items()}
