"""Least squares over node poses: the local solve each step uses; `whole` is for export only."""

from lemtomap.topo.solve.local import solve_local
from lemtomap.topo.solve.problem import Problem, Solution

__all__ = ["Problem", "Solution", "solve_local"]
