"""What the window shows of the ground: where large patches are unseen, and what is in sight of what."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lemtomap.kernels.lines import first_on_line
from lemtomap.nav.kernels import explore as kernels
from lemtomap.nav.kernels import fields
from lemtomap.nav.motion.metric import Reach, top_cost
from lemtomap.se2 import Pose

NEAR_CELLS = 5
"""Remembered ground is drawn this much too large; new ground begins beyond."""
NECK_M = 0.8
"""So deep may the dark be too narrow for a patch before it widens: a corridor between walls seen edge-on."""
JUDGED_M = 0.5
"""Nearer to the window's border than this nothing is said about an opening."""
UP_TO_M = 0.3
"""An opening's place in the window may be off by this much."""
AROUND_M = 0.5
"""So much around an opening must be shown, more of it than not, before a look can settle that it is none."""


@dataclass(frozen=True, slots=True)
class Ground:
    """One look at the window."""

    reach: Reach
    large: NDArray[np.uint8]
    """uint8 (rows, cols), 1 on unseen ground of some depth."""
    leads: NDArray[np.uint8]
    """uint8 (rows, cols), 1 on hidden ground from which the robot gets to such ground."""

    @classmethod
    def of(cls, reach: Reach, seen: NDArray[np.uint8], least_depth_m: float, body_m: float) -> Self:
        """Return the ground as a window shows it.

        seen: uint8 (rows, cols), 1 where the ground is known or was known once; unseen ground counts
        where it fills a square of twice least_depth_m. body_m: radius of the robot.
        """
        costs, res = reach.costs, reach.costs.resolution_m
        large = np.asarray(kernels.large_unknown(seen, max(1, round(least_depth_m / res))))
        leads = kernels.leading_on(
            costs.state, seen, costs.clearance, large, body_m / res, round(NECK_M / res), NEAR_CELLS
        )
        return cls(reach, large, np.asarray(leads))

    def still_open(self, p_grid: ArrayLike) -> bool:
        """Return True if an opening that was not found again at its place may still lead to unseen ground.

        It does not where the window shows the floor up to it; it may where that has been forgotten, or where
        only a few beams came by: they make a way up to it, but no edge wide enough to be found.
        """
        costs = self.reach.costs
        if not costs.holds(p_grid, JUDGED_M):
            return True
        if self.reach.nearest(p_grid, UP_TO_M) is not None:
            around = AROUND_M / costs.resolution_m
            return bool(kernels.barely_shown(costs.state, self.large, *costs.cell(p_grid), around))
        return bool(kernels.dark_in_sight(costs.state, self.large, *costs.cell(p_grid), NEAR_CELLS + 2.0))

    def walled_off(self, p_grid: ArrayLike, q_grid: ArrayLike) -> bool:
        """Return True if an obstacle stands between two places."""
        return self._holds_on_line(p_grid, q_grid, kernels.LETHAL)

    def node_in_sight(self, p_grid: ArrayLike, T_grid_node: Mapping[int, Pose], otherwise_id: int) -> int:
        """Return the nearest node from which the robot gets straight to a place over known floor.

        The nearest of all may stand in the next room, or see it through a rack that no robot fits through.
        Where none has a straight way it is the node with the shortest one, and without any the one given.
        """
        p = np.asarray(p_grid, dtype=np.float64)[:2]
        away = {node_id: float(np.hypot(*(T[:2] - p))) for node_id, T in T_grid_node.items()}
        costs, ends = self.reach.costs, UP_TO_M / self.reach.costs.resolution_m
        for node_id in sorted(away, key=lambda n: away[n]):
            line = (*costs.cell(T_grid_node[node_id]), *costs.cell(p))
            if kernels.fits_between(costs.cost, costs.state, *line, ends):
                return node_id
        way = self._ways_to(p, T_grid_node)
        if way:
            return min(way, key=lambda n: way[n])
        return otherwise_id if otherwise_id in away else min(away, key=lambda n: away[n])

    def _ways_to(self, p_grid: NDArray[np.float64], T_grid_node: Mapping[int, Pose]) -> dict[int, float]:
        """Return the cost (cells) of the way over known floor from each node that has one."""
        costs, near = self.reach.costs, self.reach.nearest(p_grid, UP_TO_M)
        if near is None:
            return {}
        seed = np.array([near[0] * costs.state.shape[1] + near[1]], dtype=np.int64)
        field = fields.march(costs.cost, seed, np.zeros(1), -1, 0.0, top_cost(costs))
        cells = {node_id: self.reach.nearest(T, UP_TO_M) for node_id, T in T_grid_node.items()}
        ways = {node_id: float(field[cell[0], cell[1]]) for node_id, cell in cells.items() if cell}
        return {node_id: way for node_id, way in ways.items() if np.isfinite(way)}

    def _holds_on_line(self, p_grid: ArrayLike, q_grid: ArrayLike, least: int) -> bool:
        """Return True if a state that bad lies between two places; beyond the window all is unknown."""
        costs = self.reach.costs
        line = (*costs.cell(p_grid), *costs.cell(q_grid))
        return bool(np.isfinite(first_on_line(costs.state, *line, least, kernels.UNKNOWN)))
