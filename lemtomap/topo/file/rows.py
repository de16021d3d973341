"""Rows of the map file ⇄ nodes and edges."""

import math
import struct
from collections.abc import Sequence
from typing import Any

import numpy as np

from lemtomap.topo.graph import (
    Covariance,
    Edge,
    Node,
    OpeningState,
    Placeholder,
)
from lemtomap.types import EdgeType

NODE_COLUMNS = "id, area, level, created, visits, doubts"
EDGE_COLUMNS = "id, source, target, type, share, time, blocked, measure"

MEASURE = struct.Struct("<3d3e3h")
"""Relative pose in full; of the covariance standard deviations to a thousandth, and correlations."""
CORRELATION_STEPS = 32767
_SHRINK = 1.0 - 2e-4  # of correlations: rounded, the covariance must stay positive definite
_LEAST_SIGMA, _MOST_SIGMA = 1e-4, 6e4  # of half precision
TYPES = (EdgeType.ODOMETRY, EdgeType.NEAR_NEIGHBOUR, EdgeType.LOOP_CLOSING)
_CODES = {kind: code for code, kind in enumerate(TYPES)}
SHARE_STEPS = 255
PLACE_FORMAT, MOST_PLACE_CELLS = 2, 120
"""First two bytes of coded localisation data: the format, and at most so many cells to each side."""


def node_row(node: Node) -> tuple[Any, ...]:
    """Return the node's values in the order of NODE_COLUMNS."""
    return (node.node_id, node.area_id, node.level, node.created_s, node.visits, node.doubts)


def node_from(row: Sequence[Any]) -> Node:
    """Return the node of a row in the order of NODE_COLUMNS."""
    return Node(*row)


def edge_row(edge: Edge) -> tuple[Any, ...]:
    """Return the edge's values in the order of EDGE_COLUMNS."""
    measure = MEASURE.pack(*edge.T_source_target, *_spread(edge.covariance))
    return (
        edge.edge_id,
        edge.source_id,
        edge.target_id,
        _CODES[edge.type],
        round(edge.share * SHARE_STEPS),
        edge.time_s,
        edge.blocked_until_s or None,
        measure,
    )


def edge_from(row: Sequence[Any]) -> Edge:
    """Return the edge of a row in the order of EDGE_COLUMNS."""
    edge_id, source, target, code, share, time_s, blocked_s, measure = row
    values = MEASURE.unpack(measure)
    return Edge(
        edge_id,
        source,
        target,
        np.array(values[:3]),
        _covariance(values[3:6], values[6:]),
        TYPES[code],
        share / SHARE_STEPS,
        time_s,
        blocked_s or 0.0,
    )


def planar_length_m(measure: bytes) -> float:
    """Return the length of an edge from its stored measure alone (planning needs no more)."""
    x, y = struct.unpack_from("<2d", measure)
    return float(np.hypot(x, y))


def placeholder_from(row: Sequence[Any]) -> Placeholder:
    """Return the opening of a row (id, node, x, y, yaw, width, state)."""
    number, node_id, x_m, y_m, yaw_rad, width_m, state = row
    return Placeholder(number, node_id, x_m, y_m, yaw_rad, width_m, OpeningState(state))


def type_code(kind: EdgeType) -> int:
    """Return the number that stands for this type in the file."""
    return _CODES[kind]


def _spread(covariance: Covariance) -> tuple[float, ...]:
    """Return three standard deviations and three correlations in steps."""
    xx, yy, tt = (math.sqrt(covariance[k, k]) for k in range(3))
    pairs = ((0, 1, xx * yy), (0, 2, xx * tt), (1, 2, yy * tt))
    steps = [round(_SHRINK * float(covariance[i, j]) / scale * CORRELATION_STEPS) for i, j, scale in pairs]
    return (*(min(max(sigma, _LEAST_SIGMA), _MOST_SIGMA) for sigma in (xx, yy, tt)), *steps)


def _covariance(sigmas: Sequence[float], steps: Sequence[int]) -> Covariance:
    x, y, t = sigmas
    xy, xt, yt = (step / CORRELATION_STEPS for step in steps)
    return np.array(
        [[x * x, xy * x * y, xt * x * t], [xy * x * y, y * y, yt * y * t], [xt * x * t, yt * y * t, t * t]]
    )
