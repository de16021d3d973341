"""Furniture as boxes: what the laser plane (0.25 m) sees of it is often not what the body meets."""

import math

from lemtomap.sim.world import Box, Surface

LEG_M = 0.02  # half a leg's width


def _turned(x: float, y: float, yaw: float, dx: float, dy: float) -> tuple[float, float]:
    return x + dx * math.cos(yaw) - dy * math.sin(yaw), y + dx * math.sin(yaw) + dy * math.cos(yaw)


def cabinet(x: float, y: float, yaw: float, size: tuple[float, float] = (1.2, 0.45)) -> list[Box]:
    """Return a closed cabinet: seen as it is."""
    return [Box((x, y, 0.6), (size[0] / 2, size[1] / 2, 0.6), yaw, surface=Surface.FURNITURE)]


def table(x: float, y: float, yaw: float, size: tuple[float, float] = (1.4, 0.7)) -> list[Box]:
    """Return a table: the laser sees four legs; its top at 0.72 m is above the robot."""
    boxes = [Box((x, y, 0.73), (size[0] / 2, size[1] / 2, 0.015), yaw, surface=Surface.FURNITURE)]
    for sx in (-1, 1):
        for sy in (-1, 1):
            px, py = _turned(x, y, yaw, sx * (size[0] / 2 - 0.05), sy * (size[1] / 2 - 0.05))
            boxes.append(Box((px, py, 0.36), (LEG_M, LEG_M, 0.36), yaw, surface=Surface.FURNITURE))
    return boxes


def office_chair(x: float, y: float, yaw: float) -> list[Box]:
    """Return a swivel chair: one thin column for the laser, a star foot 0.06 m high for the bumper."""
    boxes = [
        Box((x, y, 0.24), (0.025, 0.025, 0.18), yaw, surface=Surface.DARK),
        Box((x, y, 0.45), (0.22, 0.22, 0.03), yaw, surface=Surface.DARK),
    ]
    for k in range(5):
        angle = yaw + k * 2 * math.pi / 5
        px, py = _turned(x, y, angle, 0.14, 0.0)
        boxes.append(Box((px, py, 0.04), (0.14, 0.02, 0.025), angle, surface=Surface.DARK))
    return boxes


def sofa(x: float, y: float, yaw: float) -> list[Box]:
    """Return a black leather sofa: hardly any light comes back."""
    return [Box((x, y, 0.35), (0.9, 0.4, 0.35), yaw, surface=Surface.DARK)]


def bin_low(x: float, y: float) -> list[Box]:
    """Return a low crate, 0.12 m high: under the laser plane, in the way of the bumper."""
    return [Box((x, y, 0.06), (0.15, 0.15, 0.06), surface=Surface.FURNITURE)]
