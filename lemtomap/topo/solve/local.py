"""The solve of every step: some hundred poses near the robot, the rest of the map untouched."""

import numpy as np
from numpy.typing import NDArray

from lemtomap.se2 import Pose
from lemtomap.topo.kernels import solve as kernels
from lemtomap.topo.solve.problem import (
    NormalEquations,
    Problem,
    Solution,
    minimise,
)


def solve_local(problem: Problem, start: Pose, fixed: NDArray[np.bool_], iterations: int = 20) -> Solution:
    """Return the poses that fit the edges best, those of `fixed` (bool (N,)) held.

    Poses should come in an order where neighbours are near one another (nearest to the anchor first).
    """
    slot = np.where(fixed, -1, np.cumsum(~fixed) - 1).astype(np.int64)
    unknowns = int(np.count_nonzero(~fixed))
    if unknowns == 0 or len(problem.ends) == 0:
        return Solution(np.array(start, dtype=np.float64), problem.chi2(start), 0, converged=True)
    first = kernels.envelope(problem.ends, slot, unknowns)

    def solve(blocks: NormalEquations, damping: float) -> NDArray[np.float64] | None:
        definite, step = kernels.solve_envelope(*blocks, problem.ends, slot, first, damping)
        return step if definite else None

    return minimise(problem, start, solve, iterations)
