"""The full solve, for exports and pictures only: nothing the robot does waits for it."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csc_matrix, diags_array
from scipy.sparse.linalg import splu, spsolve

from lemtomap.se2 import Pose
from lemtomap.topo.solve.problem import (
    NormalEquations,
    Problem,
    Solution,
    minimise,
)


def solve_whole(problem: Problem, start: Pose, fixed: NDArray[np.bool_], iterations: int = 100) -> Solution:
    """Return the poses that fit all edges best, those of `fixed` (bool (N,)) held.

    Hold one pose of each connected component; a free component drifts.
    """
    rows, cols = _pattern(problem.ends, len(start))
    free = np.repeat(~fixed, 3)

    def solve(blocks: NormalEquations, damping: float) -> NDArray[np.float64] | None:
        diagonal, across, gradient = blocks
        values = np.concatenate([diagonal.ravel(), across.ravel(), across.transpose(0, 2, 1).ravel()])
        matrix = coo_matrix((values, (rows, cols)), shape=(3 * len(start),) * 2).tocsc()
        step = np.zeros(3 * len(start))
        step[free] = _solve_free(matrix[free][:, free], -gradient.ravel()[free], damping)
        return step.reshape(-1, 3) if np.isfinite(step).all() else None

    return minimise(problem, start, solve, iterations)


def straightened(problem: Problem, start: Pose, fixed: NDArray[np.bool_]) -> Pose:
    """Return a better start: headings, then positions, each by one linear solve (Carlone et al. 2014).

    Turns round loops are taken from `start`, so a start along any spanning tree will do.
    """
    poses = np.array(start, dtype=np.float64)
    ends, measured = problem.ends, problem.measured
    weight = problem.information[:, 2, 2]
    turns = poses[ends[:, 1], 2] - poses[ends[:, 0], 2]
    wanted = measured[:, 2] + 2 * np.pi * np.rint((turns - measured[:, 2]) / (2 * np.pi))
    poses[:, 2] = _spread(ends, wanted, weight, poses[:, 2], fixed)
    heading = poses[ends[:, 0], 2]
    cos, sin = np.cos(heading), np.sin(heading)
    weight = np.sqrt(np.linalg.det(problem.information[:, :2, :2]))
    x = cos * measured[:, 0] - sin * measured[:, 1]
    y = sin * measured[:, 0] + cos * measured[:, 1]
    poses[:, 0] = _spread(ends, x, weight, poses[:, 0], fixed)
    poses[:, 1] = _spread(ends, y, weight, poses[:, 1], fixed)
    return poses


def _spread(
    ends: NDArray[np.int64],
    differences: NDArray[np.float64],
    weight: NDArray[np.float64],
    start: NDArray[np.float64],
    fixed: NDArray[np.bool_],
) -> NDArray[np.float64]:
    """Return values at the nodes whose weighted differences along edges fit best (a Laplace system)."""
    count, edges = len(start), np.arange(len(ends))
    incidence = coo_matrix(
        (
            np.concatenate([-np.ones(len(ends)), np.ones(len(ends))]),
            (np.concatenate([edges, edges]), np.concatenate([ends[:, 0], ends[:, 1]])),
        ),
        shape=(len(ends), count),
    ).tocsc()
    values = np.array(start)
    left = incidence[:, ~fixed]
    right = differences - incidence[:, fixed] @ start[fixed]
    weighted = left.T @ diags_array(weight)
    values[~fixed] = spsolve((weighted @ left).tocsc(), weighted @ right)
    return values


def _solve_free(matrix: csc_matrix, right: NDArray[np.float64], damping: float) -> NDArray[np.float64]:
    damped = matrix.copy()
    damped.setdiag(matrix.diagonal() * (1.0 + damping) + 1e-12)
    factors = splu(damped, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    return np.asarray(factors.solve(right))


def _pattern(ends: NDArray[np.int64], count: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return row and column of each value of the normal matrix, blocks in the order they are stacked."""
    row = np.repeat(np.arange(3), 3)
    col = np.tile(np.arange(3), 3)
    nodes = 3 * np.arange(count)[:, None]
    sources, targets = 3 * ends[:, :1], 3 * ends[:, 1:]
    rows = np.concatenate([(nodes + row).ravel(), (sources + row).ravel(), (targets + row).ravel()])
    cols = np.concatenate([(nodes + col).ravel(), (targets + col).ravel(), (sources + col).ravel()])
    return rows, cols
