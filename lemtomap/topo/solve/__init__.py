"""Least squares over node poses: the local solve each step uses, and the full one for export only."""

from lemtomap.topo.solve.local import solve_local
from lemtomap.topo.solve.problem import Problem, Solution
from lemtomap.topo.solve.whole import solve_whole, straightened

__all__ = ["Problem", "Solution", "solve_local", "solve_whole", "straightened"]
