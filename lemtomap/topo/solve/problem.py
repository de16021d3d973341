"""A pose graph as arrays, and Levenberg-Marquardt over it; how the linear step is solved is the caller's."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lemtomap.se2 import Pose, wrap_angle
from lemtomap.topo.graph import Edge
from lemtomap.topo.kernels import solve as kernels
from lemtomap.types import EdgeType

ROBUST_PHI = 11.3  # 99 % of chi-squared with 3 degrees of freedom: beyond it a closure is doubted
LEAST_SHARE = 1.0 / 255.0  # an edge that tells less than this tells nothing
FLAT = 1e-10  # relative gain below which the minimum is reached
MAX_DAMPING = 1e8


@dataclass(frozen=True, slots=True)
class Problem:
    """Edges between N poses given by index."""

    ends: NDArray[np.int64]
    """int64 (M, 2): source and target index."""
    measured: NDArray[np.float64]
    """float64 (M, 3): T_source_target."""
    information: NDArray[np.float64]
    """float64 (M, 3, 3), axes of the target."""
    phi: NDArray[np.float64]
    """float64 (M,): chi2 beyond which the edge is doubted; 0 never."""

    @classmethod
    def of_edges(cls, edges: Sequence[Edge], index: dict[int, int], *, robust: bool = True) -> "Problem":
        """Take the edges that hold information of their own and whose ends are both in `index`."""
        used = [e for e in edges if e.share >= LEAST_SHARE and e.source_id in index and e.target_id in index]
        ends = np.array([(index[e.source_id], index[e.target_id]) for e in used], np.int64).reshape(-1, 2)
        measured = np.array([e.T_source_target for e in used], np.float64).reshape(-1, 3)
        covariance = np.array([e.covariance for e in used], np.float64).reshape(-1, 3, 3)
        share = np.array([e.share for e in used])
        doubted = [robust and e.type is not EdgeType.ODOMETRY for e in used]
        information = np.linalg.inv(covariance) * share[:, None, None]
        return cls(ends, measured, information, np.where(doubted, ROBUST_PHI, 0.0))

    def costs(self, poses: Pose) -> NDArray[np.float64]:
        """Return the (robust) squared Mahalanobis residual of each edge, float64 (M,)."""
        return kernels.costs(poses, self.ends, self.measured, self.information, self.phi)

    def chi2(self, poses: Pose) -> float:
        """Return the sum of all edges' costs."""
        return float(np.sum(self.costs(poses)))


@dataclass(frozen=True, slots=True)
class Solution:
    """Where the poses came to rest."""

    poses: Pose
    """float64 (N, 3)."""
    chi2: float
    iterations: int
    converged: bool


NormalEquations = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]
LinearSolver = Callable[[NormalEquations, float], NDArray[np.float64] | None]
"""(blocks from kernels.linearise, damping) → step (N, 3), zero at fixed poses; None when not solvable."""


def minimise(problem: Problem, start: Pose, solve: LinearSolver, iterations: int) -> Solution:
    """Run Levenberg-Marquardt (Nielsen's damping) from `start`, float64 (N, 3)."""
    poses = np.array(start, dtype=np.float64)
    cost = problem.chi2(poses)
    damping, growth = 1e-6, 2.0
    for iteration in range(1, iterations + 1):
        blocks = kernels.linearise(poses, problem.ends, problem.measured, problem.information, problem.phi)
        while True:
            step = solve(blocks, damping)
            trial = poses if step is None else _moved(poses, step)
            trial_cost = problem.chi2(trial)
            if step is not None and trial_cost <= cost:
                break
            damping, growth = damping * growth, growth * 2.0
            if damping > MAX_DAMPING:
                return Solution(poses, cost, iteration, converged=True)
        flat = cost - trial_cost <= FLAT * cost
        poses, cost = trial, trial_cost
        damping, growth = max(damping / 5.0, 1e-12), 2.0
        if flat:
            return Solution(poses, cost, iteration, converged=True)
    return Solution(poses, cost, iterations, converged=False)


def _moved(poses: Pose, step: NDArray[np.float64]) -> Pose:
    moved = poses + step
    moved[:, 2] = wrap_angle(moved[:, 2])
    return moved
